#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// Direction u_i in which vertex i moves by delta_i ~ N(0, sigma^2), independent of the others.
enum class NoiseModel {
  along_normal,  ///< u_i: vertex normal, area-weighted; a vertex without a normal stays
  directional,   ///< u_i = u: one direction for all, as printed in the thesis (Eq. 4.51)
  isotropic,     ///< three independent deviates N(0, sigma^2), one for each coordinate
};

/// Options of add_noise().
struct NoiseOptions {
  double percent = 10.0;  ///< x in sigma = x/100 times the mean edge length, >= 0 [-]
  NoiseModel model = NoiseModel::along_normal;
  Eigen::RowVector3d direction{0.0, 0.0, 1.0};  ///< u of `directional`; any length > 0
  std::uint64_t seed = 0;
};

/// A mesh with displaced vertices and the standard deviation that was used.
struct NoisyMesh {
  Mesh mesh;           ///< same triangles
  double sigma = 0.0;  ///< of each deviate [mu]
};

/// x% noise (Eq. 4.51): p_i + delta_i u_i, with the mean over all distinct edges of `mesh`.
/// Deviates are drawn in the order of the vertices (x, y, z for isotropic), so the same seed and
/// mesh give the same points. Cost: O(V + F).
/// @throws InvalidArgument if percent is negative or not finite, the direction is zero or not
///   finite, or the mesh is not valid
NoisyMesh add_noise(const Mesh& mesh, const NoiseOptions& options = {});

}  // namespace dupin
