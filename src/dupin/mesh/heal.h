#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin {

/// Options of heal().
struct HealOptions {
  bool drop_nonfinite = false;  ///< remove non-finite vertices and their faces instead of throwing
  bool weld = true;             ///< merge vertices at exactly the same place
};

/// A surface made fit for analysis, and how it relates to what was given.
///
/// `mesh` has no isolated vertex, no repeated point (unless a non-manifold place was split), only
/// triangles of positive area, edges with one or two faces, one disc or half-disc of faces around
/// each vertex, and one orientation. Its coordinates are local: input = center + 2^exponent *
/// local, with the largest local coordinate in [1/2, 1], so that squares and cubes of lengths stay
/// far from overflow and a scaling of the input by 2^k changes nothing but `exponent`.
struct HealedSurface {
  Status status = Status::ok;
  Mesh mesh;                                 ///< #A vertices, local coordinates
  Eigen::RowVector3d center{0.0, 0.0, 0.0};  ///< [mu]
  int exponent = 0;                          ///< local unit is 2^exponent mu
  std::vector<std::int32_t> input_vertex;  ///< #A: vertex of the input (smallest of a welded group)
  std::vector<std::int32_t>
      analysis_vertex;                   ///< #V: first analysis vertex, or -1 (isolated, dropped)
  std::vector<std::int32_t> input_face;  ///< one per triangle of mesh: face of the input
  std::vector<std::uint8_t> is_guarded;  ///< #A: boundary or split vertex; yields no keypoint
  WarningList warnings;                  ///< every repair, counted

  // What the repaired surface is, in input units.
  Eigen::Index num_input_vertices = 0;
  Eigen::Index num_input_faces = 0;
  Eigen::Index num_edges = 0;
  Eigen::Index num_components = 0;
  Eigen::Index num_boundary_loops = 0;
  Eigen::Index euler = 0;    ///< V - E + F of the repaired surface before splits
  bool is_manifold = false;  ///< the input had no non-manifold edge or vertex
  bool is_oriented = false;  ///< the input was consistently oriented
  bool is_closed = false;
  double area = 0.0;                          ///< [mu^2]; of all polygons
  double volume = 0.0;                        ///< [mu^3]; meaningful when is_closed
  double mean_edge_length = 0.0;              ///< [mu]
  Eigen::RowVector3d box_min{0.0, 0.0, 0.0};  ///< of all finite input vertices [mu]
  Eigen::RowVector3d box_max{0.0, 0.0, 0.0};

  /// Input coordinates of a local point.
  Eigen::RowVector3d to_input(const Eigen::RowVector3d& local) const;
  /// 2^exponent: factor from local to input lengths.
  double unit() const;
};

/// Repairs a surface for analysis: triangulates polygons (ear clipping in the plane of best fit;
/// area is preserved to 1e-12), drops faces that are degenerate or repeated, welds, orients by
/// flood fill towards the majority of each component, cuts at non-manifold places. No tolerance is
/// absolute. Idempotent.
///
/// Warnings: W_POLYGON_SPLIT, W_DEGENERATE_FACE, W_DUPLICATE_FACE, W_DUPLICATE_VERTEX,
/// W_ISOLATED_VERTEX, W_NONMANIFOLD_EDGE, W_NONMANIFOLD_VERTEX, W_ORIENTATION_FIXED, W_COMPONENTS,
/// W_SCALE_EXTREME, W_OFFSET_LARGE, W_NO_CURVATURE (everything in one plane), W_TOO_SMALL (fewer
/// than 12 used vertices), W_NONFINITE_DROPPED.
///
/// @throws AnalysisError E_NO_VERTICES, E_NO_FACES, E_NONFINITE, E_ALL_DEGENERATE, E_NOT_ORIENTABLE
/// @throws InvalidArgument if an index is out of range
/// Cost: O((V + F) log F), about 100 bytes a face.
HealedSurface heal(const PolygonMesh& input, const HealOptions& options = {}, RunControl run = {});

/// A triangle mesh as a polygon mesh.
PolygonMesh to_polygon_mesh(const Mesh& mesh);

}  // namespace dupin
