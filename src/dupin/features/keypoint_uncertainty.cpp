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

// Responses at a vertex on the level of a keypoint and on those next to it.
struct ScaleTriple {
  std::int32_t vertex[3];
  double response[3];  // positive at the keypoint
  double bend() const { return response[0] - 2.0 * response[1] + response[2]; }
  // Vertex of the parabola, in levels.
  double offset() const {
    return std::clamp(0.5 * (response[0] - response[2]) / bend(), -0.5, 0.5);
  }
};

class RadiusError {
 public:
  RadiusError(const SurfaceGraph& graph, const LevelMatrix& loc, const VectorXd& factor,
              const VectorXd& tau, const KeypointOptions& options)
      : graph_(graph), loc_(loc), factor_(factor), tau_(tau), options_(options) {}

  // Variance of the fractional level: what the noise of the responses does to the parabola, and the
  // squared distance to where a neighbour would put it, times the probability that noise lets that
  // neighbour win.
  std::optional<double> level_variance(const NoiseLaw& law, const Keypoint& point) const {
    const Index l = point.level;
    const ScaleTriple at = triple(point, point.scale_vertex);
    if (!(at.bend() < 0.0)) return std::nullopt;
    double variance = parabola_variance(law, l, at);
    const Adjacency& ring = graph_.topology.ring;
    for (const std::int32_t* j = ring.begin(point.scale_vertex); j != ring.end(point.scale_vertex);
         ++j) {
      const ScaleTriple other = triple(point, *j);
      if (!(other.bend() < 0.0)) continue;
      const double of_difference =
          2.0 * (covariance(law, l, at, 1, at, 1) - covariance(law, l, at, 1, other, 1));
      if (!(of_difference > 0.0)) continue;
      const double lead = (at.response[1] - other.response[1]) / std::sqrt(of_difference);
      variance +=
          0.5 * std::erfc(lead / std::sqrt(2.0)) * std::pow(other.offset() - at.offset(), 2);
    }
    return variance;
  }

 private:
  // Extrema in space and scale are compared at one vertex, tracks follow the extremum.
  ScaleTriple triple(const Keypoint& point, std::int32_t start) const {
    const int sign = point.kind == KeypointKind::maximum ? 1 : -1;
    ScaleTriple result{};
    for (Index i = 0; i < 3; ++i) {
      const Index level = point.level - 1 + i;
      result.vertex[i] = i == 1 || options_.rule == KeypointRule::space_scale
                             ? start
                             : detail::climb(graph_.topology.ring, loc_, level, sign, start);
      result.response[i] = sign * factor_[level] * loc_(level, result.vertex[i]);
    }
    return result;
  }

  // Of two responses about level l.
  double covariance(const NoiseLaw& law, Index l, const ScaleTriple& a, Index i,
                    const ScaleTriple& b, Index j) const {
    const double square =
        (graph_.points.row(a.vertex[i]) - graph_.points.row(b.vertex[j])).squaredNorm() /
        (graph_.mean_edge * graph_.mean_edge);
    return factor_[l - 1 + i] * factor_[l - 1 + j] *
           law.covariance(tau_[l + i], tau_[l + j], square);
  }

  // offset = (before - after) / (2 bend)
  double parabola_variance(const NoiseLaw& law, Index l, const ScaleTriple& at) const {
    const double square = at.bend() * at.bend();
    const double* z = at.response;
    const double slope[3] = {(z[2] - z[1]) / square, (z[0] - z[2]) / square,
                             (z[1] - z[0]) / square};
    double variance = 0.0;
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j)
        variance += slope[i] * slope[j] * covariance(law, l, at, i, at, j);
    }
    return std::max(0.0, variance);
  }

  const SurfaceGraph& graph_;
  const LevelMatrix& loc_;
  const VectorXd& factor_;
  const VectorXd& tau_;
  const KeypointOptions& options_;
};

