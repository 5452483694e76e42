#include "dupin/stats/distributions.h"

#include <algorithm>
#include <boost/math/constants/constants.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/extreme_value.hpp>
#include <boost/math/distributions/non_central_chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <string>

#include "dupin/stats/boost_math.h"

namespace dupin {
namespace {

using detail::BoostPolicy;
using detail::from_boost;

using ChiSquare = boost::math::chi_squared_distribution<double, BoostPolicy>;
using NoncentralChiSquare = boost::math::non_central_chi_squared_distribution<double, BoostPolicy>;
using Normal = boost::math::normal_distribution<double, BoostPolicy>;
using StudentT = boost::math::students_t_distribution<double, BoostPolicy>;
using ExtremeValue = boost::math::extreme_value_distribution<double, BoostPolicy>;

void require_dof(double dof, double limit) {
  if (!std::isfinite(dof) || dof <= 0.0 || dof > limit)
    throw InvalidArgument("dof: outside (0, " + std::to_string(limit) + "]");
}

void require_probability(double upper_probability) {
  detail::require_open("upper_probability", upper_probability, 0.0, 1.0);
}

void require_number(double x) {
  if (std::isnan(x)) throw InvalidArgument("x: not a number");
}

void require_noncentral(double dof, double noncentrality) {
  require_dof(dof, 1e6);
  if (!std::isfinite(noncentrality) || noncentrality < 0.0 || noncentrality > 1e6)
    throw InvalidArgument("noncentrality: outside [0, 1e6]");
}

// An upper bound of log P(X <= x) for x > 0 below the mean (Chernoff), at its best argument. Boost
// overflows where the probability is far below the smallest double.
double log_cdf_bound(double x, double dof, double noncentrality) {
  if (x >= dof + noncentrality) return 0.0;
  x = std::max(x, 1e-290);
  const double s = (dof + std::sqrt(dof * dof + 4.0 * x * noncentrality)) / (2.0 * x);
  if (s <= 1.0) return 0.0;
  return 0.5 * ((s - 1.0) * x - dof * std::log(s) - noncentrality * (1.0 - 1.0 / s));
}

constexpr double kLogHalfUlp = -40.0;     // 1 - e^-40 is 1
constexpr double kLogUnderflow = -746.0;  // e^-746 is 0

}  // namespace

double chi_square_quantile(double dof, double upper_probability) {
  require_dof(dof, 1e9);
  require_probability(upper_probability);
  return from_boost("chi-square quantile",
                    [&] { return quantile(complement(ChiSquare(dof), upper_probability)); });
}

double chi_square_survival(double x, double dof) {
  require_number(x);
  require_dof(dof, 1e9);
  if (x <= 0.0) return 1.0;
  if (std::isinf(x)) return 0.0;
  if (log_cdf_bound(x, dof, 0.0) < kLogHalfUlp) return 1.0;
  return from_boost("chi-square survival", [&] { return cdf(complement(ChiSquare(dof), x)); });
}

double noncentral_chi_square_cdf(double x, double dof, double noncentrality) {
  require_number(x);
  require_noncentral(dof, noncentrality);
  if (x <= 0.0) return 0.0;
  if (std::isinf(x)) return 1.0;
  if (log_cdf_bound(x, dof, noncentrality) < kLogUnderflow) return 0.0;
  return from_boost("noncentral chi-square cdf",
                    [&] { return cdf(NoncentralChiSquare(dof, noncentrality), x); });
}

double noncentral_chi_square_survival(double x, double dof, double noncentrality) {
  require_number(x);
  require_noncentral(dof, noncentrality);
  if (x <= 0.0) return 1.0;
  if (std::isinf(x)) return 0.0;
  if (log_cdf_bound(x, dof, noncentrality) < kLogHalfUlp) return 1.0;
  return from_boost("noncentral chi-square survival",
                    [&] { return cdf(complement(NoncentralChiSquare(dof, noncentrality), x)); });
}

double noncentral_chi_square_quantile(double dof, double noncentrality, double upper_probability) {
  require_noncentral(dof, noncentrality);
  require_probability(upper_probability);
  if (noncentrality == 0.0) return chi_square_quantile(dof, upper_probability);
  return from_boost("noncentral chi-square quantile", [&] {
    return quantile(complement(NoncentralChiSquare(dof, noncentrality), upper_probability));
  });
}

double normal_quantile(double upper_probability) {
  require_probability(upper_probability);
  return from_boost("normal quantile",
                    [&] { return quantile(complement(Normal(0.0, 1.0), upper_probability)); });
}

double normal_survival(double x) {
  require_number(x);
  if (std::isinf(x)) return x > 0.0 ? 0.0 : 1.0;
  return from_boost("normal survival", [&] { return cdf(complement(Normal(0.0, 1.0), x)); });
}

double student_t_quantile(double dof, double upper_probability) {
  require_dof(dof, 1e9);
  require_probability(upper_probability);
  return from_boost("Student t quantile",
                    [&] { return quantile(complement(StudentT(dof), upper_probability)); });
}

Gumbel fit_gumbel(const Eigen::VectorXd& maxima) {
  if (maxima.size() < 2) throw InvalidArgument("maxima: fewer than 2 values");
  double largest = 0.0;
  for (Eigen::Index i = 0; i < maxima.size(); ++i) {
    if (!std::isfinite(maxima[i])) throw InvalidArgument("maxima: a value is not finite");
    largest = std::max(largest, std::abs(maxima[i]));
  }
  if (maxima.minCoeff() == maxima.maxCoeff())
    throw InvalidArgument("maxima: all values are equal, so no scale can be fitted");
  // Scaled by the largest, or squares of 1e200 would overflow.
  const Eigen::ArrayXd scaled = maxima.array() / largest;
  const double mean = scaled.mean();
  const double variance = (scaled - mean).square().sum() / static_cast<double>(maxima.size() - 1);
  Gumbel fitted;
  fitted.scale = std::sqrt(6.0 * variance) / boost::math::double_constants::pi * largest;
  fitted.location = mean * largest - boost::math::double_constants::euler * fitted.scale;
  return fitted;
}

double gumbel_survival(double x, const Gumbel& distribution) {
  require_number(x);
  if (!std::isfinite(distribution.scale) || !std::isfinite(distribution.location) ||
      distribution.scale <= 0.0)
    throw InvalidArgument("distribution: wants a finite location and a finite scale > 0");
  const double z = (x - distribution.location) / distribution.scale;
  if (std::isinf(z)) return z > 0.0 ? 0.0 : 1.0;
  return from_boost("Gumbel survival", [&] { return cdf(complement(ExtremeValue(0.0, 1.0), z)); });
}

}  // namespace dupin
