#include "dupin/mls/patch_draws.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mls/patch_fitter.h"
#include "dupin/mls/propagation.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector3d;
using Eigen::VectorXd;

// The second-order part of K is of the size of var(H). Where the first-order deviation is below
// this part of it, there is no first order.
constexpr double kFirstOrderPart = 1e-3;

Eigen::Vector2d curvatures(const PatchVector& beta) {
  const PatchCurvature curvature = patch_curvature(beta);
  return {curvature.gauss, curvature.mean};
}

void square_distances(const Points& points, const RowVector3d& r, std::vector<double>& squared) {
  for (Index i = 0; i < points.rows(); ++i) {
    squared[static_cast<std::size_t>(i)] = (points.row(i) - r).squaredNorm();
  }
}

struct Test {
  double statistic = 0.0;
  Index rank = 0;
};

// An absolute epsilon may drop every eigenvalue: then there is nothing to test.
Test test_sample(const MatrixXd& sample, const VectorXd& mean, const MatrixXd& covariance,
                 const LikelihoodRatioOptions& options) {
  if (mean.size() == 0) return {};
  try {
    const LikelihoodRatio ratio = likelihood_ratio_test(sample, mean, covariance, options);
    return {ratio.statistic, ratio.rank};
  } catch (const AnalysisError& error) {
    if (error.code() != "E_COVARIANCE") throw;
    return {};
  }
}

}  // namespace

PatchVector turned(const PatchVector& b, double c, double s) {
  const double cc = c * c;
  const double cs = c * s;
  const double ss = s * s;
  PatchVector t;
  t[0] = c * cc * b[0] + cc * s * b[1] + c * ss * b[2] + s * ss * b[3];
  t[1] = -3.0 * cc * s * b[0] + c * (cc - 2.0 * ss) * b[1] + s * (2.0 * cc - ss) * b[2] +
         3.0 * c * ss * b[3];
  t[2] = 3.0 * c * ss * b[0] + s * (ss - 2.0 * cc) * b[1] + c * (cc - 2.0 * ss) * b[2] +
         3.0 * cc * s * b[3];
  t[3] = -s * ss * b[0] + c * ss * b[1] - cc * s * b[2] + c * cc * b[3];
  t[4] = cc * b[4] + cs * b[5] + ss * b[6];
  t[5] = -2.0 * cs * b[4] + (cc - ss) * b[5] + 2.0 * cs * b[6];
  t[6] = ss * b[4] - cs * b[5] + cc * b[6];
  t[7] = c * b[7] + s * b[8];
  t[8] = -s * b[7] + c * b[8];
  t[9] = b[9];
  return t;
}

PatchDraws::Prediction PatchDraws::predict(const VectorXd& mean, const MatrixXd& covariance,
                                           const std::vector<Index>& variables, bool standardise) {
  Prediction p;
  // What noise does not move (along this direction) or moves beyond all numbers cannot be tested.
  std::copy_if(variables.begin(), variables.end(), std::back_inserter(p.variables), [&](Index i) {
    return std::isfinite(mean[i]) && std::isfinite(covariance(i, i)) && covariance(i, i) > 0.0;
  });
  const auto count = static_cast<Index>(p.variables.size());
  p.mean = mean(p.variables);
  p.covariance = covariance(p.variables, p.variables);
  p.unit = VectorXd::Ones(count);
  if (!standardise) return p;
  p.unit = p.covariance.diagonal().cwiseSqrt();
  p.mean = p.mean.cwiseQuotient(p.unit);
  for (Index i = 0; i < count; ++i) {
    for (Index j = 0; j < count; ++j) p.covariance(i, j) /= p.unit[i] * p.unit[j];
  }
  return p;
}

