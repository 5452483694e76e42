#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/shape_from_image.h"

namespace dupin {
namespace {

using Eigen::Index;
__extension__ using Wide = __int128;

constexpr double kGrid = 65536.0;
constexpr double kMaxCoordinate = 1048576.0;

struct Corner {
  std::int64_t x = 0;  // in 1 / kGrid px, below 2^37 in size
  std::int64_t y = 0;
  Index row = 0;

  bool is_at(const Corner& other) const { return x == other.x && y == other.y; }
};

int turn_of(const Corner& a, const Corner& b, const Corner& c) {
  const Wide cross =
      static_cast<Wide>(b.x - a.x) * (c.y - a.y) - static_cast<Wide>(b.y - a.y) * (c.x - a.x);
  return cross > 0 ? 1 : (cross < 0 ? -1 : 0);
}

// Whether c, on the line through a and b, lies between them or on one of them.
bool is_between(const Corner& a, const Corner& b, const Corner& c) {
  return std::min(a.x, b.x) <= c.x && c.x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= c.y &&
         c.y <= std::max(a.y, b.y);
}

std::array<double, 2> place_of(const Corner& c) {
  return {static_cast<double>(c.x) / kGrid, static_cast<double>(c.y) / kGrid};
}

/// Where segments ab and cd meet, if they do.
std::optional<std::array<double, 2>> meeting(const Corner& a, const Corner& b, const Corner& c,
                                             const Corner& d) {
  const int abc = turn_of(a, b, c);
  const int abd = turn_of(a, b, d);
  const int cda = turn_of(c, d, a);
  const int cdb = turn_of(c, d, b);
  if (abc == 0 && is_between(a, b, c)) return place_of(c);
  if (abd == 0 && is_between(a, b, d)) return place_of(d);
  if (cda == 0 && is_between(c, d, a)) return place_of(a);
  if (cdb == 0 && is_between(c, d, b)) return place_of(b);
  if (abc * abd >= 0 || cda * cdb >= 0) return std::nullopt;
  const auto cross = [](double ux, double uy, double vx, double vy) { return ux * vy - uy * vx; };
  const auto [ax, ay] = place_of(a);
  const auto [bx, by] = place_of(b);
  const auto [cx, cy] = place_of(c);
  const auto [dx, dy] = place_of(d);
  // Not zero: the segments cross properly.
  const double t =
      cross(cx - ax, cy - ay, dx - cx, dy - cy) / cross(bx - ax, by - ay, dx - cx, dy - cy);
  return std::array<double, 2>{ax + t * (bx - ax), ay + t * (by - ay)};
}

std::string shown(double value) {
  std::string text = std::to_string(std::round(value * 1000.0) / 1000.0);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

using Loops = std::vector<std::vector<Corner>>;

struct Edge {
  std::size_t loop = 0;
  std::size_t index = 0;
  std::array<std::int64_t, 2> low{};  // of its box; the axis of the sweep first
  std::array<std::int64_t, 2> high{};
};

std::size_t next_of(const std::vector<Corner>& corners, std::size_t i) {
  return (i + 1) % corners.size();
}

[[noreturn]] void fail_crossed(const Loops& loops, Edge a, Edge b,
                               const std::array<double, 2>& place) {
  const auto name = [&](const Edge& edge) {
    const std::vector<Corner>& corners = loops[edge.loop];
    return (loops.size() > 1 ? "loop " + std::to_string(edge.loop) + ", " : std::string()) +
           "edge " + std::to_string(edge.index) + " (points " +
           std::to_string(corners[edge.index].row) + " and " +
           std::to_string(corners[next_of(corners, edge.index)].row) + ")";
  };
  if (std::make_pair(b.loop, b.index) < std::make_pair(a.loop, a.index)) std::swap(a, b);
  throw AnalysisError("E_OUTLINE_CROSSED", name(a) + " meets " + name(b) + " at (" +
                                               shown(place[0]) + ", " + shown(place[1]) + ")");
}

// Neighbouring edges share a corner; they meet elsewhere only if one runs back along the other.
void require_no_spike(const Loops& loops, std::size_t loop, std::size_t i) {
  const std::vector<Corner>& corners = loops[loop];
  const std::size_t j = next_of(corners, i);
  const Corner& a = corners[i];
  const Corner& b = corners[j];
  const Corner& c = corners[next_of(corners, j)];
  if (turn_of(a, b, c) != 0) return;
  const Wide dot =
      static_cast<Wide>(b.x - a.x) * (c.x - b.x) + static_cast<Wide>(b.y - a.y) * (c.y - b.y);
  if (dot < 0) fail_crossed(loops, {loop, i, {}, {}}, {loop, j, {}, {}}, place_of(b));
}

// Edges by where they begin along the axis along which they are shorter in sum: few overlap there.
std::vector<Edge> edges_of(const Loops& loops) {
  std::vector<Edge> edges;
  std::array<Wide, 2> extent{};
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (std::size_t i = 0; i < loops[l].size(); ++i) {
      const Corner& a = loops[l][i];
      const Corner& b = loops[l][next_of(loops[l], i)];
      edges.push_back({l,
                       i,
                       {std::min(a.x, b.x), std::min(a.y, b.y)},
                       {std::max(a.x, b.x), std::max(a.y, b.y)}});
      for (std::size_t k = 0; k < 2; ++k) extent[k] += edges.back().high[k] - edges.back().low[k];
    }
  }
  for (Edge& edge : edges) {
    if (extent[0] <= extent[1]) break;
    std::swap(edge.low[0], edge.low[1]);
    std::swap(edge.high[0], edge.high[1]);
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const Edge& a, const Edge& b) { return a.low[0] < b.low[0]; });
  return edges;
}

// No two edges meet, but neighbours at their corner.
void require_simple(const Loops& loops, const RunControl& run) {
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (std::size_t i = 0; i < loops[l].size(); ++i) require_no_spike(loops, l, i);
  }
  std::vector<Edge> open;
  for (const Edge& edge : edges_of(loops)) {
    if (run.cancelled()) return;
    std::erase_if(open, [&](const Edge& other) { return other.high[0] < edge.low[0]; });
    const std::vector<Corner>& mine = loops[edge.loop];
    const std::size_t i = edge.index;
    for (const Edge& other : open) {
      if (other.high[1] < edge.low[1] || edge.high[1] < other.low[1]) continue;
      const std::vector<Corner>& its = loops[other.loop];
      const std::size_t j = other.index;
      if (edge.loop == other.loop && (next_of(mine, i) == j || next_of(mine, j) == i)) continue;
      const auto place = meeting(mine[i], mine[next_of(mine, i)], its[j], its[next_of(its, j)]);
      if (place) fail_crossed(loops, edge, other, *place);
    }
    open.push_back(edge);
  }
}

