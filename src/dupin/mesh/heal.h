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
/// `mesh` has no isolated vertex, no repeated point (unless a non-manifold place was split, or
/// sheets cross or touch there), only triangles of positive area, edges with one or two faces, one
/// disc or half-disc of faces around each vertex, and one orientation. Its coordinates are local:
/// input = center + 2^exponent * local, with the largest local coordinate in [1/2, 1), so that
/// squares and cubes of lengths stay far from overflow and a scaling of the input by 2^k changes
/// nothing but `exponent`. An axis is centred only when the surface lies farther than its own size
/// from the origin; then the difference is exact, so to_input() gives back the input's bits.
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
  Eigen::Index num_edges = 0;           ///< before splits
  Eigen::Index num_components = 0;      ///< after splits: connected by edges
  Eigen::Index num_boundary_loops = 0;  ///< after splits
  Eigen::Index euler = 0;               ///< V - E + F of the repaired surface before splits
  bool is_manifold = false;             ///< the input had no non-manifold edge or vertex
  bool is_oriented = false;             ///< the input was consistently oriented
  bool is_closed = false;               ///< no boundary after splits
  // Beyond the range of double these are the nearest finite number (W_SCALE_EXTREME is there then).
  double area = 0.0;                          ///< [mu^2]; of all polygons
  double volume = 0.0;                        ///< [mu^3], > 0 when normals point out; if is_closed
  double mean_edge_length = 0.0;              ///< [mu]
  Eigen::RowVector3d box_min{0.0, 0.0, 0.0};  ///< of all finite input vertices [mu]
  Eigen::RowVector3d box_max{0.0, 0.0, 0.0};

  /// Input coordinates of a local point.
  Eigen::RowVector3d to_input(const Eigen::RowVector3d& local) const;
  /// 2^exponent: factor from local to input lengths (the largest double if exponent is 1024).
  double unit() const;
};

/// Repairs a surface for analysis: triangulates polygons (triangulate.h; area is preserved to
/// 1e-12), drops faces that are degenerate (kDegenerateArea) or repeated, welds, orients by flood
/// fill towards the majority of each component's faces (the first face's side on a tie; a
/// consistent component is never turned, also when it faces inward), cuts at non-manifold places.
/// Welding merges vertices at exactly the same place where that joins two faces at an edge
/// (manifold_cut.h): a soup closes up, crossing sheets stay apart. No tolerance is absolute; a
/// triangle smaller than 2^-200 of the surface counts as degenerate. Idempotent.
///
/// Warnings: W_POLYGON_SPLIT, W_POLYGON_CROSSED (it crosses itself), W_DEGENERATE_FACE,
/// W_DUPLICATE_FACE, W_DUPLICATE_VERTEX, W_ISOLATED_VERTEX, W_NONMANIFOLD_EDGE,
/// W_NONMANIFOLD_VERTEX, W_ORIENTATION_FIXED, W_COMPONENTS (count: pieces), W_SCALE_EXTREME (the
/// longest side of the surface's box is outside [1e-15, 1e15]), W_OFFSET_LARGE (the centre of the
/// box has a coordinate over 1e5 times its longest side: five of sixteen digits are lost, and all
/// but two of a float's; 1 mm seen at 100 m still passes), W_NO_CURVATURE
/// (everything in one plane, within 1e-12 of its size), W_TOO_SMALL (fewer than 12 used vertices),
/// W_NONFINITE_DROPPED. W_COMPONENTS, W_NO_CURVATURE and W_TOO_SMALL are remarks, not repairs.
///
/// @throws AnalysisError E_NO_VERTICES, E_NO_FACES, E_NONFINITE, E_ALL_DEGENERATE, E_NOT_ORIENTABLE
/// @throws InvalidArgument if an index is out of range
/// A cancelled run returns Status::cancelled and nothing else.
/// Cost: O((V + F) log F), about 150 bytes a face.
HealedSurface heal(const PolygonMesh& input, const HealOptions& options = {}, RunControl run = {});

/// A triangle mesh as a polygon mesh.
PolygonMesh to_polygon_mesh(const Mesh& mesh);

}  // namespace dupin
