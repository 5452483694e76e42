#include "dupin/warp/refine.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dupin/warp/smooth_mesh.h"

namespace dupin {
namespace {

using Triangulation = PlanarTriangulation;
constexpr std::int32_t kNone = Triangulation::kNone;

std::size_t at(std::int32_t index) { return static_cast<std::size_t>(index); }

double length(GridPoint a, GridPoint b) {
  return std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
}

class Refiner {
 public:
  Refiner(Triangulation& mesh, BorderKnowledge& border, const RefinementOptions& options)
      : mesh_(mesh),
        border_(border),
        options_(options),
        bound_(options.min_angle_rad > 0.0 ? 1.0 / std::tan(options.min_angle_rad) : HUGE_VAL) {}

  RefinementCounts run(const RunControl& control) {
    for (std::int32_t e = 0; e < 4 * mesh_.num_triangles(); ++e)
      if ((e & 3) != 3) look_at_border(e);
    split_encroached(control);
    for (std::int32_t t = 0; t < mesh_.num_triangles(); ++t) look_at_triangle(t);
    while (!bad_.empty() && !stopped(control)) {
      std::pop_heap(bad_.begin(), bad_.end());
      const Bad worst = bad_.back();
      bad_.pop_back();
      if (still_there(worst)) improve(worst.corner[0], worst.triangle);
      split_encroached(control);
    }
    return counts_;
  }

 private:
  struct Piece {
    std::int32_t edge, from, to;
  };
  struct Bad {
    double cotangent;
    std::int32_t triangle;
    std::int32_t corner[3];
    bool operator<(const Bad& other) const {
      if (cotangent != other.cotangent) return cotangent < other.cotangent;
      return triangle > other.triangle;
    }
  };

  bool stopped(const RunControl& control) {
    if ((++ticks_ & 255) == 0 && control.cancelled()) return true;
    if (mesh_.num_triangles() < options_.max_triangles) return false;
    counts_.hit_limit = true;
    return true;
  }

  GridPoint origin(std::int32_t e) const { return mesh_.p(mesh_.origin[at(e)]); }
  GridPoint destination(std::int32_t e) const { return mesh_.p(mesh_.destination(e)); }

  bool still_there(const Bad& b) const {
    for (std::int32_t i = 0; i < 3; ++i)
      if (mesh_.origin[at(4 * b.triangle + i)] != b.corner[i]) return false;
    return true;
  }

  void look_at_border(std::int32_t e) {
    if (mesh_.twin[at(e)] != kNone) return;
    if (dot(mesh_.p(mesh_.apex(e)), origin(e), destination(e)) < 0)
      encroached_.push_back({e, mesh_.origin[at(e)], mesh_.destination(e)});
  }

  void look_at_triangle(std::int32_t t) {
    const std::int32_t* v = &mesh_.origin[at(4 * t)];
    const double cotangent = largest_cotangent(mesh_.p(v[0]), mesh_.p(v[1]), mesh_.p(v[2]));
    if (cotangent <= bound_ || is_forced_by_corner(mesh_, border_, t)) return;
    bad_.push_back({cotangent, t, {v[0], v[1], v[2]}});
    std::push_heap(bad_.begin(), bad_.end());
  }

  void look_around(std::int32_t v, bool want_triangles) {
    const std::int32_t first = mesh_.leaving[at(v)];
    const auto look = [&](std::int32_t e) {
      const std::int32_t t = e >> 2;
      for (std::int32_t i = 0; i < 3; ++i) look_at_border(4 * t + i);
      if (want_triangles) look_at_triangle(t);
    };
    std::int32_t e = first;
    do {
      look(e);
      e = mesh_.twin[at(Triangulation::previous(e))];
    } while (e != kNone && e != first);
    if (e == first) return;
    // On the border: the rest of the star lies the other way.
    for (e = mesh_.twin[at(first)]; e != kNone; e = mesh_.twin[at(e)]) {
      e = Triangulation::next(e);
      look(e);
    }
  }

