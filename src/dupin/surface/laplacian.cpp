#include "dupin/surface/laplacian.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <string>

#include "dupin/base/error.h"

namespace dupin {

using Eigen::Index;
using Eigen::RowVector3d;

CotanWeights cotan_weights(const Mesh& mesh, const MeshTopology& topology,
                           const CotanOptions& options) {
  const Adjacency& ring = topology.ring;
  if (ring.num_vertices() != mesh.points.rows()) {
    throw InvalidArgument("topology has " + std::to_string(ring.num_vertices()) +
                          " vertices, the mesh has " + std::to_string(mesh.points.rows()));
  }
  CotanWeights result;
  result.weight.assign(ring.neighbor.size(), 0.0);
  result.mass = Eigen::VectorXd::Zero(mesh.points.rows());
  const auto slot = [&](std::int32_t a, std::int32_t b) {
    const auto* it = std::lower_bound(ring.begin(a), ring.end(a), b);
    return static_cast<std::size_t>(it - ring.neighbor.data());
  };
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const double area = triangle_area(mesh, f);
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = mesh.triangles(f, k);
      const std::int32_t b = mesh.triangles(f, (k + 1) % 3);
      const std::int32_t opposite = mesh.triangles(f, (k + 2) % 3);
      result.mass[a] += area / 3.0;
      if (a == b || area <= 0.0) continue;
      const RowVector3d x = mesh.points.row(a) - mesh.points.row(opposite);
      const RowVector3d y = mesh.points.row(b) - mesh.points.row(opposite);
      const double half_cotangent = x.dot(y) / (4.0 * area);
      result.weight[slot(a, b)] += half_cotangent;
      result.weight[slot(b, a)] += half_cotangent;
    }
  }
  Index directed = 0;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      double& weight = result.weight[static_cast<std::size_t>(j - ring.neighbor.data())];
      const double clamped = std::clamp(weight, 0.0, options.max_weight);
      if (clamped == weight) continue;
      weight = clamped;
      if (directed++ == 0) result.first_clamped_weight = v;
    }
  }
  result.num_clamped_weights = directed / 2;
  const double floor = options.min_mass * (mesh.points.rows() > 0 ? result.mass.mean() : 0.0);
  for (Index v = 0; v < result.mass.size(); ++v) {
    if (result.mass[v] >= floor && result.mass[v] > 0.0) continue;
    result.mass[v] = floor > 0.0 ? floor : 1.0;
    if (result.num_clamped_masses++ == 0) result.first_clamped_mass = v;
  }
  return result;
}

}  // namespace dupin
