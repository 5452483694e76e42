#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/topology.h"

namespace dupin {

/// Options of height_signal().
struct HeightSignalOptions {
  int normal_smoothing = 6;  ///< times that the normals are averaged over the ring, >= 0
};

/// Unit normals averaged `times` times over vertex and ring (equal weights), renormalised each
/// time. A zero normal stays out of the averages and may become defined by its neighbours. #V by 3.
/// Cost: O(times E).
Points smooth_normals(const Points& normals, const Adjacency& ring, int times);

/// Umbrella height: h_i = n_i . (p_i - mean of the ring of i) * 2 / e^2 [1/mu], with smoothed
/// normals n and the mean edge length e of the whole surface. Estimates the mean curvature (H > 0
/// on a sphere with outward normals) and is linear in the positions once the normals are fixed, so
/// zero-mean noise of the positions stays zero-mean and the stack averages it away; Taubin's 1-ring
/// estimate is not (docs/methods/keypoints.md has the figures). `ring` may be that of a mesh or a
/// neighbour graph of a cloud; isolated vertices get 0.
/// @throws InvalidArgument if sizes differ or normal_smoothing < 0. Cost: O(E).
Eigen::VectorXd height_signal(const Points& points, const Points& normals, const Adjacency& ring,
                              const HeightSignalOptions& options = {});

}  // namespace dupin
