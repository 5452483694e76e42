#include "dupin/scalespace/level_schedule.h"

#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Least-squares t of  -log h_l(omega) = omega^2 t  at the midpoints of `samples` intervals of [0,
// omega_max].
VectorXd fitted_scales(const VectorXd& steps, double omega_max) {
  constexpr int kSamples = 4096;
  double fourth = 0.0;
  VectorXd sums = VectorXd::Zero(steps.size() + 1);
  for (int j = 0; j < kSamples; ++j) {
    const double omega = omega_max * (static_cast<double>(j) + 0.5) / kSamples;
    const double square = omega * omega;
    fourth += square * square;
    double log_sum = 0.0;
    for (Index l = 0; l < steps.size(); ++l) {
      log_sum += std::log1p(steps[l] * square);
      sums[l + 1] += square * log_sum;
    }
  }
  return sums / fourth;
}

// Integrals over omega in [0, inf) of h and omega^2 h through omega = tan(theta); the integrand of
// the second is bounded only from two factors on.
double variance_scale(const VectorXd& steps, Index level) {
  if (level < 2) return 0.0;
  constexpr int kSamples = 20'000;
  double zeroth = 0.0;
  double second = 0.0;
  // omega = tan(theta) / sqrt(tau) puts the bulk of h at theta ~ pi / 4 for every level.
  const double width = 1.0 / std::sqrt(steps.head(level).sum());
  for (int j = 0; j < kSamples; ++j) {
    const double theta = 0.5 * std::numbers::pi * (static_cast<double>(j) + 0.5) / kSamples;
    const double tangent = std::tan(theta);
    const double omega = width * tangent;
    double log_h = std::log1p(tangent * tangent);  // d omega = width (1 + tan^2) d theta
    for (Index k = 0; k < level; ++k) log_h -= std::log1p(steps[k] * omega * omega);
    const double value = std::exp(log_h);
    zeroth += value;
    second += omega * omega * value;
  }
  return 0.5 * zeroth / second;
}

}  // namespace

void validate(const LevelSchedule& schedule) {
  if (schedule.num_levels < 2 || schedule.num_levels > 1000) {
    throw InvalidArgument("levels is " + std::to_string(schedule.num_levels) +
                          ", legal range 2 to 1000");
  }
  // isfinite first: an ordered comparison with NaN raises FE_INVALID.
  if (!std::isfinite(schedule.lambda0) || schedule.lambda0 <= 0.0) {
    throw InvalidArgument("lambda0 is " + std::to_string(schedule.lambda0) + ", must be > 0");
  }
  if (!std::isfinite(schedule.delta) || schedule.delta < 1.0) {
    throw InvalidArgument("delta is " + std::to_string(schedule.delta) + ", must be >= 1");
  }
  const double last = schedule.lambda0 * std::pow(schedule.delta, schedule.num_levels - 2);
  if (!(last < 1e9)) {
    throw InvalidArgument(
        "the last time step would be " + std::to_string(last) + ", legal up to 1e9",
        "fewer levels, or a smaller delta");
  }
}

VectorXd time_steps(const LevelSchedule& schedule) {
  validate(schedule);
  VectorXd steps(schedule.num_levels - 1);
  double step = schedule.lambda0;
  for (Index l = 0; l < steps.size(); ++l) {
    steps[l] = step;
    step *= schedule.delta;
  }
  return steps;
}

VectorXd level_scales(const LevelSchedule& schedule, ScaleMeasure measure) {
  const VectorXd steps = time_steps(schedule);
  if (measure == ScaleMeasure::thesis) return fitted_scales(steps, 2.0);
  if (measure == ScaleMeasure::spectral) return fitted_scales(steps, std::numbers::sqrt2);
  VectorXd scales = VectorXd::Zero(schedule.num_levels);
  for (Index l = 1; l < scales.size(); ++l) {
    scales[l] =
        measure == ScaleMeasure::exact ? scales[l - 1] + steps[l - 1] : variance_scale(steps, l);
  }
  return scales;
}

}  // namespace dupin
