#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// Options of triangulate_outline().
struct MeshingOptions {
  double spacing_px = 20.0;              ///< of the lattice inside, in [0.5, 16384] [px]
  double min_angle_deg = 25.0;           ///< what no triangle shall be under, in [0, 30]
  std::int64_t max_triangles = 2000000;  ///< in [1, 2^28]
  int smoothing_passes = 3;              ///< over all inner vertices, in [0, 1000]
};

/// An edge of the border of a mesh: part of edge `edge` of loop `loop`, which runs from corner
/// `edge` to the next one. Its ends lie on that edge at the parameters t (0 at its first corner,
/// 1 at its second), exactly on the line.
struct BorderEdge {
  std::int32_t from = 0, to = 0;  ///< vertices of the mesh, in the sense of the loop
  std::int32_t loop = 0, edge = 0;
  double t_from = 0.0, t_to = 1.0;
};

/// What meshing did. Angles of 25 degrees are promised where the input allows them; where it does
/// not, the triangles are counted by cause, the first that applies.
struct MeshingReport {
  double smallest_angle_deg = 0.0;
  double mean_smallest_angle_deg = 0.0;    ///< over the triangles
  std::int64_t num_below = 0;              ///< triangles under min_angle_deg
  std::int64_t below_at_corners = 0;       ///< ... at a corner of the outline under 60 degrees
  std::int64_t below_at_fixed_points = 0;  ///< ... with a fixed point as a corner
  std::int64_t below_in_narrows =
      0;                             ///< ... at a border edge too short to be split (spacing / 100)
  std::int64_t below_otherwise = 0;  ///< ... none of these: only when max_triangles was reached
  std::int64_t num_lattice_points = 0;
  std::int64_t num_splits = 0;   ///< points added on the border
  std::int64_t num_steiner = 0;  ///< points added inside to widen angles
  std::int64_t num_moves = 0;    ///< of vertices by smoothing
  std::int64_t num_refused_moves = 0;
};

/// A mesh of an outline. Vertices: first the corners of the outline, loop by loop, then the fixed
/// points that are no corners, then the others. Every coordinate is a multiple of 2^-15 px.
struct TriangulatedOutline {
  Status status = Status::ok;  ///< cancelled: all empty; not_converged: max_triangles reached
  PlanarMesh mesh;
  std::vector<std::int32_t> component;     ///< per triangle: that of Outline::component
  std::vector<std::int32_t> fixed_vertex;  ///< per fixed point: its vertex, or -1 (see below)
  std::vector<BorderEdge> border;          ///< by loop, edge and t
  MeshingReport report;
};

/// Fills an outline with triangles: a hexagonal lattice inside, constrained Delaunay, Ruppert's
/// refinement where angles are small, guarded Laplacian smoothing. Afterwards
/// - the border edges lie exactly on the outline, all of it: the areas of the triangles add up to
///   the area of the outline without rounding, and the outline's corners are vertices unmoved;
/// - every edge inside is locally Delaunay by an exact test, and no border edge of more than
///   spacing / 50 has the third corner of its triangle inside the circle over it;
/// - no angle is under min_angle_deg but those that the report counts.
/// Same input, same bytes; moved by multiples of 2^-8 px, the same mesh moved.
///
/// @param outline  as prepare_outline() returns it: corners are multiples of 2^-8 px, loops simple
///   and apart, outer ones positive, extent at most 32,768 px
/// @param fixed_points  #P by 2 [px]: become vertices, rounded to 2^-15 px; coincident ones share
///   one. Those outside the outline or in a hole are left out (fixed_vertex -1)
/// @throws InvalidArgument  options out of range; a coordinate that is not finite or not on the
///   grid; sizes that differ
/// @throws AnalysisError E_OUTLINE_CROSSED  edges that cross or touch: names loops, edges and place
/// @throws AnalysisError E_OUTLINE_NESTING  a loop the wrong way round for where it lies, or with
///   another component than the loop around it
/// @throws Error(Errc::over_limit) E_TOO_LARGE  extent, or more triangles than max_triangles before
///   any refinement
/// Cost: O(n log n) for n vertices in practice; 200 bytes a triangle.
/// Sources: thesis 7.4.1; Ruppert 1995; Shewchuk 2002; docs/methods/warp_mesh.md.
TriangulatedOutline triangulate_outline(const Outline& outline, const Points2& fixed_points = {},
                                        const MeshingOptions& options = {}, RunControl run = {});

/// The loops of the border with the vertices of the mesh at `points` (#V by 2): the outline of the
/// shape once it is deformed. One a loop of the outline, in its order.
/// @throws InvalidArgument if a vertex of the border is not in `points`
std::vector<Points2> border_loops(const std::vector<BorderEdge>& border, const Points2& points);

/// Twice the area that an outline encloses, exact, in units of 2^-16 px^2 (corners on the grid).
/// @throws InvalidArgument for a corner off the grid
std::int64_t exact_area(const Outline& outline);

/// Twice the area of a mesh, exact, in units of 2^-30 px^2: 2^14 times exact_area() of its outline.
/// Vertices as triangulate_outline() returns them. @throws InvalidArgument for one off the grid
std::int64_t exact_area(const PlanarMesh& mesh);

}  // namespace dupin
