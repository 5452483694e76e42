#include "dupin/warp/warp_depth.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "dupin/base/error.h"

namespace dupin {

using Eigen::Index;

Eigen::VectorXd interpolate_depth(const Eigen::MatrixXd& weights, const Eigen::VectorXd& depths) {
  if (weights.cols() != depths.size()) throw InvalidArgument("there must be one depth a control");
  // About one of the depths, so that equal depths give exactly that depth everywhere.
  if (depths.size() == 0) return Eigen::VectorXd::Zero(weights.rows());
  const double base = depths[0];
  Eigen::VectorXd result(weights.rows());
  for (Index v = 0; v < weights.rows(); ++v) {
    double sum = 0.0;
    bool is_reached = false;
    for (Index m = 0; m < depths.size(); ++m) {
      sum += weights(v, m) * (depths[m] - base);
      is_reached = is_reached || weights(v, m) > 0.0;
    }
    result[v] = is_reached ? base + sum : 0.0;
  }
  return result;
}

std::vector<std::int32_t> paint_order(const Triangles& triangles, const Eigen::VectorXd& depth) {
  for (Index v = 0; v < depth.size(); ++v) {
    // The bound keeps the sum of three finite.
    if (!std::isfinite(depth[v]) || std::abs(depth[v]) > 1e300)
      throw InvalidArgument("depth " + std::to_string(v) + " is not finite or beyond 1e300");
  }
  const Index num_faces = triangles.rows();
  Eigen::VectorXd mean(num_faces);
  for (Index f = 0; f < num_faces; ++f) {
    double sum = 0.0;
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t v = triangles(f, k);
      if (v < 0 || v >= depth.size())
        throw InvalidArgument("face " + std::to_string(f) + " names a vertex without a depth");
      sum += depth[v];
    }
    mean[f] = sum / 3.0;
  }
  std::vector<std::int32_t> order(static_cast<std::size_t>(num_faces));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return mean[a] < mean[b]; });
  return order;
}

}  // namespace dupin
