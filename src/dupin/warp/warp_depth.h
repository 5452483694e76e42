#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// Depth of every vertex from those of the controls (Eq. 7.27 to 7.30, Alg. 4): #V. Larger is
/// nearer to the viewer.
/// @param weights #V by #M as MlsWarp::weights() gives them; a vertex that no control reaches has
///   depth 0 @param depths #M @throws InvalidArgument if sizes differ. Cost: O(V M).
Eigen::VectorXd interpolate_depth(const Eigen::MatrixXd& weights, const Eigen::VectorXd& depths);

/// Triangles from the farthest to the nearest by the mean depth of their corners, equal ones by
/// number: #F. It depends on the shape at rest alone, so that it is computed once for an edit of
/// the depths and not while dragging.
/// @throws InvalidArgument if an index is out of range, or a depth is not finite or beyond 1e300
/// Cost: O(F log F).
std::vector<std::int32_t> paint_order(const Triangles& triangles, const Eigen::VectorXd& depth);

}  // namespace dupin
