#include "dupin/stats/likelihood_ratio.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/stats/distributions.h"

namespace dupin {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLargest = 1e150;  // its square is a double

double largest_magnitude(const char* name, const Eigen::MatrixXd& matrix, double limit) {
  double largest = 0.0;
  for (Eigen::Index c = 0; c < matrix.cols(); ++c) {
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
      if (!std::isfinite(matrix(r, c)) || std::abs(matrix(r, c)) > limit)
        throw InvalidArgument(std::string(name) + ": an entry is not finite or too large");
      largest = std::max(largest, std::abs(matrix(r, c)));
    }
  }
  return largest;
}

void check_options(const LikelihoodRatioOptions& options) {
  if (!std::isfinite(options.relative_epsilon) || options.relative_epsilon < 0.0 ||
      options.relative_epsilon >= 1.0)
    throw InvalidArgument("relative_epsilon: outside [0, 1)");
  if (!std::isfinite(options.absolute_epsilon) || options.absolute_epsilon < 0.0)
    throw InvalidArgument("absolute_epsilon: wants a finite value >= 0");
}

// Eigenpairs of the covariance, largest last, in units of `scale` > 0.
Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> decompose(const Eigen::MatrixXd& covariance,
                                                         double scale) {
  const Eigen::MatrixXd scaled = covariance / scale;
  if ((scaled - scaled.transpose()).cwiseAbs().maxCoeff() > 1e-9)
    throw InvalidArgument("covariance: not symmetric");
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(0.5 * (scaled + scaled.transpose()));
  const Eigen::VectorXd& values = solver.eigenvalues();
  const double largest = values[values.size() - 1];
  if (largest <= 0.0 || values[0] < -1e-9 * largest)
    throw InvalidArgument("covariance: has a negative eigenvalue");
  return solver;
}

LikelihoodRatio point_mass(const Eigen::MatrixXd& centered, double size) {
  LikelihoodRatio result;
  result.outside_rms = std::sqrt(centered.squaredNorm() / static_cast<double>(centered.rows()));
  const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * size;
  if (centered.cwiseAbs().maxCoeff() > rounding) {
    result.statistic = kInfinity;
    result.p_value = 0.0;
  }
  return result;
}

// M (tr W + |m|^2 - log det W - K) for M whitened draws of mean m and covariance W.
double statistic_of(const Eigen::MatrixXd& whitened) {
  if (whitened.cwiseAbs().maxCoeff() > kLargest) return kInfinity;
  const auto count = static_cast<double>(whitened.rows());
  const Eigen::Index rank = whitened.cols();
  const Eigen::VectorXd mean = whitened.colwise().sum().transpose() / count;
  const Eigen::MatrixXd centered = whitened.rowwise() - mean.transpose();
  // W = R^T R / M: the determinant of a triangle keeps small factors beside large ones, which an
  // eigenvalue of W would lose.
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(centered);
  double log_det = -static_cast<double>(rank) * std::log(count);
  for (Eigen::Index k = 0; k < rank; ++k) {
    const double r = std::abs(qr.matrixQR()(k, k));
    if (r == 0.0) return kInfinity;
    log_det += 2.0 * std::log(r);
  }
  const double t = centered.squaredNorm() + count * mean.squaredNorm() -
                   count * (log_det + static_cast<double>(rank));
  return std::max(0.0, t);  // x - 1 - log x >= 0, but for rounding
}

}  // namespace

LikelihoodRatioOptions thesis_likelihood_ratio_options() {
  LikelihoodRatioOptions options;
  options.relative_epsilon = 0.0;
  options.absolute_epsilon = 1e-3;
  return options;
}

LikelihoodRatio likelihood_ratio_test(const Eigen::MatrixXd& sample, const Eigen::VectorXd& mean,
                                      const Eigen::MatrixXd& covariance,
                                      const LikelihoodRatioOptions& options) {
  check_options(options);
  const Eigen::Index p = sample.cols();
  if (p == 0 || mean.size() != p || covariance.rows() != p || covariance.cols() != p)
    throw InvalidArgument("sample, mean, covariance: wants M by p, p and p by p with p >= 1");
  const double size = std::max(largest_magnitude("sample", sample, kLargest),
                               largest_magnitude("mean", mean, kLargest));
  const double scale =
      largest_magnitude("covariance", covariance, std::numeric_limits<double>::max());
  if (sample.rows() == 0) throw AnalysisError("E_TOO_FEW_SAMPLES", "the sample has no draw");
  const Eigen::MatrixXd centered = sample.rowwise() - mean.transpose();
  if (scale == 0.0) return point_mass(centered, size);

  const auto eigen = decompose(covariance, scale);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const double least =
      std::max(options.relative_epsilon * values[p - 1], options.absolute_epsilon / scale);
  LikelihoodRatio result;
  while (result.rank < p) {
    const double value = values[p - 1 - result.rank];
    if (value <= 0.0 || value < least) break;
    ++result.rank;
  }
  if (result.rank == 0) {
    throw AnalysisError(
        "E_COVARIANCE",
        "every eigenvalue of the covariance is below " + std::to_string(options.absolute_epsilon),
        "lower absolute_epsilon or use relative_epsilon");
  }
  if (sample.rows() < 5 * result.rank) {
    throw AnalysisError("E_TOO_FEW_SAMPLES", std::to_string(sample.rows()) +
                                                 " draws; a covariance of rank " +
                                                 std::to_string(result.rank) + " wants " +
                                                 std::to_string(5 * result.rank));
  }
  const Eigen::MatrixXd kept = eigen.eigenvectors().rightCols(result.rank);
  const Eigen::MatrixXd coordinates = centered * kept;
  result.outside_rms = result.rank == p
                           ? 0.0
                           : std::sqrt((centered - coordinates * kept.transpose()).squaredNorm() /
                                       static_cast<double>(sample.rows()));
  const Eigen::RowVectorXd deviations =
      values.tail(result.rank).array().sqrt().transpose() * std::sqrt(scale);
  result.statistic = statistic_of((coordinates.array().rowwise() / deviations.array()).matrix());
  const auto k = static_cast<double>(result.rank);
  result.dof = 0.5 * k * (k + 1.0) + k;
  result.p_value = chi_square_survival(result.statistic, result.dof);
  return result;
}

}  // namespace dupin
