#pragma once

#include "dupin/mesh/mesh.h"

namespace dupin {

/// Cuts every triangle into four at the midpoints of its edges, `times` times (0 to 12). The
/// surface stays the same set of points. Vertices of `mesh` come first, in their order; then one
/// vertex an edge, by rising (lower, higher) end. Triangle f becomes 4f .. 4f + 3: its three
/// corners, then its middle. Cost: O(4^times F log valence).
/// @throws InvalidArgument if times is out of range, the mesh is not valid, a triangle repeats a
///   vertex, or the result would exceed 2^31 - 1 triangles
Mesh midpoint_subdivide(const Mesh& mesh, int times = 1);

/// Loop subdivision (Loop 1987), numbered as midpoint_subdivide(). Inside: new edge points
/// 3/8 (a + b) + 1/8 (c + d); vertex of valence n: (1 - n beta) v + beta sum,
/// beta = (5/8 - (3/8 + cos(2 pi / n) / 4)^2) / n. The boundary is a cubic B-spline curve of its
/// own: edge points (a + b) / 2, vertices 3/4 v + 1/8 (a + b). The limit is C2, and C1 at vertices
/// of valence other than six. Isolated vertices stay.
/// @throws InvalidArgument as midpoint_subdivide(), and if an edge has more than two faces or a
///   boundary vertex is not on exactly two boundary edges
Mesh loop_subdivide(const Mesh& mesh, int times = 1);

/// Where loop_subdivide() takes the vertices of `mesh` in the limit, #V by 3: inside
/// (v + omega sum) / (1 + n omega) with omega = 8 beta / 3, on the boundary 2/3 v + 1/6 (a + b).
/// @throws InvalidArgument as loop_subdivide()
Points loop_limit_points(const Mesh& mesh);

}  // namespace dupin
