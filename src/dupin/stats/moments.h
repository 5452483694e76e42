#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace dupin {

/// Mean and covariance of a sample of p-vectors.
struct SampleMoments {
  Eigen::VectorXd mean;        ///< p
  Eigen::MatrixXd covariance;  ///< p by p, symmetric, unbiased: divided by M - 1
};

/// Mean and unbiased covariance, in two passes: a large common offset does not cancel.
/// @param sample M by p, one draw a row; M >= 2, p >= 1, finite and at most 1e150 in magnitude
/// @throws InvalidArgument otherwise
/// Cost: O(M p^2). Eq. 4.56 divides by M; the likelihood-ratio test does so itself.
SampleMoments sample_moments(const Eigen::MatrixXd& sample);

/// Expectation of s / sigma when s^2 is an unbiased estimate of sigma^2 with `dof` degrees of
/// freedom from normal data: sqrt(2/dof) Gamma((dof+1)/2) / Gamma(dof/2), .9754 for dof = 10.
/// @param dof in (0, 1e9]
/// @throws InvalidArgument otherwise
double c4(double dof);

/// Standard deviation from many estimates of one variance: weighted mean of the variances, then the
/// root. A mean of standard deviations would be too small by c4 (erratum of section 4.2.4).
/// @param variances s_i^2 >= 0, finite, at least one
/// @param dofs      degrees of freedom of each, > 0, finite, as many
/// @return in units of the root of the variances
/// @throws InvalidArgument otherwise
double pooled_standard_deviation(const Eigen::VectorXd& variances, const Eigen::VectorXd& dofs);

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Interval that covers the true variance with probability `confidence` when `sample_variance` is
/// an unbiased estimate with `dof` degrees of freedom from normal data: equal tails of chi^2.
/// @param sample_variance >= 0, finite
/// @param dof in (0, 1e9]
/// @param confidence in (0, 1)
/// @throws InvalidArgument otherwise
Interval variance_interval(double sample_variance, double dof, double confidence);

/// Clopper and Pearson's interval for the probability of success. It covers the true one with at
/// least the probability `confidence`, for every size.
/// @param num_successes in [0, num_trials]
/// @param num_trials    in [1, 1e9]
/// @param confidence    in (0, 1)
/// @throws InvalidArgument otherwise
Interval binomial_interval(std::int64_t num_successes, std::int64_t num_trials, double confidence);

}  // namespace dupin
