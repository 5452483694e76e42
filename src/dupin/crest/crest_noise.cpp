#include "dupin/crest/crest_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/crest/line_assembly.h"
#include "dupin/crest/ridge_segments.h"
#include "dupin/crest/tensor_stack.h"

namespace dupin {
namespace {

using detail::BendField;
using detail::TensorStack;
using Eigen::Index;
using std::size_t;

constexpr double kStep = 0.25;  // of the noise

// What is measured at a point of a line.
struct Reading {
  double strength = 0.0;
  double sharpness = 0.0;
  double extremality = 0.0;  // sign arbitrary [1/mu^2]
};

double strength_at(const TensorStack& stack, const CrestPoint& p) {
  const auto at = [&](std::int32_t v) {
    const detail::PrincipalFrame frame = detail::principal_frame(stack, v, p.scale_level);
    return std::abs(std::abs(frame.k1) - std::abs(frame.k2));
  };
  return (1.0 - p.edge.weight) * at(p.edge.a) + p.edge.weight * at(p.edge.b);
}

double extremality_at(const BendField& field, const EdgeCrossing& c) {
  const double sign = field.direction.row(c.a).dot(field.direction.row(c.b)) < 0.0 ? -1.0 : 1.0;
  return (1.0 - c.weight) * field.extremality[c.a] + c.weight * sign * field.extremality[c.b];
}

using Readings = std::vector<std::vector<Reading>>;

std::optional<Readings> read(const SurfaceGraph& graph, const Points& points, const CrestSet& set,
                             const CrestOptions& options, const RunControl& run) {
  const detail::GradientStencil stencil =
      detail::gradient_stencil(points, graph.triangles, graph.topology.ring);
  const std::optional<TensorStack> stack = detail::make_tensor_stack(
      graph, points, {options.schedule, options.filter, options.normal_smoothing}, stencil, run);
  if (!stack) return std::nullopt;
  const double ratio = detail::draw_ratio(options);
  const std::array<BendField, 2> field = {
      detail::bend_field(graph, *stack, set.level, ratio, stencil, CrestKind::ridge),
      detail::bend_field(graph, *stack, set.level, ratio, stencil, CrestKind::valley)};
  Readings readings(set.lines.size());
  parallel_for(0, static_cast<Index>(readings.size()), 1, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const CrestLine& line = set.lines[static_cast<size_t>(i)];
      const BendField& bend = field[line.kind == CrestKind::ridge ? 0 : 1];
      for (const CrestPoint& p : line.points) {
        readings[static_cast<size_t>(i)].push_back(
            {strength_at(*stack, p), detail::face_sharpness(graph, bend, p.edge.face),
             extremality_at(bend, p.edge)});
      }
    }
  });
  return readings;
}

Points moved(const Points& points, double step, std::uint64_t seed, int replica) {
  Rng rng(seed + 0x9E3779B97F4A7C15ULL * (static_cast<std::uint64_t>(replica) + 1));
  Points out = points;
  for (Index i = 0; i < out.size(); ++i) out.data()[i] += step * rng.normal();
  return out;
}

// Spread of a quantity over the replicas, about their mean: what is common to all of them is of
// second order (noise turns unit normals about and shortens their mean), and no deviation.
struct Spread {
  double sum = 0.0;
  double squares = 0.0;

  void add(double value) {
    sum += value;
    squares += value * value;
  }
  double variance(double count) const {
    return std::max(0.0, (squares - sum * sum / count) / (count - 1.0));
  }
};

// Of one line.
struct Sums {
  std::vector<Spread> strength;   // of every point
  std::vector<Spread> sharpness;  // of every point
  Spread mean_strength;
  double position = 0.0;
};

// Means over the length, as CrestLine has them.
double mean_over(const CrestLine& line, const std::vector<double>& values) {
  double sum = 0.0;
  for (size_t i = 1; i < values.size(); ++i) {
    sum += 0.5 * (line.points[i].position - line.points[i - 1].position).norm() *
           (values[i] + values[i - 1]);
  }
  return line.length > 0.0 ? sum / line.length : 0.0;
}

