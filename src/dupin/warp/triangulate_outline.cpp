#include "dupin/warp/triangulate_outline.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/grid_outline.h"
#include "dupin/warp/hexagonal_lattice.h"
#include "dupin/warp/planar_triangulation.h"
#include "dupin/warp/refine.h"
#include "dupin/warp/smooth_mesh.h"
#include "dupin/warp/spatial_order.h"

namespace dupin {
namespace {

using Eigen::Index;
using Triangulation = PlanarTriangulation;
constexpr std::int32_t kNone = Triangulation::kNone;

// Points of the lattice keep this many spacings from the border: with edges of one spacing none is
// inside a diametral circle, and triangles between are near equilateral.
constexpr double kBorderClearance = 0.7;
constexpr double kPinClearance = 0.6;
constexpr double kShortestPart = 0.01;  // of the spacing: border edges are not split below it

std::size_t at(std::int64_t index) { return static_cast<std::size_t>(index); }

void check(const MeshingOptions& options, const Points2& fixed_points) {
  const auto is_within = [](double value, double low, double high) {
    return std::isfinite(value) && value >= low && value <= high;
  };
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) throw InvalidArgument(what);
  };
  require(is_within(options.spacing_px, 0.5, 16384.0), "spacing_px is outside [0.5, 16384]");
  require(is_within(options.min_angle_deg, 0.0, 30.0), "min_angle_deg is outside [0, 30]");
  require(options.max_triangles >= 1 && options.max_triangles <= std::int64_t{1} << 28,
          "max_triangles is outside [1, 2^28]");
  require(is_within(options.smoothing_passes, 0, 1000), "smoothing_passes is outside [0, 1000]");
  for (Index i = 0; i < fixed_points.rows(); ++i)
    require(std::isfinite(fixed_points(i, 0)) && std::isfinite(fixed_points(i, 1)),
            "fixed point " + std::to_string(i) + " has a coordinate that is not finite");
}

// One meshing run: the outline in grid coordinates and what grows from it.
class Mesher {
 public:
  Mesher(const Outline& outline, const MeshingOptions& options)
      : grid_(outline),
        options_(options),
        spacing_(options.spacing_px / kMeshStep),
        mesh_(grid_.box_low(), grid_.box_high(), 0) {
    border_.from.assign(grid_.segments().size(), kNone);
    border_.to = border_.from;
  }

  TriangulatedOutline run(const Points2& fixed_points, const RunControl& control) {
    result_.fixed_vertex.assign(at(fixed_points.rows()), kNone);
    place_fixed_points(fixed_points);
    refuse_over_limit(least_triangles());
    const std::vector<GridPoint> lattice = hexagonal_lattice(
        grid_.segments(), pins_, spacing_, kBorderClearance * spacing_, kPinClearance * spacing_);
    refuse_over_limit(first_triangles(lattice.size()));
    result_.report.num_lattice_points = static_cast<std::int64_t>(lattice.size());
    insert_points(lattice, control);
    if (control.cancelled()) return cancelled();
    control.report(0.4);
    insert_segments();
    mesh_.keep_only(grid_.label_triangles(mesh_));
    know_border();
    const RefinementCounts refined = refine(mesh_, border_,
                                            {options_.min_angle_deg * std::numbers::pi / 180.0,
                                             kShortestPart * spacing_, options_.max_triangles},
                                            control);
    if (control.cancelled()) return cancelled();
    control.report(0.7);
    const SmoothingCounts smoothed =
        smooth_mesh(mesh_, free_vertices(), options_.smoothing_passes, control.stage(0.7, 1.0));
    if (control.cancelled()) return cancelled();
    result_.status = refined.hit_limit ? Status::not_converged : Status::ok;
    result_.report.num_splits = refined.num_splits;
    result_.report.num_steiner = refined.num_steiner;
    result_.report.num_moves = smoothed.num_moves;
    result_.report.num_refused_moves = smoothed.num_refused;
    write_mesh();
    write_border();
    judge_angles();
    return std::move(result_);
  }

 private:
  static TriangulatedOutline cancelled() {
    TriangulatedOutline nothing;
    nothing.status = Status::cancelled;
    return nothing;
  }

