#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/mesh/mesh.h"
#include "dupin/mesh/topology.h"

namespace dupin {

/// Cotangent Laplacian as an edge-weighted graph with vertex masses. With f at the vertices,
/// (Delta f)_i = sum_j w_ij (f_j - f_i) / m_i: negative semi-definite, exact for linear functions
/// in flat interiors.
struct CotanWeights {
  std::vector<double> weight;  ///< aligned with ring.neighbor: (cot alpha + cot beta) / 2, >= 0 [-]
  Eigen::VectorXd mass;        ///< #V: a third of the area of the faces around [mu^2], > 0
  Eigen::Index num_clamped_weights = 0;    ///< edges whose weight was negative or too large
  Eigen::Index num_clamped_masses = 0;     ///< vertices whose mass was below the floor
  Eigen::Index first_clamped_weight = -1;  ///< a vertex of the first of those edges; -1: none
  Eigen::Index first_clamped_mass = -1;    ///< the first of those vertices; -1: none
};

/// Options of cotan_weights().
struct CotanOptions {
  /// A weight below 0 (obtuse pair) becomes 0 and one above the cotangent of one degree is cut, so
  /// that the maximum principle holds and needles do not decide the time step.
  double max_weight = 57.29;
  double min_mass = 0.05;  ///< smallest mass as a part of the mean mass
};

/// Weights of Pinkall and Polthier with lumped masses. Every repair is counted in the result.
/// @throws InvalidArgument if the sizes of mesh and topology differ. Cost: O(F log valence).
CotanWeights cotan_weights(const Mesh& mesh, const MeshTopology& topology,
                           const CotanOptions& options = {});

}  // namespace dupin
