#include "dupin/stats/kolmogorov.h"

#include <algorithm>
#include <boost/math/constants/constants.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/stats/boost_math.h"

namespace dupin {
namespace {

std::vector<double> sorted_values(const char* name, const Eigen::VectorXd& sample) {
  if (sample.size() == 0) throw InvalidArgument(std::string(name) + ": empty");
  for (Eigen::Index i = 0; i < sample.size(); ++i) {
    if (!std::isfinite(sample[i]))
      throw InvalidArgument(std::string(name) + ": a value is not finite");
  }
  std::vector<double> values(sample.begin(), sample.end());
  std::sort(values.begin(), values.end());
  return values;
}

double factor(Eigen::Index num_values) {
  if (num_values < 5) throw InvalidArgument("num_values: fewer than 5");
  const double root = std::sqrt(static_cast<double>(num_values));
  return root + 0.12 + 0.11 / root;
}

double factor(Eigen::Index num_first, Eigen::Index num_second) {
  if (num_first < 5 || num_second < 5) throw InvalidArgument("num_first, num_second: fewer than 5");
  const auto m = static_cast<double>(num_first);
  const auto n = static_cast<double>(num_second);
  return std::sqrt(m / (m + n) * n);
}

void require_statistic(double statistic) {
  if (!std::isfinite(statistic) || statistic < 0.0 || statistic > 1.0)
    throw InvalidArgument("statistic: outside [0, 1]");
}

// x with kolmogorov_survival(x) = significance.
double limit_quantile(double significance) {
  if (!std::isfinite(significance) || significance < 1e-12 || significance >= 1.0)
    throw InvalidArgument("significance: outside [1e-12, 1)");
  return detail::from_boost("Kolmogorov quantile", [&] {
    std::uintmax_t num_steps = 100;
    const auto gap = [&](double x) { return kolmogorov_survival(x) - significance; };
    const auto bracket = boost::math::tools::toms748_solve(
        gap, 0.0, 4.0, gap(0.0), gap(4.0), boost::math::tools::eps_tolerance<double>(50), num_steps,
        detail::BoostPolicy());
    return 0.5 * (bracket.first + bracket.second);
  });
}

}  // namespace

double kolmogorov_statistic(const Eigen::VectorXd& sample,
                            const std::function<double(double)>& cdf) {
  const std::vector<double> values = sorted_values("sample", sample);
  const auto count = static_cast<double>(values.size());
  double largest = 0.0;
  double below = 0.0;
  double previous = 0.0;
  for (const double value : values) {
    const double f = cdf(value);
    if (!std::isfinite(f) || f < previous || f > 1.0)
      throw InvalidArgument("cdf: leaves [0, 1] or falls at a value of the sample");
    largest = std::max({largest, f - below / count, (below + 1.0) / count - f});
    below += 1.0;
    previous = f;
  }
  return largest;
}

double kolmogorov_statistic(const Eigen::VectorXd& first, const Eigen::VectorXd& second) {
  const std::vector<double> a = sorted_values("first", first);
  const std::vector<double> b = sorted_values("second", second);
  double largest = 0.0;
  auto i = a.begin();
  auto j = b.begin();
  while (i != a.end() && j != b.end()) {
    const double value = std::min(*i, *j);
    i = std::find_if(i, a.end(), [&](double x) { return x > value; });
    j = std::find_if(j, b.end(), [&](double x) { return x > value; });
    const double f = static_cast<double>(i - a.begin()) / static_cast<double>(a.size());
    const double g = static_cast<double>(j - b.begin()) / static_cast<double>(b.size());
    largest = std::max(largest, std::abs(f - g));
  }
  return largest;
}

double kolmogorov_survival(double x) {
  using boost::math::double_constants::pi;
  if (std::isnan(x)) throw InvalidArgument("x: not a number");
  if (x <= 0.15) return 1.0;  // 1 - 1e-22
  double sum = 0.0;
  if (x < 1.0) {  // the theta series of 1 - P converges fast where the alternating one cancels
    for (int k = 1; k <= 7; k += 2) sum += std::exp(-(k * pi / x) * (k * pi / x) / 8.0);
    return 1.0 - std::sqrt(2.0 * pi) / x * sum;
  }
  for (int k = 1; k <= 5; ++k) sum += (k % 2 == 1 ? 2.0 : -2.0) * std::exp(-2.0 * k * k * x * x);
  return sum;
}

double kolmogorov_p_value(double statistic, Eigen::Index num_values) {
  require_statistic(statistic);
  return kolmogorov_survival(factor(num_values) * statistic);
}

double kolmogorov_p_value(double statistic, Eigen::Index num_first, Eigen::Index num_second) {
  require_statistic(statistic);
  return kolmogorov_survival(factor(num_first, num_second) * statistic);
}

double kolmogorov_critical_value(double significance, Eigen::Index num_values) {
  return std::min(1.0, limit_quantile(significance) / factor(num_values));
}

double kolmogorov_critical_value(double significance, Eigen::Index num_first,
                                 Eigen::Index num_second) {
  return std::min(1.0, limit_quantile(significance) / factor(num_first, num_second));
}

}  // namespace dupin
