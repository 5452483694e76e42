#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "dupin/warp/exact_predicates.h"
#include "dupin/warp/triangulate_outline.h"

namespace dupin::test {

/// A vertex in mesh steps; every coordinate that triangulate_outline() returns is one exactly.
struct Steps {
  std::int64_t x, y;
};

inline Steps steps_of(const Points2& points, Eigen::Index v) {
  return {std::llround(points(v, 0) / kMeshStep), std::llround(points(v, 1) / kMeshStep)};
}

inline std::int64_t turn(Steps a, Steps b, Steps c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// > 0 if d is inside the circle of abc: 128-bit integers, no filter, other formula than the
/// library's (rows relative to a).
inline bool is_inside_circle(Steps a, Steps b, Steps c, Steps d) {
  using Wide = detail::Int128;
  const auto row = [&](Steps q) { return Steps{q.x - a.x, q.y - a.y}; };
  const Steps p = row(b), q = row(c), r = row(d);
  const auto square = [](Steps s) { return Wide{s.x} * s.x + Wide{s.y} * s.y; };
  const auto cross = [](Steps s, Steps t) { return Wide{s.x} * t.y - Wide{s.y} * t.x; };
  // det of (p, |p|^2), (q, |q|^2), (r, |r|^2) has the opposite sign of "r inside".
  return square(p) * cross(q, r) - square(q) * cross(p, r) + square(r) * cross(p, q) < 0;
}

/// The first promise of triangulate_outline() that `made` breaks, in words; empty if none.
inline std::string broken_promise(const Outline& outline, const TriangulatedOutline& made) {
  const PlanarMesh& mesh = made.mesh;
  const auto p = [&](std::int32_t v) { return steps_of(mesh.points, v); };
  if (made.status == Status::cancelled) return "cancelled";
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
    const Steps s = steps_of(mesh.points, v);
    if (static_cast<double>(s.x) * kMeshStep != mesh.points(v, 0) ||
        static_cast<double>(s.y) * kMeshStep != mesh.points(v, 1))
      return "vertex " + std::to_string(v) + " is off the grid";
  }
  // Corners first, unmoved.
  Eigen::Index corner = 0;
  for (const Points2& loop : outline.loops)
    for (Eigen::Index i = 0; i < loop.rows(); ++i, ++corner)
      if (mesh.points.row(corner) != loop.row(i))
        return "corner " + std::to_string(corner) + " moved";

  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> owner;  // directed edge: apex
  std::set<std::int32_t> used;
  std::int64_t area = 0;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f) {
    const std::int32_t v[3] = {mesh.triangles(f, 0), mesh.triangles(f, 1), mesh.triangles(f, 2)};
    const std::int64_t twice = turn(p(v[0]), p(v[1]), p(v[2]));
    if (twice <= 0) return "triangle " + std::to_string(f) + " is not positive";
    area += twice;
    for (int k = 0; k < 3; ++k) {
      used.insert(v[k]);
      if (!owner.insert({{v[k], v[(k + 1) % 3]}, v[(k + 2) % 3]}).second)
        return "an edge has two triangles on one side";
    }
  }
  if (area != exact_area(outline) * (std::int64_t{1} << (2 * (kMeshBits - kOutlineBits))))
    return "the areas do not add up to the outline's";
  if (static_cast<Eigen::Index>(used.size()) != mesh.points.rows()) return "a vertex is not used";

  std::size_t num_border = 0;
  for (const auto& [edge, apex] : owner) {
    const auto other = owner.find({edge.second, edge.first});
    if (other == owner.end()) {
      ++num_border;
      continue;
    }
    if (edge.first < edge.second &&
        is_inside_circle(p(edge.first), p(edge.second), p(apex), p(other->second)))
      return "edge " + std::to_string(edge.first) + "-" + std::to_string(edge.second) +
             " is not locally Delaunay";
  }
  // The border is a chain along every segment, on its line, from t = 0 to t = 1.
  if (num_border != made.border.size()) return "border edges that are not listed";
  std::size_t next = 0;
  std::int32_t first = 0;
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    const auto corners = static_cast<std::int32_t>(outline.loops[l].rows());
    for (std::int32_t i = 0; i < corners; ++i) {
      const std::int32_t start = first + i, end = first + (i + 1) % corners;
      std::int32_t at = start;
      double t = 0.0;
      while (at != end) {
        if (next == made.border.size()) return "a segment is not covered";
        const BorderEdge& e = made.border[next++];
        if (e.loop != static_cast<std::int32_t>(l) || e.edge != i || e.from != at || e.t_from != t)
          return "a segment is not covered in order";
        if (owner.count({e.from, e.to}) == 0) return "a border edge has no triangle inside";
        if (turn(p(start), p(end), p(e.to)) != 0) return "a border vertex is off its segment";
        if (!(e.t_to > t)) return "t does not grow along a segment";
        at = e.to;
        t = e.t_to;
      }
      if (t != 1.0) return "t does not end at 1";
    }
    first += corners;
  }
  // Euler: V - E + F = components - holes.
  std::int64_t expected = 0;
  for (const Points2& loop : outline.loops) expected += signed_area(loop) > 0.0 ? 1 : -1;
  const auto num_edges = static_cast<std::int64_t>((owner.size() + num_border) / 2);
  if (mesh.points.rows() - num_edges + mesh.triangles.rows() != expected)
    return "Euler's number is not components - holes";
  if (made.status == Status::ok && made.report.below_otherwise != 0)
    return std::to_string(made.report.below_otherwise) + " small angles without a cause";
  return {};
}

}  // namespace dupin::test
