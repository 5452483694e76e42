#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

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

[[noreturn]] void fail_crossed(const std::vector<Corner>& corners, std::size_t i, std::size_t j,
                               const std::array<double, 2>& place) {
  const auto edge = [&](std::size_t e) {
    return "edge " + std::to_string(e) + " (points " + std::to_string(corners[e].row) + " and " +
           std::to_string(corners[(e + 1) % corners.size()].row) + ")";
  };
  throw AnalysisError("E_OUTLINE_CROSSED", edge(std::min(i, j)) + " meets " + edge(std::max(i, j)) +
                                               " at (" + shown(place[0]) + ", " + shown(place[1]) +
                                               ")");
}

// Neighbouring edges share a corner; they meet elsewhere only if one runs back along the other.
void require_no_spike(const std::vector<Corner>& corners, std::size_t i) {
  const std::size_t n = corners.size();
  const Corner& a = corners[i];
  const Corner& b = corners[(i + 1) % n];
  const Corner& c = corners[(i + 2) % n];
  if (turn_of(a, b, c) != 0) return;
  const Wide dot =
      static_cast<Wide>(b.x - a.x) * (c.x - b.x) + static_cast<Wide>(b.y - a.y) * (c.y - b.y);
  if (dot < 0) fail_crossed(corners, i, (i + 1) % n, place_of(b));
}

void require_simple(const std::vector<Corner>& corners) {
  const std::size_t n = corners.size();
  for (std::size_t i = 0; i < n; ++i) require_no_spike(corners, i);
  struct Edge {
    std::int64_t begin;
    std::int64_t end;
    std::size_t index;
  };
  std::vector<Edge> edges(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::int64_t x0 = corners[i].x;
    const std::int64_t x1 = corners[(i + 1) % n].x;
    edges[i] = {std::min(x0, x1), std::max(x0, x1), i};
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return a.begin != b.begin ? a.begin < b.begin : a.index < b.index;
  });
  std::vector<Edge> open;
  for (const Edge& edge : edges) {
    open.erase(std::remove_if(open.begin(), open.end(),
                              [&](const Edge& other) { return other.end < edge.begin; }),
               open.end());
    for (const Edge& other : open) {
      const std::size_t i = edge.index;
      const std::size_t j = other.index;
      if ((i + 1) % n == j || (j + 1) % n == i) continue;
      const auto place =
          meeting(corners[i], corners[(i + 1) % n], corners[j], corners[(j + 1) % n]);
      if (place) fail_crossed(corners, i, j, *place);
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

}  // namespace

PolylineOutline outline_from_polyline(const Points2& points) {
  PolylineOutline result;
  std::vector<Corner> corners;
  const auto drop = [&](Index row) {
    result.warnings.add("W_REPEATED_POINT", "point " + std::to_string(row),
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
    throw AnalysisError("E_SHAPE_TOO_SMALL",
                        std::to_string(corners.size()) + " different points, an outline needs 3");
  }
  require_simple(corners);
  // Simple, so the area is not zero.
  if (twice_area(corners) < 0) {
    std::reverse(corners.begin(), corners.end());
    result.warnings.add("W_ORIENTATION_FIXED", "point 0", "the outline was turned round");
  }
  Points2 loop(static_cast<Index>(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto [x, y] = place_of(corners[i]);
    loop.row(static_cast<Index>(i)) << x, y;
    result.corner.push_back(corners[i].row);
  }
  result.outline.loops.push_back(std::move(loop));
  result.outline.component.push_back(0);
  return result;
}

}  // namespace dupin