  // pins_ become the distinct fixed points inside; pin_of_ the index into corners and pins.
  void place_fixed_points(const Points2& fixed_points) {
    struct Entry {
      GridPoint p;
      std::int32_t place;
    };
    const auto before = [](GridPoint a, GridPoint b) { return a.x != b.x ? a.x < b.x : a.y < b.y; };
    std::vector<Entry> known;
    const auto num_corners = static_cast<std::int32_t>(grid_.segments().size());
    if (fixed_points.rows() > 0)
      for (std::int32_t c = 0; c < num_corners; ++c) known.push_back({grid_.corner(c), c});
    const auto order = [&](const Entry& a, const Entry& b) { return before(a.p, b.p); };
    std::sort(known.begin(), known.end(), order);
    pin_of_.assign(at(fixed_points.rows()), kNone);
    for (Index i = 0; i < fixed_points.rows(); ++i) {
      GridPoint p;
      if (!grid_.to_grid(fixed_points(i, 0), fixed_points(i, 1), p) || !grid_.contains(p)) continue;
      const auto found = std::lower_bound(known.begin(), known.end(), Entry{p, 0}, order);
      if (found != known.end() && found->p == p) {
        pin_of_[at(i)] = found->place;
        continue;
      }
      pin_of_[at(i)] = num_corners + static_cast<std::int32_t>(pins_.size());
      known.insert(found, {p, pin_of_[at(i)]});
      pins_.push_back(p);
    }
  }

  // The lattice of an outline much larger than the limit is not even made.
  double least_triangles() const {
    const double area = static_cast<double>(grid_.area()) * 0.5 * kMeshStep * kMeshStep;
    const double corners = static_cast<double>(grid_.segments().size());
    const double h = options_.spacing_px;
    return std::min(area / (0.25 * std::numbers::sqrt3 * h * h) - 8.0 * corners, 1e15);
  }

  // Before refinement a mesh has two triangles a point inside and one a corner, less two.
  double first_triangles(std::size_t lattice) const {
    return static_cast<double>(2 * (lattice + pins_.size()) + grid_.segments().size()) - 2.0;
  }

  void refuse_over_limit(double triangles) const {
    if (triangles <= static_cast<double>(options_.max_triangles)) return;
    throw Error(Errc::over_limit, "E_TOO_LARGE",
                "a spacing of " + std::to_string(options_.spacing_px) + " px makes about " +
                    std::to_string(std::llround(triangles)) + " triangles, more than " +
                    std::to_string(options_.max_triangles),
                {}, "give a larger spacing or a larger limit");
  }

  // Corners, fixed points and lattice in one spatial order; vertex_of_ is in theirs.
  void insert_points(const std::vector<GridPoint>& lattice, const RunControl& control) {
    std::vector<GridPoint> points;
    const auto num_corners = static_cast<std::int32_t>(grid_.segments().size());
    points.reserve(at(num_corners) + pins_.size() + lattice.size());
    for (std::int32_t c = 0; c < num_corners; ++c) points.push_back(grid_.corner(c));
    points.insert(points.end(), pins_.begin(), pins_.end());
    points.insert(points.end(), lattice.begin(), lattice.end());
    mesh_ = Triangulation(grid_.box_low(), grid_.box_high(), points.size() + points.size() / 4);
    vertex_of_.assign(points.size(), kNone);
    std::int32_t hint = 0;
    std::int32_t count = 0;
    for (const std::int32_t i : spatial_order(points, grid_.box_low(), grid_.box_high())) {
      if ((++count & 1023) == 0 && control.cancelled()) return;
      const Triangulation::Location where = mesh_.locate(points[at(i)], hint, false);
      if (where.place == Triangulation::Place::vertex)
        grid_.refuse_repeated(i, corner_at(where.edge));
      vertex_of_[at(i)] = mesh_.insert(points[at(i)], where);
      hint = mesh_.leaving[at(vertex_of_[at(i)])];
    }
  }

  std::int32_t corner_at(std::int32_t e) const {
    const auto found = std::find(vertex_of_.begin(), vertex_of_.end(), mesh_.origin[at(e)]);
    return static_cast<std::int32_t>(found - vertex_of_.begin());
  }

  void insert_segments() {
    const auto num_segments = static_cast<std::int32_t>(grid_.segments().size());
    std::vector<char> is_pin(at(mesh_.num_vertices()), 0);
    for (std::size_t i = 0; i < pins_.size(); ++i) is_pin[at(vertex_of_[at(num_segments) + i])] = 1;
    for (std::int32_t s = 0; s < num_segments; ++s) {
      border_.from[at(s)] = vertex_of_[at(s)];
      border_.to[at(s)] = vertex_of_[at(grid_.next_corner(s))];
      std::int32_t from = border_.from[at(s)];
      while (from != border_.to[at(s)]) {
        // A fixed point on the line halves the segment; nothing else may lie there.
        std::int32_t to = border_.to[at(s)];
        for (auto stop = mesh_.insert_segment(from, to, s);
             stop.kind != Triangulation::Obstacle::Kind::none;
             stop = mesh_.insert_segment(from, to, s)) {
          if (stop.kind == Triangulation::Obstacle::Kind::segment)
            grid_.refuse_crossing(s, stop.index);
          if (is_pin[at(stop.index)] == 0) grid_.refuse_touching(s, corner_of(stop.index));
          to = stop.index;
        }
        from = to;
      }
    }
  }