  // The grid point on border edge e where it is to be split; false if its parts would be too short.
  bool split_point(std::int32_t e, GridPoint& found) const {
    const GridPoint a = origin(e), b = destination(e);
    const std::int64_t dx = std::int64_t{b.x} - a.x, dy = std::int64_t{b.y} - a.y;
    const std::int64_t steps = std::gcd(dx, dy);
    const double whole = length(a, b);
    if (steps < 2 || whole < 2.0 * options_.min_length) return false;
    std::int64_t step = steps / 2;
    const bool sharp_a = border_.is_sharp[at(mesh_.origin[at(e)])] != 0;
    const bool sharp_b = border_.is_sharp[at(mesh_.destination(e))] != 0;
    if (sharp_a != sharp_b) {
      const double shell = std::exp2(std::round(std::log2(0.5 * whole)));
      step = std::llround(shell / whole * static_cast<double>(steps));
      step = std::clamp<std::int64_t>(sharp_a ? step : steps - step, 1, steps - 1);
    }
    found = {static_cast<std::int32_t>(a.x + dx / steps * step),
             static_cast<std::int32_t>(a.y + dy / steps * step)};
    return true;
  }

  bool split(std::int32_t e, bool want_triangles) {
    GridPoint middle;
    if (!split_point(e, middle)) return false;
    const std::int32_t parent = mesh_.segment[at(e)];
    const std::int32_t v = mesh_.insert(middle, {Triangulation::Place::edge, e});
    border_.segment_before.push_back(parent);
    border_.segment_after.push_back(parent);
    border_.is_sharp.push_back(0);
    ++counts_.num_splits;
    look_around(v, want_triangles);
    return true;
  }

  void split_encroached(const RunControl& control) {
    while (!encroached_.empty() && !stopped(control)) {
      const Piece piece = encroached_.back();
      encroached_.pop_back();
      const std::int32_t e = piece.edge;
      if (mesh_.origin[at(e)] != piece.from || mesh_.destination(e) != piece.to) continue;
      if (dot(mesh_.p(mesh_.apex(e)), origin(e), destination(e)) < 0) split(e, has_triangles_);
    }
    has_triangles_ = true;
  }

  GridPoint circumcentre(std::int32_t t) const {
    const std::int32_t* v = &mesh_.origin[at(4 * t)];
    const GridPoint a = mesh_.p(v[0]), b = mesh_.p(v[1]), c = mesh_.p(v[2]);
    const auto area = static_cast<double>(orientation(a, b, c));
    const double bx = double(b.x) - a.x, by = double(b.y) - a.y;
    const double cx = double(c.x) - a.x, cy = double(c.y) - a.y;
    const double b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
    const double x = a.x + 0.5 * (cy * b2 - by * c2) / area;
    const double y = a.y + 0.5 * (bx * c2 - cx * b2) / area;
    constexpr double kFar = 1 << 30;  // beyond the border in any case
    return {static_cast<std::int32_t>(std::llround(std::clamp(x, -kFar, kFar))),
            static_cast<std::int32_t>(std::llround(std::clamp(y, -kFar, kFar)))};
  }

  // Border edges in whose diametral circle `centre` lies, among those it would see.
  void collect_encroached(GridPoint centre, std::int32_t start) {
    cavity_.assign(1, start);
    blocked_.clear();
    for (std::size_t i = 0; i < cavity_.size(); ++i) {
      for (std::int32_t k = 0; k < 3; ++k) {
        const std::int32_t e = 4 * cavity_[i] + k;
        const std::int32_t beyond = mesh_.twin[at(e)];
        if (beyond == kNone) {
          if (dot(centre, origin(e), destination(e)) < 0)
            blocked_.push_back({e, mesh_.origin[at(e)], mesh_.destination(e)});
          continue;
        }
        const std::int32_t t = beyond >> 2;
        if (std::find(cavity_.begin(), cavity_.end(), t) != cavity_.end()) continue;
        const std::int32_t* v = &mesh_.origin[at(4 * t)];
        if (in_circle(mesh_.p(v[0]), mesh_.p(v[1]), mesh_.p(v[2]), centre) > 0)
          cavity_.push_back(t);
      }
    }
  }