Wide twice_area(const std::vector<Corner>& corners) {
  Wide sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Corner& a = corners[i];
    const Corner& b = corners[(i + 1) % corners.size()];
    sum += static_cast<Wide>(a.x) * b.y - static_cast<Wide>(b.x) * a.y;
  }
  return sum;
}

// Whether `loop` goes around `p`, which lies on none of its edges: crossings with the ray to +x.
bool is_around(const std::vector<Corner>& loop, const Corner& p) {
  bool is_inside = false;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Corner& a = loop[i];
    const Corner& b = loop[next_of(loop, i)];
    if ((a.y > p.y) == (b.y > p.y)) continue;
    const int turn = turn_of(a, b, p);
    if (b.y > a.y ? turn > 0 : turn < 0) is_inside = !is_inside;
  }
  return is_inside;
}

std::vector<Corner> rounded(const Points2& points) {
  std::vector<Corner> corners;
  corners.reserve(static_cast<std::size_t>(points.rows()));
  for (Index i = 0; i < points.rows(); ++i) {
    for (const double value : {points(i, 0), points(i, 1)}) {
      if (!std::isfinite(value) || std::abs(value) > kMaxCoordinate) {
        throw InvalidArgument("point " + std::to_string(i) +
                              " of the outline has a coordinate that is not finite or beyond 2^20");
      }
    }
    corners.push_back({std::llround(points(i, 0) * kGrid), std::llround(points(i, 1) * kGrid), i});
  }
  return corners;
}