PatchDraws::PatchDraws(const Points& points, const RowVector3d& r, const RowVector3d& normal,
                       std::span<const std::int32_t> index, const PatchDrawOptions& options)
    : options_(options), neighbors_(static_cast<Index>(index.size()), 3) {
  for (std::size_t i = 0; i < index.size(); ++i) {
    neighbors_.row(static_cast<Index>(i)) = points.row(index[i]) - r;
  }
  std::vector<std::int32_t> order(index.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> squared(index.size());
  const RowVector3d origin = RowVector3d::Zero();
  square_distances(neighbors_, origin, squared);
  reference_ = PatchFitter(options_.patch)
                   .fit(neighbors_, origin, order, squared, normal, PatchParts::covariance);
  // One width of the weights for all draws, although noise moves the outermost neighbour.
  options_.patch.radius = reference_.radius;
  if (!can_test()) return;
  if (!options_.refit_plane) {
    reference_ =
        PatchFitter(options_.patch)
            .fit_over(neighbors_, origin, order, squared, reference_.n, PatchParts::covariance);
    if (!can_test()) return;
  }
  direction_ = normal.squaredNorm() > 0.0 ? RowVector3d(normal.normalized()) : reference_.n;
  const double along = options_.noise == PatchNoise::isotropic ? 1.0 : direction_.dot(reference_.n);
  const double variance = options_.sigma * options_.sigma * along * along;
  const PatchMatrix covariance = variance * reference_.unit_covariance;
  std::vector<Index> tested;
  for (Index i = reference_.order == 10 ? 0 : 4; i < (options_.test_all_coefficients ? 10 : 7); ++i)
    tested.push_back(i);
  beta_ = predict(reference_.beta, covariance, tested, options_.standardise);
  const Eigen::Matrix2d curvature = curvature_covariance(reference_.beta, covariance);
  const bool has_gauss = !options_.standardise || std::sqrt(std::max(0.0, curvature(0, 0))) >
                                                      kFirstOrderPart * curvature(1, 1);
  kappa_ =
      predict(curvatures(reference_.beta), curvature,
              has_gauss ? std::vector<Index>{0, 1} : std::vector<Index>{1}, options_.standardise);
}

PatchDraws::Outcome PatchDraws::experiment(std::uint64_t seed, const RunControl& run) const {
  Rng rng(seed);
  PatchFitter fitter(options_.patch);
  const Index count = neighbors_.rows();
  std::vector<std::int32_t> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> squared(static_cast<std::size_t>(count));
  Points noisy(count, 3);
  const auto draws = static_cast<Index>(options_.realisations);
  MatrixXd beta(draws, beta_.mean.size());
  MatrixXd kappa(draws, kappa_.mean.size());
  for (Index m = 0; m < draws; ++m) {
    if (run.cancelled()) return {};
    for (Index i = 0; i < count; ++i) {
      if (options_.noise == PatchNoise::directional) {
        noisy.row(i) = neighbors_.row(i) + options_.sigma * rng.normal() * direction_;
      } else {
        for (Index axis = 0; axis < 3; ++axis) {
          noisy(i, axis) = neighbors_(i, axis) + options_.sigma * rng.normal();
        }
      }
    }
    // The point is its own nearest neighbour and moves with the others.
    const RowVector3d r = noisy.row(0);
    square_distances(noisy, r, squared);
    const MlsPatch patch =
        options_.refit_plane
            ? fitter.fit(noisy, r, order, squared, reference_.n, PatchParts::coefficients)
            : fitter.fit_over(noisy, r, order, squared, reference_.n, PatchParts::coefficients);
    const RowVector3d axis = reference_.u1 - reference_.u1.dot(patch.n) * patch.n;
    const double length = axis.norm();
    const PatchVector drawn =
        turned(patch.beta, axis.dot(patch.u1) / length, axis.dot(patch.u2) / length);
    const Eigen::Vector2d curvature = curvatures(drawn);
    for (Index i = 0; i < beta.cols(); ++i) {
      beta(m, i) = drawn[beta_.variables[static_cast<std::size_t>(i)]] / beta_.unit[i];
    }
    for (Index i = 0; i < kappa.cols(); ++i) {
      kappa(m, i) = curvature[kappa_.variables[static_cast<std::size_t>(i)]] / kappa_.unit[i];
    }
  }
  const Test of_beta = test_sample(beta, beta_.mean, beta_.covariance, options_.beta_test);
  const Test of_kappa = test_sample(kappa, kappa_.mean, kappa_.covariance, options_.kappa_test);
  return {of_beta.statistic, of_kappa.statistic, of_beta.rank, of_kappa.rank};
}

}  // namespace dupin::detail
