#include "dupin/features/keypoint_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/features/tracks.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

double tail(double u) {
  const double square = std::max(3.0, u * u);
  return (square - 1.0) * std::exp(-0.5 * square);
}

// 1F1(m; 1; -x), x >= 0, by Kummer's transformation.
double kummer(double m, double x) {
  constexpr int kTerms = 40;
  double term = 1.0;
  double sum = 1.0;
  for (int k = 1; k < kTerms; ++k) {
    term *= (static_cast<double>(k) - m) * x / (static_cast<double>(k) * static_cast<double>(k));
    sum += term;
  }
  return std::exp(-x) * sum;
}

// The noise of LoC about one vertex and level: locally a stationary field with the spectral density
// s^(m - 1) exp(-2 tau s), so that its variance is v (tau / tau_l)^-m.
struct NoiseLaw {
  double variance = 0.0;
  double exponent = 0.0;
  double tau = 0.0;

  // Covariance of two levels at places whose distance has the given square, in mean edges.
  // Diffusion of both together is diffusion for the mean time; s = (k e / 2)^2 for the wave number
  // k, and the integral of the density times J0(k d) is Kummer's function.
  double covariance(double tau_a, double tau_b, double square_distance) const {
    const double mean = 0.5 * (tau_a + tau_b);
    const double at_place = variance * std::pow(mean / tau, -exponent);
    if (square_distance == 0.0) return at_place;
    return at_place * kummer(exponent, std::min(10.0, 0.5 * square_distance / mean));
  }
};

// LoC^l = -B F^{l+1} has been diffused for tau_{l+1}.
NoiseLaw noise_law(const StackNoise& noise, const VectorXd& tau, Index level, Index vertex) {
  NoiseLaw law;
  const auto sd = [&](Index l) { return static_cast<double>(noise.loc_sd(l, vertex)); };
  law.variance = sd(level) * sd(level);
  law.tau = tau[level + 1];
  const Index below = std::max<Index>(0, level - 2);
  const Index above = std::min<Index>(noise.loc_sd.rows() - 1, level + 2);
  if (above > below && sd(below) > 0.0 && sd(above) > 0.0) {
    law.exponent = std::max(
        0.0, -2.0 * std::log(sd(above) / sd(below)) / std::log(tau[above + 1] / tau[below + 1]));
  }
  return law;
}

// sd of the gradient of LoC over its second derivatives. For a locally stationary field
// E|grad z|^2 = 4/e^2 E[z B z] = -2/e^2 d var / d tau = 2 m var / (e^2 tau), half of it a
// direction.
std::optional<double> position_sd(const SurfaceGraph& graph, const LevelMatrix& loc,
                                  const NoiseLaw& law, const Keypoint& point) {
  const detail::SecondDerivatives d =
      detail::second_derivatives(graph, loc, point.position_level, point.vertex);
  if (!d.is_determined || !(d.large * d.small > 0.0)) return std::nullopt;
  const double gradient = std::sqrt(law.exponent * law.variance / law.tau);  // per mean edge
  const double sd = graph.mean_edge * gradient * std::hypot(1.0 / d.large, 1.0 / d.small);
  if (!std::isfinite(sd)) return std::nullopt;
  return sd;
}

// Propagates the noise of three responses through the vertex of their parabola.
std::optional<double> radius_sd(const SurfaceGraph& graph, const LevelMatrix& loc,
                                const VectorXd& factor, const VectorXd& tau, const VectorXd& scale,
                                bool is_exact, const NoiseLaw& law, const Keypoint& point) {
  const Index l = point.level;
  if (!point.is_scale_peak || l < 1 || l + 1 >= loc.rows()) return std::nullopt;
  const int sign = point.kind == KeypointKind::maximum ? 1 : -1;
  const auto place = [&](Index level) {
    return level == l ? point.scale_vertex
                      : detail::climb(graph.topology.ring, loc, level, sign, point.scale_vertex);
  };
  const std::int32_t vertex[3] = {place(l - 1), place(l), place(l + 1)};
  const auto response = [&](Index i) {
    return sign * factor[l - 1 + i] * loc(l - 1 + i, vertex[i]);
  };
  const double before = response(0);
  const double at = response(1);
  const double after = response(2);
  const double bend = before - 2.0 * at + after;
  if (!(bend < 0.0)) return std::nullopt;
  // offset = (before - after) / (2 bend)
  const double square = bend * bend;
  const double slope[3] = {(after - at) / square, (before - after) / square,
                           (at - before) / square};
  double variance = 0.0;
  for (Index i = 0; i < 3; ++i) {
    for (Index j = 0; j < 3; ++j) {
      variance +=
          slope[i] * slope[j] * factor[l - 1 + i] * factor[l - 1 + j] *
          law.covariance(tau[l + i], tau[l + j],
                         (graph.points.row(vertex[i]) - graph.points.row(vertex[j])).squaredNorm() /
                             (graph.mean_edge * graph.mean_edge));
    }
  }
  // Scales are geometric between levels; the radius is sqrt(tau) e, or t e.
  const bool is_above = before < after;
  const double from = is_above ? scale[l] : scale[l - 1];
  const double to = is_above ? scale[l + 1] : scale[l];
  if (!(from > 0.0)) return std::nullopt;
  const double sd = point.radius * (is_exact ? 0.5 : 1.0) * std::log(to / from) *
                    std::sqrt(std::max(0.0, variance));
  if (!std::isfinite(sd)) return std::nullopt;
  return sd;
}

}  // namespace