// The distinct corners of `points`, in their order.
std::vector<Corner> distinct_corners(const Points2& points, const std::string& loop,
                                     WarningList& warnings) {
  std::vector<Corner> corners;
  const auto drop = [&](Index row) {
    warnings.add("W_REPEATED_POINT", loop + "point " + std::to_string(row),
                 "points at the place of the one before were left out");
  };
  for (const Corner& corner : rounded(points)) {
    if (!corners.empty() && corner.is_at(corners.back())) {
      drop(corner.row);
    } else {
      corners.push_back(corner);
    }
  }
  while (corners.size() > 1 && corners.back().is_at(corners.front())) {
    drop(corners.back().row);
    corners.pop_back();
  }
  if (corners.size() < 3) {
    throw AnalysisError("E_SHAPE_TOO_SMALL", loop + std::to_string(corners.size()) +
                                                 " different points, an outline needs 3");
  }
  return corners;
}

Points2 to_points(const std::vector<Corner>& corners) {
  Points2 loop(static_cast<Index>(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto [x, y] = place_of(corners[i]);
    loop.row(static_cast<Index>(i)) << x, y;
  }
  return loop;
}

}  // namespace

PolylineOutline outline_from_polyline(const Points2& points) {
  PolylineOutline result;
  Loops loops{distinct_corners(points, "", result.warnings)};
  require_simple(loops, {});
  std::vector<Corner>& corners = loops[0];
  // Simple, so the area is not zero.
  if (twice_area(corners) < 0) {
    std::reverse(corners.begin(), corners.end());
    result.warnings.add("W_ORIENTATION_FIXED", "point 0", "the outline was turned round");
  }
  for (const Corner& corner : corners) result.corner.push_back(corner.row);
  result.outline.loops.push_back(to_points(corners));
  result.outline.component.push_back(0);
  return result;
}

ImageShape outline_from_polylines(const std::vector<Points2>& polylines, RunControl run) {
  if (polylines.empty()) throw InvalidArgument("an outline needs a loop");
  ImageShape shape;
  Loops loops;
  for (std::size_t l = 0; l < polylines.size(); ++l) {
    const std::string name = polylines.size() > 1 ? "loop " + std::to_string(l) + ", " : "";
    loops.push_back(distinct_corners(polylines[l], name, shape.warnings));
  }
  require_simple(loops, run);
  if (run.cancelled()) {
    shape = {};
    shape.status = Status::cancelled;
    return shape;
  }
  // Loops that do not meet are around each other as a whole: one corner tells for all.
  std::vector<std::vector<std::size_t>> around(loops.size());
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (std::size_t k = 0; k < loops.size(); ++k)
      if (k != l && is_around(loops[k], loops[l][0])) around[l].push_back(k);
  }
  const auto is_hole = [&](std::size_t l) { return around[l].size() % 2 == 1; };
  for (std::size_t l = 0; l < loops.size(); ++l) {
    if ((twice_area(loops[l]) < 0) == is_hole(l)) continue;
    std::reverse(loops[l].begin(), loops[l].end());
    if (!is_hole(l)) {
      shape.warnings.add("W_ORIENTATION_FIXED", "loop " + std::to_string(l),
                         "outer loops were turned round");
    }
  }
  for (std::size_t l = 0; l < loops.size(); ++l) {
    if (is_hole(l)) continue;
    const auto number = static_cast<std::int32_t>(shape.part_areas.size());
    shape.part_areas.push_back(0.0);
    const auto add = [&](std::size_t k) {
      shape.outline.loops.push_back(to_points(loops[k]));
      shape.outline.component.push_back(number);
      shape.part_areas.back() += signed_area(shape.outline.loops.back());
    };
    add(l);
    for (std::size_t k = 0; k < loops.size(); ++k) {
      const bool is_mine = is_hole(k) && around[k].size() == around[l].size() + 1 &&
                           std::find(around[k].begin(), around[k].end(), l) != around[k].end();
      if (!is_mine) continue;
      add(k);
      ++shape.num_holes;
    }
  }
  shape.num_parts = static_cast<std::int64_t>(shape.part_areas.size());
  return shape;
}

}  // namespace dupin
