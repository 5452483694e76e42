#include "dupin/warp/grid_outline.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/triangulate_outline.h"

namespace dupin {
namespace {

using Eigen::Index;
using Triangulation = PlanarTriangulation;

// 2^39 mesh steps are 2^24 px: far beyond any picture, far within an integer.
constexpr double kFarthest = 1 << 24;

std::int64_t outline_steps(const Points2& loop, std::size_t l, Index i, Index axis) {
  const double steps = loop(i, axis) / kOutlineStep;
  if (std::abs(loop(i, axis)) > kFarthest || std::floor(steps) != steps)
    throw InvalidArgument("loop " + std::to_string(l) + ", corner " + std::to_string(i) +
                              " is not a multiple of 1/256 px",
                          "prepare_outline() puts outlines on the grid");
  return static_cast<std::int64_t>(steps);
}

}  // namespace

std::string edge_name(std::int64_t loop, std::int64_t edge) {
  return "loop " + std::to_string(loop) + ", edge " + std::to_string(edge);
}

std::string near_place(double x, double y) {
  const auto hundredths = [](double value) {
    const std::string digits = std::to_string(std::round(100.0 * value) / 100.0);
    return digits.substr(0, digits.size() - 4);
  };
  return " near (" + hundredths(x) + ", " + hundredths(y) + ")";
}

GridOutline::GridOutline(const Outline& outline) : component_(outline.component) {
  std::int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    for (Index i = 0; i < outline.loops[l].rows(); ++i) {
      for (Index axis = 0; axis < 2; ++axis) {
        const std::int64_t steps = outline_steps(outline.loops[l], l, i, axis);
        low[axis] = std::min(low[axis], steps);
        high[axis] = std::max(high[axis], steps);
      }
    }
  }
  const std::int64_t extent = std::max(high[0] - low[0], high[1] - low[1]);
  if (extent > std::int64_t{32768} << kOutlineBits)
    throw Error(Errc::over_limit, "E_TOO_LARGE", "the outline is wider or higher than 32768 px");
  constexpr std::int64_t kFiner = std::int64_t{1} << (kMeshBits - kOutlineBits);
  origin_x_ = low[0] * kFiner + extent * kFiner / 2;
  origin_y_ = low[1] * kFiner + extent * kFiner / 2;
  box_ = static_cast<std::int32_t>(extent * kFiner / 4 * 3) + 64;
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    const Points2& loop = outline.loops[l];
    first_.push_back(static_cast<std::int32_t>(segments_.size()));
    const auto point = [&](Index i) {
      return GridPoint{
          static_cast<std::int32_t>(outline_steps(loop, l, i, 0) * kFiner - origin_x_),
          static_cast<std::int32_t>(outline_steps(loop, l, i, 1) * kFiner - origin_y_)};
    };
    for (Index i = 0; i < loop.rows(); ++i) {
      const bool is_last = i + 1 == loop.rows();
      next_.push_back(is_last ? first_.back() : static_cast<std::int32_t>(segments_.size()) + 1);
      segments_.push_back({point(i), point(is_last ? 0 : i + 1)});
      loop_.push_back(static_cast<std::int32_t>(l));
    }
  }
}

Eigen::RowVector2d GridOutline::to_pixels(GridPoint p) const {
  return {static_cast<double>(origin_x_ + p.x) * kMeshStep,
          static_cast<double>(origin_y_ + p.y) * kMeshStep};
}

bool GridOutline::to_grid(double x, double y, GridPoint& p) const {
  const double gx = std::round(x / kMeshStep) - static_cast<double>(origin_x_);
  const double gy = std::round(y / kMeshStep) - static_cast<double>(origin_y_);
  if (!(std::abs(gx) < box_ && std::abs(gy) < box_)) return false;
  p = {static_cast<std::int32_t>(gx), static_cast<std::int32_t>(gy)};
  return true;
}

bool GridOutline::contains(GridPoint p) const {
  bool is_inside = false;
  for (const GridSegment& s : segments_) {
    const std::int64_t side = orientation(s.from, s.to, p);
    if (side == 0 && dot(p, s.from, s.to) <= 0) return true;
    if ((s.from.y <= p.y) != (s.to.y <= p.y) && (side > 0) == (s.to.y > s.from.y))
      is_inside = !is_inside;
  }
  return is_inside;
}

