#include "dupin/mls/mls_patch.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/mls/patch_fitter.h"

namespace dupin {

using Eigen::Index;
using Eigen::RowVector3d;

void validate(const MlsOptions& options) {
  const auto require = [](bool is_legal, const char* field, const std::string& value,
                          const char* range) {
    if (is_legal) return;
    throw InvalidArgument(std::string(field) + " is " + value + ", legal range " + range);
  };
  require(options.neighbors >= 3, "neighbors", std::to_string(options.neighbors), ">= 3");
  require(std::isfinite(options.radius) && options.radius >= 0.0, "radius",
          std::to_string(options.radius), ">= 0 and finite");
  require(std::isfinite(options.weight_width) && options.weight_width > 0.0, "weight_width",
          std::to_string(options.weight_width), "> 0 and finite");
  require(options.degree >= 1 && options.degree <= 3, "degree", std::to_string(options.degree),
          "1 to 3");
  require(std::isfinite(options.rank_tolerance) && options.rank_tolerance > 0.0 &&
              options.rank_tolerance < 1.0,
          "rank_tolerance", std::to_string(options.rank_tolerance), "0 to 1, both excluded");
}

MlsPatch fit_mls_patch(const RowVector3d& r, const Points& neighbors, const MlsOptions& options,
                       const RowVector3d& facing) {
  validate(options);
  const auto is_finite = [](const auto& row) {
    return std::isfinite(row[0]) && std::isfinite(row[1]) && std::isfinite(row[2]);
  };
  if (!is_finite(r) || !is_finite(facing)) {
    throw InvalidArgument("r: a coordinate of the point or of facing is not finite");
  }
  std::vector<std::int32_t> index(static_cast<std::size_t>(neighbors.rows()));
  std::iota(index.begin(), index.end(), 0);
  std::vector<double> squared(index.size());
  for (Index i = 0; i < neighbors.rows(); ++i) {
    if (!is_finite(neighbors.row(i))) {
      throw InvalidArgument("neighbors: row " + std::to_string(i) + " is not finite");
    }
    squared[static_cast<std::size_t>(i)] = (neighbors.row(i) - r).squaredNorm();
  }
  detail::PatchFitter fitter(options);
  return fitter.fit(neighbors, r, index, squared, facing, detail::PatchParts::covariance);
}

// With p = g_x, q = g_y and w^2 = 1 + p^2 + q^2: the tangents X_x, X_y are made orthonormal by the
// Cholesky factor of I = L L^T, and the symmetric matrix L^-1 II L^-T is diagonalised.
PatchCurvature patch_curvature(const PatchVector& beta) {
  const double p = beta[7];
  const double q = beta[8];
  const double w2 = 1.0 + p * p + q * q;
  const double w = std::sqrt(w2);
  PatchCurvature result;
  const double xx = -2.0 * beta[4] / w;
  const double xy = -beta[5] / w;
  const double yy = -2.0 * beta[6] / w;
  const double l11 = std::sqrt(1.0 + p * p);
  const double l21 = p * q / l11;
  const double l22 = w / l11;
  const double a = xx / (l11 * l11);
  const double b = (xy - l21 * xx / l11) / (l11 * l22);
  const double c = (yy - 2.0 * l21 * xy / l11 + l21 * l21 * xx / (l11 * l11)) / (l22 * l22);
  result.mean = 0.5 * (a + c);
  result.gauss = a * c - b * b;
  const double half = 0.5 * (a - c);
  const double root = std::sqrt(half * half + b * b);
  result.k1 = result.mean + root;
  result.k2 = result.mean - root;
  // Eigenvector of k1 by the half angle, which has no cancellation.
  const double angle = 0.5 * std::atan2(b, half);
  const double e0 = std::cos(angle);
  const double e1 = std::sin(angle);
  const auto direction = [&](double s, double t) {
    const double v = t / l22;
    const double u = (s - l21 * v) / l11;
    return RowVector3d(u, v, u * p + v * q);
  };
  result.d1 = direction(e0, e1);
  result.d2 = direction(-e1, e0);
  result.normal = RowVector3d(-p, -q, 1.0) / w;
  return result;
}

}  // namespace dupin