// Scales are geometric between levels; the radius is sqrt(tau) e, or t e.
std::optional<double> radius_sd(const RadiusError& error, const VectorXd& scale, bool is_exact,
                                Index num_loc, const NoiseLaw& law, const Keypoint& point) {
  const Index l = point.level;
  if (!point.is_scale_peak || l < 1 || l + 1 >= num_loc) return std::nullopt;
  const std::optional<double> variance = error.level_variance(law, point);
  const bool is_above = point.t > scale[l];
  const double from = is_above ? scale[l] : scale[l - 1];
  const double to = is_above ? scale[l + 1] : scale[l];
  if (!variance || !(from > 0.0)) return std::nullopt;
  const double sd =
      point.radius * (is_exact ? 0.5 : 1.0) * std::log(to / from) * std::sqrt(*variance);
  if (!std::isfinite(sd)) return std::nullopt;
  return sd;
}

// Share of the noise of a replica that is added to what is there. Chosen together with the reach:
// smaller shares with less reach tell real keypoints from others as well as larger ones with more,
// and keep more of them (docs/adr/0016-found-again-in-replicas.md).
constexpr double kReplicaShare = 0.6;

// How far from a keypoint its replicas may be [mean edges].
double reach_of(const Keypoint& point, const KeypointOptions& options) {
  constexpr double kLeast = 1.5;
  constexpr double kPerLevel = 0.15;
  constexpr double kLargest = 2.5;
  if (options.rule != KeypointRule::persistent) return kLeast;
  return std::min(kLargest, kLeast + kPerLevel * (point.persistence - options.min_persistence));
}

// Share of the replicas in which each keypoint is found again; empty: cancelled.
std::vector<double> stabilities(const SurfaceGraph& graph, const LevelMatrix& loc,
                                const LevelSchedule& schedule, const NoiseSamples& samples,
                                const std::vector<Keypoint>& keypoints,
                                const KeypointOptions& options, const RunControl& run) {
  KeypointOptions all = options;
  all.min_contrast = 0.0;
  all.max_edge_ratio = 0.0;
  all.top = 0;
  constexpr Index kReplicas = ReplicaBlock::ColsAtCompileTime;
  std::vector<int> count(keypoints.size(), 0);
  LevelMatrix replica = loc;
  for (Index r = 0; r < kReplicas; ++r) {
    add_noise_sample(samples, schedule, r, kReplicaShare, loc, replica);
    const auto from = static_cast<double>(r) / static_cast<double>(kReplicas);
    const KeypointSet found =
        find_keypoints(graph, replica, schedule, 0.0, all,
                       run.stage(from, from + 1.0 / static_cast<double>(kReplicas)));
    if (found.status != Status::ok) return {};
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const double reach = graph.mean_edge * reach_of(keypoints[i], options);
      const bool is_there =
          std::any_of(found.keypoints.begin(), found.keypoints.end(), [&](const Keypoint& other) {
            return other.kind == keypoints[i].kind &&
                   (graph.points.row(other.vertex) - graph.points.row(keypoints[i].vertex))
                           .norm() <= reach;
          });
      if (is_there) ++count[i];
    }
  }
  std::vector<double> share;
  share.reserve(count.size());
  for (const int c : count)
    share.push_back(static_cast<double>(c) / static_cast<double>(kReplicas));
  return share;
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
  result.want_samples = true;
  return result;
}

std::vector<KeypointUncertainty> estimate_keypoint_uncertainty(
    const SurfaceGraph& graph, const LevelMatrix& loc, const LevelSchedule& schedule,
    const StackNoise& noise, const std::vector<Keypoint>& keypoints, const KeypointOptions& options,
    RunControl run) {
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
  const RadiusError radius_error(graph, loc, factor, tau, options);
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
    u.radius_sd = radius_sd(radius_error, scale, options.measure == ScaleMeasure::exact, loc.rows(),
                            noise_law(noise, tau, point.level, point.scale_vertex), point);
    result.push_back(u);
  }
  if (!noise.samples.level.empty()) {
    const std::vector<double> stability =
        stabilities(graph, loc, schedule, noise.samples, keypoints, options, run);
    if (run.cancelled()) return {};
    for (std::size_t i = 0; i < result.size(); ++i) result[i].stability = stability[i];
  }
  return result;
}

bool is_significant(const KeypointUncertainty& uncertainty, double alpha) {
  if (!(alpha > 0.0 && alpha <= 1.0)) {
    throw InvalidArgument("significance is " + std::to_string(alpha) + ", legal range (0, 1]");
  }
  if (alpha >= 1.0) return true;
  return uncertainty.p_value <= alpha && uncertainty.stability.value_or(0.0) >= 1.0 - alpha;
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