double MaximumLaw::p_value(double snr) const { return -std::expm1(-rate * tail(snr)); }

MaximumLaw fit_maximum_law(const VectorXd& maxima) {
  if (maxima.size() == 0) return {};
  double sum = 0.0;
  for (Index r = 0; r < maxima.size(); ++r) sum += tail(maxima[r]);
  return {(static_cast<double>(maxima.size()) + 1.0) / sum};
}

StackNoiseOptions keypoint_noise_options(const SurfaceGraph& graph, const LevelSchedule& schedule,
                                         const KeypointOptions& options) {
  StackNoiseOptions result;
  result.schedule = schedule;
  result.want_levels = false;
  result.first_searched = finest_level(schedule, options);
  result.last_searched = options.rule == KeypointRule::level ? options.level
                         : options.rule == KeypointRule::space_scale
                             ? std::max(1, schedule.num_levels - 3)
                             : schedule.num_levels - 2;
  result.is_excluded = graph.is_guarded;
  return result;
}

std::vector<KeypointUncertainty> estimate_keypoint_uncertainty(
    const SurfaceGraph& graph, const LevelMatrix& loc, const LevelSchedule& schedule,
    const StackNoise& noise, const std::vector<Keypoint>& keypoints,
    const KeypointOptions& options) {
  if (loc.rows() != schedule.num_levels - 1 || loc.cols() != graph.points.rows() ||
      noise.loc_sd.rows() != loc.rows() || noise.loc_sd.cols() != loc.cols()) {
    throw InvalidArgument("noise is " + std::to_string(noise.loc_sd.rows()) + " x " +
                          std::to_string(noise.loc_sd.cols()) + ", loc " +
                          std::to_string(loc.rows()) + " x " + std::to_string(loc.cols()));
  }
  const VectorXd factor = response_factors(schedule, options.measure);
  const VectorXd tau = level_scales(schedule, ScaleMeasure::exact);
  const VectorXd scale = level_scales(schedule, options.measure);
  const MaximumLaw law = fit_maximum_law(noise.maxima);
  std::vector<KeypointUncertainty> result;
  result.reserve(keypoints.size());
  for (const Keypoint& point : keypoints) {
    KeypointUncertainty u;
    const double sd =
        factor[point.level] * static_cast<double>(noise.loc_sd(point.level, point.scale_vertex));
    const double largest = std::numeric_limits<double>::max();
    u.snr = sd > 0.0 && std::abs(point.response) < sd * largest ? std::abs(point.response) / sd
                                                                : largest;
    u.p_value = u.snr == largest ? 0.0 : law.p_value(u.snr);
    u.position_sd =
        position_sd(graph, loc, noise_law(noise, tau, point.position_level, point.vertex), point);
    u.radius_sd = radius_sd(graph, loc, factor, tau, scale, options.measure == ScaleMeasure::exact,
                            noise_law(noise, tau, point.level, point.scale_vertex), point);
    result.push_back(u);
  }
  return result;
}

bool is_significant(const Keypoint& point, const KeypointUncertainty& uncertainty,
                    const SurfaceGraph& graph, const LevelSchedule& schedule,
                    const KeypointOptions& options, double alpha) {
  if (!(alpha > 0.0 && alpha <= 1.0)) {
    throw InvalidArgument("significance is " + std::to_string(alpha) + ", legal range (0, 1]");
  }
  if (!(uncertainty.p_value <= alpha)) return false;
  constexpr double kReach = 2.0;  // mean edges
  if (alpha < 1.0) {
    if (!uncertainty.position_sd) return false;
    const double distance = kReach * graph.mean_edge;
    // sd^2 <= distance^2 / -log(alpha), without dividing by an sd of zero.
    if (*uncertainty.position_sd * std::sqrt(-std::log(alpha)) > distance) return false;
  }
  if (options.rule != KeypointRule::persistent) return true;
  constexpr int kMargin = 3;
  const int searched = schedule.num_levels - 1 - finest_level(schedule, options);
  return point.persistence >= std::min(options.min_persistence + kMargin, searched);
}

int advise_level(const LevelMatrix& field, const LevelMatrixF& sd, double share) {
  if (field.rows() != sd.rows() || field.cols() != sd.cols()) {
    throw InvalidArgument("sd is " + std::to_string(sd.rows()) + " x " + std::to_string(sd.cols()) +
                          ", field " + std::to_string(field.rows()) + " x " +
                          std::to_string(field.cols()));
  }
  if (!(share > 0.0)) throw InvalidArgument("share is " + std::to_string(share) + ", must be > 0");
  if (field.cols() == 0) return -1;
  const auto count = static_cast<double>(field.cols());
  for (Index l = 0; l < field.rows(); ++l) {
    const double mean = field.row(l).sum() / count;
    const double spread = (field.row(l).array() - mean).square().sum() / count;
    const double noise = sd.row(l).cast<double>().squaredNorm() / count;
    if (noise <= share * share * (spread - noise)) return static_cast<int>(l);
  }
  return -1;
}

}  // namespace dupin
