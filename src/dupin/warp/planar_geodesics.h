#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

enum class GeodesicMethod {
  exact,  ///< length of the shortest path inside the shape
  edges,  ///< shortest path along edges from the nearest corner, plus the way to it: the thesis's
          ///< (7.3.1); up to 15.5 % long on equilateral triangles, however fine (erratum E-38)
};

/// Distance from `source` to every vertex inside the shape: #V [px]; infinity where there is no
/// way. `exact` follows straight cones of sight through the triangles and starts anew at every
/// corner of the border that the cones turn around, nearest first; a vertex that no cone reaches
/// because triangles are flipped or have no area gets the shortest way over its neighbours.
/// Cost: O(F log F) for each part of the shape that one corner sees first.
/// @throws InvalidArgument if the source is not on a triangle of the mesh; Error E_INTERRUPTED if
///   cancelled
Eigen::VectorXd geodesic_distances(const PlanarMesh& mesh, const PlanarGraph& graph,
                                   const MeshPoint& source,
                                   GeodesicMethod method = GeodesicMethod::exact,
                                   const RunControl& run = {});

}  // namespace dupin
