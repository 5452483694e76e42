#pragma once

#include <cstdint>
#include <vector>

#include "dupin/warp/exact_predicates.h"

namespace dupin {

/// A triangulation in the plane that grows point by point and stays constrained Delaunay: no point
/// that a triangle can see lies strictly inside its circle. All decisions are exact. Flat arrays:
/// triangle t owns the half-edges 4t, 4t+1, 4t+2; half-edge e runs from origin[e] to
/// origin[next(e)], its triangle on the side where orientation() is positive.
class PlanarTriangulation {
 public:
  static constexpr std::int32_t kNone = -1;

  enum class Place { triangle, edge, vertex, blocked };
  /// Where a point lies: in the triangle of `edge`, on `edge`, on its origin, or beyond it.
  struct Location {
    Place place = Place::triangle;
    std::int32_t edge = kNone;
  };

  /// What stopped a segment: nothing, a vertex on it, or a segment across it.
  struct Obstacle {
    enum class Kind { none, vertex, segment } kind = Kind::none;
    std::int32_t index = kNone;  ///< the vertex or the segment
  };

  /// Two triangles over the box with these opposite corners; its corners are vertices 0 to 3.
  PlanarTriangulation(GridPoint low, GridPoint high, std::size_t expected_points);

  static std::int32_t next(std::int32_t e) { return (e & 3) == 2 ? e - 2 : e + 1; }
  static std::int32_t previous(std::int32_t e) { return (e & 3) == 0 ? e + 2 : e - 1; }
  std::int32_t destination(std::int32_t e) const { return origin[at(next(e))]; }
  std::int32_t apex(std::int32_t e) const { return origin[at(previous(e))]; }
  std::int32_t num_triangles() const { return static_cast<std::int32_t>(origin.size() / 4); }
  std::int32_t num_vertices() const { return static_cast<std::int32_t>(point.size()); }
  GridPoint p(std::int32_t v) const { return point[at(v)]; }

  /// Walks from the triangle of `start`; with `stop_at_segments` it does not leave through a
  /// segment or the border but answers `blocked` with the half-edge in its way.
  Location locate(GridPoint query, std::int32_t start, bool stop_at_segments) const;

  /// Inserts a point that locate() placed in a triangle or on an edge and restores Delaunay.
  std::int32_t insert(GridPoint query, const Location& where);

  /// Forces the straight line from vertex u to v to be an edge and marks it with `segment` on both
  /// sides. Stops, without a change, at a vertex on the line or a segment across it.
  Obstacle insert_segment(std::int32_t u, std::int32_t v, std::int32_t segment);

  /// Flips until every edge reachable from `pending` is locally Delaunay; empties it.
  void restore_delaunay(std::vector<std::int32_t>& pending);

  /// True if the edge is a segment, at the border, or no apex lies inside the other's circle.
  bool is_locally_delaunay(std::int32_t e) const;

  /// Keeps the triangles whose `component` entry is not negative (4t+3 of origin holds it after).
  void keep_only(const std::vector<std::int32_t>& component);

  /// Half-edge from u to v or kNone. Before keep_only() only.
  std::int32_t find_edge(std::int32_t u, std::int32_t v) const;

  std::vector<GridPoint> point;
  std::vector<std::int32_t> origin;   ///< 4t+3: tag of the triangle
  std::vector<std::int32_t> twin;     ///< the same edge of the neighbour; kNone at the border
  std::vector<std::int32_t> segment;  ///< the segment that the edge is part of, or kNone
  std::vector<std::int32_t> leaving;  ///< per vertex: a half-edge with this origin

  static std::size_t at(std::int32_t index) { return static_cast<std::size_t>(index); }

 private:
  std::int32_t add_triangle(std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t tag);
  void link(std::int32_t e, std::int32_t other);
  void flip(std::int32_t e);
  void split_triangle(std::int32_t t, std::int32_t v);
  void split_edge(std::int32_t e, std::int32_t v);
  void legalise();
  void flip_away(std::int32_t u, std::int32_t v);

  std::vector<std::int32_t> stack_;
  struct Crossing {
    std::int32_t right, left;
  };
  std::vector<Crossing> changed_, crossing_;
};

}  // namespace dupin
