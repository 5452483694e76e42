#include "dupin/stats/moments.h"

#include <boost/math/distributions/beta.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

#include "dupin/stats/boost_math.h"
#include "dupin/stats/distributions.h"

namespace dupin {

SampleMoments sample_moments(const Eigen::MatrixXd& sample) {
  if (sample.rows() < 2 || sample.cols() < 1)
    throw InvalidArgument("sample: wants at least 2 rows and 1 column");
  for (Eigen::Index c = 0; c < sample.cols(); ++c) {
    for (Eigen::Index r = 0; r < sample.rows(); ++r) {
      if (!std::isfinite(sample(r, c)) || std::abs(sample(r, c)) > 1e150)
        throw InvalidArgument("sample: an entry is not finite or beyond 1e150");
    }
  }
  const auto count = static_cast<double>(sample.rows());
  SampleMoments moments;
  moments.mean = sample.colwise().sum().transpose() / count;
  const Eigen::MatrixXd centered = sample.rowwise() - moments.mean.transpose();
  const Eigen::MatrixXd product = centered.transpose() * centered / (count - 1.0);
  moments.covariance = 0.5 * (product + product.transpose());
  return moments;
}

double c4(double dof) {
  if (!std::isfinite(dof) || dof <= 0.0 || dof > 1e9)
    throw InvalidArgument("dof: outside (0, 1e9]");
  return detail::from_boost("c4", [&] {
    return std::sqrt(2.0 / dof) /
           boost::math::tgamma_delta_ratio(0.5 * dof, 0.5, detail::BoostPolicy());
  });
}

double pooled_standard_deviation(const Eigen::VectorXd& variances, const Eigen::VectorXd& dofs) {
  if (variances.size() == 0 || variances.size() != dofs.size())
    throw InvalidArgument("variances, dofs: wants as many of each, at least one");
  double sum = 0.0;
  double weight = 0.0;
  for (Eigen::Index i = 0; i < variances.size(); ++i) {
    if (!std::isfinite(variances[i]) || variances[i] < 0.0)
      throw InvalidArgument("variances: wants finite values >= 0");
    if (!std::isfinite(dofs[i]) || dofs[i] <= 0.0)
      throw InvalidArgument("dofs: wants finite values > 0");
    // A running mean: no product of a variance and its weight can overflow.
    weight += dofs[i];
    sum += (variances[i] - sum) * (dofs[i] / weight);
  }
  return std::sqrt(sum);
}

Interval variance_interval(double sample_variance, double dof, double confidence) {
  if (!std::isfinite(sample_variance) || sample_variance < 0.0)
    throw InvalidArgument("sample_variance: wants a finite value >= 0");
  detail::require_open("confidence", confidence, 0.0, 1.0);
  const double tail = 0.5 * (1.0 - confidence);
  const double most = chi_square_quantile(dof, tail);
  const double least = chi_square_quantile(dof, 1.0 - tail);
  Interval interval;
  interval.low = sample_variance * (dof / most);
  interval.high = detail::from_boost("upper end of the variance", [&] {
    return sample_variance == 0.0 ? 0.0 : sample_variance * (dof / least);
  });
  return interval;
}

Interval binomial_interval(std::int64_t num_successes, std::int64_t num_trials, double confidence) {
  if (num_trials < 1 || num_trials > 1'000'000'000)
    throw InvalidArgument("num_trials: outside [1, 1e9]");
  if (num_successes < 0 || num_successes > num_trials)
    throw InvalidArgument("num_successes: outside [0, num_trials]");
  detail::require_open("confidence", confidence, 0.0, 1.0);
  using Beta = boost::math::beta_distribution<double, detail::BoostPolicy>;
  const double tail = 0.5 * (1.0 - confidence);
  const auto k = static_cast<double>(num_successes);
  const auto failures = static_cast<double>(num_trials - num_successes);
  Interval interval{0.0, 1.0};
  if (num_successes > 0) {
    interval.low = detail::from_boost("lower end of the probability",
                                      [&] { return quantile(Beta(k, failures + 1.0), tail); });
  }
  if (num_successes < num_trials) {
    interval.high = detail::from_boost("upper end of the probability", [&] {
      return quantile(complement(Beta(k + 1.0, failures), tail));
    });
  }
  return interval;
}

}  // namespace dupin