std::int64_t GridOutline::area() const {
  // The sum fits, but its parts need not: a spiral's turn about the first corner again and again.
  std::uint64_t sum = 0;
  for (const GridSegment& s : segments_) {
    const GridPoint origin = segments_[at(first_[at(loop_[at(&s - segments_.data())])])].from;
    sum += static_cast<std::uint64_t>(orientation(origin, s.from, s.to));
  }
  return static_cast<std::int64_t>(sum);
}

double GridOutline::parameter(std::int32_t s, GridPoint p) const {
  const GridSegment& line = segments_[at(s)];
  const double dx = double(line.to.x) - line.from.x, dy = double(line.to.y) - line.from.y;
  return std::abs(dx) >= std::abs(dy) ? (double(p.x) - line.from.x) / dx
                                      : (double(p.y) - line.from.y) / dy;
}

std::vector<std::int32_t> GridOutline::label_triangles(const Triangulation& mesh) const {
  std::vector<std::int32_t> component(at(mesh.num_triangles()), -2);
  std::vector<std::int32_t> region;
  for (std::int32_t seed = 0; seed < mesh.num_triangles(); ++seed) {
    if (component[at(seed)] != -2) continue;
    // A region lies on one side of every segment at its rim.
    std::int32_t label = -2;
    region.assign(1, seed);
    component[at(seed)] = -1;
    for (std::size_t i = 0; i < region.size(); ++i) {
      for (std::int32_t k = 0; k < 3; ++k) {
        const std::int32_t e = 4 * region[i] + k;
        const std::int32_t s = mesh.segment[at(e)];
        const std::int32_t beyond = mesh.twin[at(e)];
        if (s == Triangulation::kNone) {
          if (beyond != Triangulation::kNone && component[at(beyond >> 2)] == -2) {
            component[at(beyond >> 2)] = -1;
            region.push_back(beyond >> 2);
          }
          if (beyond != Triangulation::kNone) continue;
        }
        const GridSegment* line = s == Triangulation::kNone ? nullptr : &segments_[at(s)];
        const bool is_inside =
            line != nullptr &&
            (line->from.x != line->to.x
                 ? (line->to.x > line->from.x) ==
                       (mesh.p(mesh.destination(e)).x > mesh.p(mesh.origin[at(e)]).x)
                 : (line->to.y > line->from.y) ==
                       (mesh.p(mesh.destination(e)).y > mesh.p(mesh.origin[at(e)]).y));
        const std::int32_t found = is_inside ? component_[at(loop_[at(s)])] : -1;
        if (label == -2) label = found;
        if (label != found) {
          const Eigen::RowVector2d place = to_pixels(mesh.p(mesh.origin[at(e)]));
          throw AnalysisError(
              "E_OUTLINE_NESTING",
              (s == Triangulation::kNone ? std::string("a loop") : edge_name(loop(s), edge(s))) +
                  " has its inside where another loop has its outside or another "
                  "component," +
                  near_place(place.x(), place.y()));
        }
      }
    }
    for (const std::int32_t t : region) component[at(t)] = label;
  }
  return component;
}

void GridOutline::refuse_crossing(std::int32_t s, std::int32_t other) const {
  const Eigen::RowVector2d place = to_pixels(corner(s));
  throw AnalysisError("E_OUTLINE_CROSSED", edge_name(loop(s), edge(s)) + " crosses " +
                                               edge_name(loop(other), edge(other)) +
                                               near_place(place.x(), place.y()));
}

void GridOutline::refuse_touching(std::int32_t s, std::int32_t touched) const {
  const Eigen::RowVector2d place = to_pixels(corner(touched));
  throw AnalysisError("E_OUTLINE_CROSSED", edge_name(loop(s), edge(s)) + " touches corner " +
                                               std::to_string(edge(touched)) + " of loop " +
                                               std::to_string(loop(touched)) +
                                               near_place(place.x(), place.y()));
}

void GridOutline::refuse_repeated(std::int32_t first, std::int32_t second) const {
  const Eigen::RowVector2d place = to_pixels(corner(first));
  throw AnalysisError("E_OUTLINE_CROSSED", "corner " + std::to_string(edge(first)) + " of loop " +
                                               std::to_string(loop(first)) + " lies on corner " +
                                               std::to_string(edge(second)) + " of loop " +
                                               std::to_string(loop(second)) +
                                               near_place(place.x(), place.y()));
}

std::int64_t exact_area(const Outline& outline) {
  validate(outline);
  if (outline.loops.empty()) return 0;
  constexpr std::int64_t kFiner = std::int64_t{1} << (2 * (kMeshBits - kOutlineBits));
  return GridOutline(outline).area() / kFiner;
}

}  // namespace dupin
