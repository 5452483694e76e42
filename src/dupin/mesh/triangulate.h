#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// A triangle has no area when its area is at most kDegenerateArea times its longest edge squared.
/// Rounding of the cross product is about 4e-16 of that square: below 1e-14 the direction of the
/// computed normal has lost all but its first one or two digits, above it the normal can be used.
inline constexpr double kDegenerateArea = 1e-14;

/// Whether the triangle a, b, c has no area in the sense of kDegenerateArea. Free of overflow and
/// underflow for coordinates up to 2^1000, at any scale: lengths are normalised by a power of two.
bool is_degenerate(const Eigen::RowVector3d& a, const Eigen::RowVector3d& b,
                   const Eigen::RowVector3d& c);

/// Triangles of one polygon.
struct PolygonTriangles {
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< corners of the polygon, its direction
  bool is_crossed = false;  ///< it crosses itself: triangles overlap, their areas sum to too much
};

/// Cuts a polygon of n >= 0 corners (n by 3 [mu], in order, not repeated at the end) into at most
/// n - 2 triangles without adding points. Repeated neighbours count once; a polygon without area
/// gives none.
///
/// Quads take the shorter of the diagonals that lie inside. Larger polygons are projected on the
/// plane normal to their area vector (Newell) and cut by ears; corners that are not convex sit in a
/// grid, so 10,000 corners take milliseconds. Corners on the line between their neighbours become
/// corners of triangles with area, never zero-area slivers. A polygon that crosses itself falls
/// back to what ears there are and a fan, and says so.
///
/// For a plane polygon that does not cross itself the areas sum to that of the polygon within
/// 1e-12. Coordinates up to 2^1000; the result does not depend on scale, position or rotation but
/// for rounding. Cost: O(n log n) in practice, O(n^2) at worst.
PolygonTriangles triangulate_polygon(const Points& corners);

}  // namespace dupin