  std::int32_t corner_of(std::int32_t vertex) const {
    const auto found = std::find(vertex_of_.begin(), vertex_of_.end(), vertex);
    return static_cast<std::int32_t>(found - vertex_of_.begin());
  }

  void know_border() {
    border_.segment_before.assign(at(mesh_.num_vertices()), kNone);
    border_.segment_after = border_.segment_before;
    border_.is_sharp.assign(at(mesh_.num_vertices()), 0);
    for (std::int32_t e = 0; e < 4 * mesh_.num_triangles(); ++e) {
      if ((e & 3) == 3 || mesh_.twin[at(e)] != kNone) continue;
      border_.segment_after[at(mesh_.origin[at(e)])] = mesh_.segment[at(e)];
      border_.segment_before[at(mesh_.destination(e))] = mesh_.segment[at(e)];
    }
    for (std::size_t s = 0; s < border_.to.size(); ++s) {
      const std::int32_t corner = grid_.next_corner(static_cast<std::int32_t>(s));
      const GridPoint p = grid_.corner(corner), in = grid_.corner(static_cast<std::int32_t>(s)),
                      out = grid_.corner(grid_.next_corner(corner));
      const auto turn = static_cast<double>(orientation(in, p, out));
      const auto along = static_cast<double>(dot(p, in, out));
      border_.is_sharp[at(border_.to[s])] =
          turn > 0.0 && along > 0.0 && turn < std::numbers::sqrt3 * along ? 1 : 0;
    }
  }

  std::vector<char> free_vertices() const {
    std::vector<char> is_free(at(mesh_.num_vertices()), 1);
    for (std::size_t v = 0; v < is_free.size(); ++v)
      if (v < 4 || border_.segment_after[v] != kNone) is_free[v] = 0;
    for (std::size_t i = 0; i < pins_.size(); ++i)
      is_free[at(vertex_of_[grid_.segments().size() + i])] = 0;
    return is_free;
  }

  void write_mesh() {
    // The four corners of the box go, those of the outline come first.
    row_of_.assign(at(mesh_.num_vertices()), kNone);
    std::int32_t rows = 0;
    for (const std::int32_t v : vertex_of_) row_of_[at(v)] = rows++;
    for (std::int32_t v = 4 + rows; v < mesh_.num_vertices(); ++v) row_of_[at(v)] = rows++;
    PlanarMesh& mesh = result_.mesh;
    mesh.points.resize(rows, 2);
    for (std::int32_t v = 4; v < mesh_.num_vertices(); ++v)
      mesh.points.row(row_of_[at(v)]) = grid_.to_pixels(mesh_.p(v));
    mesh.triangles.resize(mesh_.num_triangles(), 3);
    result_.component.resize(at(mesh_.num_triangles()));
    for (std::int32_t t = 0; t < mesh_.num_triangles(); ++t) {
      for (std::int32_t i = 0; i < 3; ++i)
        mesh.triangles(t, i) = row_of_[at(mesh_.origin[at(4 * t + i)])];
      result_.component[at(t)] = mesh_.origin[at(4 * t + 3)];
    }
    for (std::size_t i = 0; i < pin_of_.size(); ++i) result_.fixed_vertex[i] = pin_of_[i];
  }

  void write_border() {
    for (std::int32_t e = 0; e < 4 * mesh_.num_triangles(); ++e) {
      if ((e & 3) == 3 || mesh_.twin[at(e)] != kNone) continue;
      const std::int32_t s = mesh_.segment[at(e)];
      const std::int32_t from = mesh_.origin[at(e)], to = mesh_.destination(e);
      result_.border.push_back({row_of_[at(from)], row_of_[at(to)], grid_.loop(s), grid_.edge(s),
                                grid_.parameter(s, mesh_.p(from)),
                                grid_.parameter(s, mesh_.p(to))});
    }
    std::sort(result_.border.begin(), result_.border.end(),
              [](const BorderEdge& a, const BorderEdge& b) {
                if (a.loop != b.loop) return a.loop < b.loop;
                if (a.edge != b.edge) return a.edge < b.edge;
                return a.t_from < b.t_from;
              });
  }