void add_replica(const CrestLine& line, const std::vector<Reading>& base,
                 const std::vector<Reading>& now, Sums& sums) {
  std::vector<double> change(line.points.size());
  const auto count = static_cast<double>(change.size());
  for (size_t i = 0; i < change.size(); ++i) {
    const CrestPoint& p = line.points[i];
    change[i] = base[i].strength > 0.0
                    ? p.strength * (now[i].strength / base[i].strength - 1.0) / kStep
                    : 0.0;
    sums.strength[i].add(change[i]);
    const double ratio = p.edge.sharpness > 0.0 ? p.sharpness / p.edge.sharpness : 0.0;
    const double sharper = ratio * (now[i].sharpness - base[i].sharpness) / kStep;
    sums.sharpness[i].add(sharper);
    // A line moves by what its extremality has become over its slope.
    const double shift = p.edge.sharpness > 0.0
                             ? (std::abs(now[i].extremality) - std::abs(base[i].extremality)) /
                                   (kStep * p.edge.sharpness)
                             : 0.0;
    sums.position += shift * shift / count;
  }
  sums.mean_strength.add(mean_over(line, change));
}

CrestUncertainty summarise(const CrestLine& line, const Sums& sums, double replicas) {
  CrestUncertainty u;
  double square = 0.0;
  double sharpness = 0.0;
  const auto count = static_cast<double>(sums.strength.size());
  for (std::size_t i = 0; i < sums.strength.size(); ++i) {
    const double variance = sums.strength[i].variance(replicas);
    u.point_sd.push_back(std::sqrt(variance));
    square += variance / count;
    sharpness += sums.sharpness[i].variance(replicas) / count;
  }
  u.strength_sd = std::sqrt(sums.mean_strength.variance(replicas));
  u.sharpness_sd = std::sqrt(sharpness);
  u.position_sd = std::sqrt(sums.position / replicas);
  const auto ratio = [](double value, double sd) {
    const double largest = std::numeric_limits<double>::max();
    return value < sd * largest ? value / sd : largest;
  };
  u.snr = std::min(ratio(line.strength, std::sqrt(square)), ratio(line.sharpness, u.sharpness_sd));
  return u;
}

void check(const SurfaceGraph& graph, const CrestSet& set, const CrestNoiseOptions& noise) {
  if (!(std::isfinite(noise.sigma) && noise.sigma > 0.0))
    throw InvalidArgument("sigma is " + std::to_string(noise.sigma) + ", must be > 0");
  if (noise.num_replicas < 4 || noise.num_replicas > 1000) {
    throw InvalidArgument("replicas is " + std::to_string(noise.num_replicas) +
                          ", legal range 4 to 1000");
  }
  if (set.level.size() != graph.points.rows()) {
    throw InvalidArgument("the set is of " + std::to_string(set.level.size()) +
                          " vertices, the graph has " + std::to_string(graph.points.rows()));
  }
}

}  // namespace

CrestUncertainties estimate_crest_uncertainty(const SurfaceGraph& graph, const CrestSet& set,
                                              const CrestOptions& options,
                                              const CrestNoiseOptions& noise, RunControl run) {
  validate(options);
  check(graph, set, noise);
  CrestUncertainties result;
  if (set.lines.empty()) return result;
  const double share = 1.0 / static_cast<double>(noise.num_replicas + 1);
  const auto cancelled = [] { return CrestUncertainties{Status::cancelled, {}}; };
  const std::optional<Readings> base =
      read(graph, graph.points, set, options, run.stage(0.0, share));
  if (!base) return cancelled();
  std::vector<Sums> sums(set.lines.size());
  for (size_t i = 0; i < sums.size(); ++i) {
    sums[i].strength.resize(set.lines[i].points.size());
    sums[i].sharpness.resize(set.lines[i].points.size());
  }
  for (int r = 0; r < noise.num_replicas; ++r) {
    const std::optional<Readings> now =
        read(graph, moved(graph.points, kStep * noise.sigma, noise.seed, r), set, options,
             run.stage(share * (r + 1), share * (r + 2)));
    if (!now) return cancelled();
    for (size_t i = 0; i < sums.size(); ++i)
      add_replica(set.lines[i], (*base)[i], (*now)[i], sums[i]);
  }
  for (size_t i = 0; i < sums.size(); ++i)
    result.lines.push_back(summarise(set.lines[i], sums[i], noise.num_replicas));
  run.report(1.0);
  return result;
}

}  // namespace dupin