  void improve(std::int32_t first_corner, std::int32_t t) {
    const GridPoint centre = circumcentre(t);
    const Triangulation::Location where = mesh_.locate(centre, 4 * t, true);
    if (where.place == Triangulation::Place::vertex) return;
    if (where.place == Triangulation::Place::blocked) {
      if (split(where.edge, true)) look_again(first_corner, t);
      return;
    }
    if (where.place == Triangulation::Place::edge && mesh_.twin[at(where.edge)] == kNone) {
      if (split(where.edge, true)) look_again(first_corner, t);
      return;
    }
    collect_encroached(centre, where.edge >> 2);
    if (!blocked_.empty()) {
      bool has_split = false;
      for (const Piece& piece : blocked_) {
        const std::int32_t e = piece.edge;
        if (mesh_.origin[at(e)] == piece.from && mesh_.destination(e) == piece.to)
          has_split = split(e, true) || has_split;
      }
      if (has_split) look_again(first_corner, t);
      return;
    }
    const std::int32_t v = mesh_.insert(centre, where);
    border_.segment_before.push_back(kNone);
    border_.segment_after.push_back(kNone);
    border_.is_sharp.push_back(0);
    ++counts_.num_steiner;
    look_around(v, true);
  }

  // After a split elsewhere the triangle may still be there, and still bad.
  void look_again(std::int32_t first_corner, std::int32_t t) {
    if (mesh_.origin[at(4 * t)] == first_corner) look_at_triangle(t);
  }

  Triangulation& mesh_;
  BorderKnowledge& border_;
  RefinementOptions options_;
  double bound_;
  bool has_triangles_ = false;
  std::uint32_t ticks_ = 0;
  RefinementCounts counts_;
  std::vector<Piece> encroached_, blocked_;
  std::vector<Bad> bad_;
  std::vector<std::int32_t> cavity_;
};

}  // namespace

bool is_forced_by_corner(const PlanarTriangulation& mesh, const BorderKnowledge& border,
                         std::int32_t t) {
  std::int32_t shortest = 4 * t;
  double least = HUGE_VAL;
  for (std::int32_t e = 4 * t; e < 4 * t + 3; ++e) {
    const double l = length(mesh.p(mesh.origin[at(e)]), mesh.p(mesh.destination(e)));
    if (l < least) {
      least = l;
      shortest = e;
    }
  }
  const std::int32_t top = mesh.apex(shortest);
  if (border.is_sharp[at(top)] != 0 && mesh.twin[at(Triangulation::next(shortest))] == kNone &&
      mesh.twin[at(Triangulation::previous(shortest))] == kNone)
    return true;
  const std::int32_t u = mesh.origin[at(shortest)], v = mesh.destination(shortest);
  const auto corner_between = [&](std::int32_t s, std::int32_t r) {
    if (s == kNone || r == kNone || s == r) return kNone;
    if (border.to[at(s)] == border.from[at(r)]) return border.to[at(s)];
    if (border.to[at(r)] == border.from[at(s)]) return border.to[at(r)];
    return kNone;
  };
  for (const std::int32_t s : {border.segment_before[at(u)], border.segment_after[at(u)]}) {
    for (const std::int32_t r : {border.segment_before[at(v)], border.segment_after[at(v)]}) {
      const std::int32_t corner = corner_between(s, r);
      if (corner == kNone || corner == u || corner == v || border.is_sharp[at(corner)] == 0)
        continue;
      const double du = length(mesh.p(corner), mesh.p(u)), dv = length(mesh.p(corner), mesh.p(v));
      // On one circle about the corner, up to the steps a segment can be split at.
      if (std::abs(du - dv) <= 0.02 * std::max(du, dv)) return true;
    }
  }
  return false;
}

RefinementCounts refine(PlanarTriangulation& mesh, BorderKnowledge& border,
                        const RefinementOptions& options, const RunControl& run) {
  return Refiner(mesh, border, options).run(run);
}

}  // namespace dupin
