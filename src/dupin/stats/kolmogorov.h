#pragma once

#include <Eigen/Core>
#include <functional>

namespace dupin {

/// D = sup |F_n - F|: the largest gap between the distribution of a sample and a given one.
/// @param sample n >= 1 finite values in any order
/// @param cdf    F: continuous, growing, in [0, 1]; called once for each value, in ascending order
/// @return D in [1/(2n), 1]
/// @throws InvalidArgument if the sample is empty or not finite, or where F falls or leaves [0, 1]
/// Cost: O(n log n).
double kolmogorov_statistic(const Eigen::VectorXd& sample,
                            const std::function<double(double)>& cdf);

/// D = sup |F_m - G_n|: the largest gap between the distributions of two samples. Equal values
/// within or across the samples are allowed.
/// @return D in [0, 1]
/// @throws InvalidArgument if a sample is empty or not finite
double kolmogorov_statistic(const Eigen::VectorXd& first, const Eigen::VectorXd& second);

/// Kolmogorov's limit: P(sqrt(n) D > x) for n to infinity. In [0, 1], falling; 1 for x <= 0.
/// Relative accuracy 1e-14. Summed here, because Boost.Math has it only since 1.75.
/// @throws InvalidArgument for a NaN
double kolmogorov_survival(double x);

/// P(D >= `statistic`) if a sample of `num_values` comes from the given distribution, whose
/// parameters were not fitted to that sample. Stephens' form of the limit,
/// x = (sqrt(n) + 0.12 + 0.11 / sqrt(n)) D.
/// @param statistic  in [0, 1]
/// @param num_values n >= 5: below, the form is off by more than 0.01
/// @throws InvalidArgument outside these ranges
/// Source: M. A. Stephens, J. R. Statist. Soc. B 32 (1970) 115.
double kolmogorov_p_value(double statistic, Eigen::Index num_values);

/// The same for two samples, in the limit x = sqrt(m n / (m + n)) D. The correction of the test of
/// one sample is left out on purpose: here D jumps in steps, and with it the test would reject more
/// often than it says (m = n = 100, level .05: .0539 instead of .0364).
/// @param num_first, num_second m, n >= 5
double kolmogorov_p_value(double statistic, Eigen::Index num_first, Eigen::Index num_second);

/// The D that a sample from the given distribution exceeds with probability `significance`: .1340
/// for n = 100 and .05. Never above 1.
/// @param significance in [1e-12, 1)
/// @throws InvalidArgument outside these ranges
double kolmogorov_critical_value(double significance, Eigen::Index num_values);

/// The same for two samples: .1921 for 100 and 100 and .05, the "0.19" of section 4.3.1.
double kolmogorov_critical_value(double significance, Eigen::Index num_first,
                                 Eigen::Index num_second);

}  // namespace dupin
