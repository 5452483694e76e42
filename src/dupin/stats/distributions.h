#pragma once

#include <Eigen/Core>

namespace dupin {

// Quantiles are asked by their *upper* probability, so that far tails keep all their digits:
// x = quantile(..., q) has P(X > x) = q. Values come first, parameters after them, probabilities
// last. Relative accuracy is that of Boost.Math in double precision, about 1e-13.
//
// Every function throws InvalidArgument for a NaN and for parameters outside the stated range, and
// Error E_RANGE (exit 9) where the result is beyond a double or was not reached. Values may be
// infinite: the survival is then 0 or 1.

/// x with P(X > x) = `upper_probability` for X ~ chi^2 with `dof` degrees of freedom (Table 4.3).
/// @param dof in (0, 1e9], also fractional
/// @param upper_probability in (0, 1)
double chi_square_quantile(double dof, double upper_probability);

/// P(X > x) for X ~ chi^2 with `dof` degrees of freedom in (0, 1e9]; 1 for x <= 0.
double chi_square_survival(double x, double dof);

/// P(X <= x) for X = sum of `dof` squares of N(m_i, 1), `noncentrality` = sum m_i^2
/// (section 4.3.2). With noncentrality 0 it is the chi^2 distribution.
/// @param dof in (0, 1e6]; noncentrality in [0, 1e6]: the cost grows with their square root
double noncentral_chi_square_cdf(double x, double dof, double noncentrality);

/// 1 - noncentral_chi_square_cdf(), without its cancellation.
double noncentral_chi_square_survival(double x, double dof, double noncentrality);

/// x with P(X > x) = `upper_probability` in (0, 1); ranges as noncentral_chi_square_cdf().
double noncentral_chi_square_quantile(double dof, double noncentrality, double upper_probability);

/// x with P(X > x) = `upper_probability` in (0, 1) for X ~ N(0, 1).
double normal_quantile(double upper_probability);

/// P(X > x) for X ~ N(0, 1).
double normal_survival(double x);

/// x with P(X > x) = `upper_probability` in (0, 1) for Student's t with `dof` in (0, 1e9].
double student_t_quantile(double dof, double upper_probability);

/// Distribution of the largest of many: P(X <= x) = exp(-exp(-(x - location) / scale)).
struct Gumbel {
  double location = 0.0;  ///< the mode, in units of the sample
  double scale = 1.0;  ///< > 0, in units of the sample; the standard deviation is pi/sqrt(6) of it
};

/// Fit by moments: scale = s sqrt(6) / pi, location = mean - gamma scale, where s is the unbiased
/// standard deviation and gamma is Euler's constant. Efficiency against maximum likelihood 0.95 for
/// the location, 0.55 for the scale; without iteration and without failure.
/// @param maxima at least 2 finite values that are not all equal
/// @throws InvalidArgument otherwise
Gumbel fit_gumbel(const Eigen::VectorXd& maxima);

/// P(X > x), with full relative accuracy far out; `distribution` with finite location, scale > 0.
double gumbel_survival(double x, const Gumbel& distribution);

}  // namespace dupin
