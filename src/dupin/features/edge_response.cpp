#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "dupin/features/tracks.h"
#include "dupin/math/symmetric3.h"

namespace dupin::detail {

using Eigen::Index;

SecondDerivatives second_derivatives(const SurfaceGraph& graph, const LevelMatrix& loc, Index level,
                                     Index v) {
  const Adjacency& ring = graph.topology.ring;
  std::vector<std::int32_t> around(ring.begin(v), ring.end(v));
  for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
    around.insert(around.end(), ring.begin(*j), ring.end(*j));
  }
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  around.erase(std::remove(around.begin(), around.end(), static_cast<std::int32_t>(v)),
               around.end());
  if (around.size() < 5) return {};

  Eigen::RowVector3d u;
  Eigen::RowVector3d w;
  tangent_basis(graph.normals.row(v), u, w);
  // response(x, y) - response(0, 0) = g.x + (a x^2 + 2 b x y + c y^2) / 2 in units of the mean
  // edge.
  Eigen::MatrixXd A(static_cast<Index>(around.size()), 5);
  Eigen::VectorXd rhs(static_cast<Index>(around.size()));
  for (Index i = 0; i < A.rows(); ++i) {
    const std::int32_t j = around[static_cast<std::size_t>(i)];
    const Eigen::RowVector3d d = (graph.points.row(j) - graph.points.row(v)) / graph.mean_edge;
    const double x = d.dot(u);
    const double y = d.dot(w);
    A.row(i) << x, y, 0.5 * x * x, x * y, 0.5 * y * y;
    rhs[i] = loc(level, j) - loc(level, v);
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  if (qr.rank() < 5) return {};
  const Eigen::VectorXd x = qr.solve(rhs);
  const double mean = 0.5 * (x[2] + x[4]);
  const double radius = std::hypot(0.5 * (x[2] - x[4]), x[3]);
  const double sign = mean < 0.0 ? -1.0 : 1.0;
  return {true, sign * (std::abs(mean) + radius), sign * (std::abs(mean) - radius)};
}

double edge_ratio(const SurfaceGraph& graph, const LevelMatrix& loc, Index level, Index v) {
  const SecondDerivatives d = second_derivatives(graph, loc, level, v);
  // Different signs: no extremum of the fit.
  if (!d.is_determined || !(d.large * d.small > 0.0)) {
    return std::numeric_limits<double>::infinity();
  }
  return d.large / d.small;
}

}  // namespace dupin::detail