  void judge_angles() {
    MeshingReport& report = result_.report;
    const double bound = options_.min_angle_deg > 0.0
                             ? 1.0 / std::tan(options_.min_angle_deg * std::numbers::pi / 180.0)
                             : HUGE_VAL;
    std::vector<char> is_pin(at(mesh_.num_vertices()), 0), is_narrow = is_pin;
    for (std::size_t i = 0; i < pins_.size(); ++i)
      is_pin[at(vertex_of_[grid_.segments().size() + i])] = 1;
    for (std::int32_t e = 0; e < 4 * mesh_.num_triangles(); ++e) {
      if ((e & 3) == 3 || mesh_.twin[at(e)] != kNone) continue;
      const GridPoint a = mesh_.p(mesh_.origin[at(e)]), b = mesh_.p(mesh_.destination(e));
      if (std::hypot(double(b.x) - a.x, double(b.y) - a.y) < 2.0 * kShortestPart * spacing_)
        is_narrow[at(mesh_.origin[at(e)])] = is_narrow[at(mesh_.destination(e))] = 1;
    }
    double worst = 0.0, sum = 0.0;
    for (std::int32_t t = 0; t < mesh_.num_triangles(); ++t) {
      const std::int32_t* v = &mesh_.origin[at(4 * t)];
      const double cotangent = largest_cotangent(mesh_.p(v[0]), mesh_.p(v[1]), mesh_.p(v[2]));
      worst = std::max(worst, cotangent);
      sum += std::atan(1.0 / cotangent);
      if (cotangent <= bound) continue;
      ++report.num_below;
      const auto any = [&](const std::vector<char>& mark) {
        return mark[at(v[0])] != 0 || mark[at(v[1])] != 0 || mark[at(v[2])] != 0;
      };
      if (any(border_.is_sharp) || is_forced_by_corner(mesh_, border_, t))
        ++report.below_at_corners;
      else if (any(is_pin))
        ++report.below_at_fixed_points;
      else if (any(is_narrow))
        ++report.below_in_narrows;
      else
        ++report.below_otherwise;
    }
    constexpr double kDegrees = 180.0 / std::numbers::pi;
    report.smallest_angle_deg = std::atan(1.0 / worst) * kDegrees;
    report.mean_smallest_angle_deg = sum / mesh_.num_triangles() * kDegrees;
  }

  GridOutline grid_;
  MeshingOptions options_;
  double spacing_;
  Triangulation mesh_;
  BorderKnowledge border_;
  std::vector<GridPoint> pins_;
  std::vector<std::int32_t> pin_of_;     // per fixed point: a corner, or past them a pin
  std::vector<std::int32_t> vertex_of_;  // per corner, pin and lattice point
  std::vector<std::int32_t> row_of_;     // per vertex: its row in the result
  TriangulatedOutline result_;
};

}  // namespace

TriangulatedOutline triangulate_outline(const Outline& outline, const Points2& fixed_points,
                                        const MeshingOptions& options, RunControl run) {
  check(options, fixed_points);
  validate(outline);
  if (outline.loops.empty()) throw InvalidArgument("an outline without loops encloses nothing");
  return Mesher(outline, options).run(fixed_points, run);
}

std::int64_t exact_area(const PlanarMesh& mesh) {
  validate(mesh);
  if (mesh.points.rows() == 0) return 0;
  const Eigen::RowVector2d first = mesh.points.row(0);
  const auto corner = [&](Index v) {
    const Eigen::RowVector2d steps = (mesh.points.row(v) - first) / kMeshStep;
    if (!(steps.cwiseAbs().maxCoeff() <= 1 << 30) || std::floor(steps.x()) != steps.x() ||
        std::floor(steps.y()) != steps.y())
      throw InvalidArgument("vertex " + std::to_string(v) + " is off the grid of 2^-15 px");
    return GridPoint{static_cast<std::int32_t>(steps.x()), static_cast<std::int32_t>(steps.y())};
  };
  std::int64_t sum = 0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f)
    sum += orientation(corner(mesh.triangles(f, 0)), corner(mesh.triangles(f, 1)),
                       corner(mesh.triangles(f, 2)));
  return sum;
}

std::vector<Points2> border_loops(const std::vector<BorderEdge>& border, const Points2& points) {
  std::vector<Points2> loops;
  for (std::size_t first = 0; first < border.size();) {
    std::size_t last = first;
    while (last < border.size() && border[last].loop == border[first].loop) ++last;
    Points2 loop(static_cast<Eigen::Index>(last - first), 2);
    for (std::size_t k = first; k < last; ++k) {
      if (border[k].from < 0 || border[k].from >= points.rows())
        throw InvalidArgument("a vertex of the border is not in the points");
      loop.row(static_cast<Eigen::Index>(k - first)) = points.row(border[k].from);
    }
    loops.push_back(std::move(loop));
    first = last;
  }
  return loops;
}

}  // namespace dupin
