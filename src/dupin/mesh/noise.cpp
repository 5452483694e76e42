#include "dupin/mesh/noise.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mesh/topology.h"

namespace dupin {

NoisyMesh add_noise(const Mesh& mesh, const NoiseOptions& options) {
  if (!(std::isfinite(options.percent) && options.percent >= 0.0)) {
    throw InvalidArgument("percent: " + std::to_string(options.percent) +
                          " is negative or not finite");
  }
  const double length = options.direction.stableNorm();
  if (!(std::isfinite(length) && length > 0.0)) {
    throw InvalidArgument("direction: zero or not finite");
  }
  validate(mesh);
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  NoisyMesh result{mesh, options.percent / 100.0 * mean_edge_length(mesh.points, topology.ring)};
  Points& points = result.mesh.points;
  Rng rng(options.seed);
  if (options.model == NoiseModel::isotropic) {
    for (Eigen::Index v = 0; v < points.rows(); ++v) {
      for (Eigen::Index k = 0; k < 3; ++k) points(v, k) += result.sigma * rng.normal();
    }
    return result;
  }
  const bool along_normal = options.model == NoiseModel::along_normal;
  const Points normals = along_normal ? vertex_normals(mesh) : Points();
  const Eigen::RowVector3d common = options.direction / length;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const double delta = result.sigma * rng.normal();
    points.row(v) += delta * (along_normal ? Eigen::RowVector3d(normals.row(v)) : common);
  }
  return result;
}

}  // namespace dupin
