#include "dupin/crest/crest_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/crest/line_assembly.h"
#include "dupin/crest/ridge_segments.h"
#include "dupin/crest/tensor_stack.h"

namespace dupin {
namespace {

using detail::BendField;
using detail::RidgeSegments;
using detail::TensorStack;
using Eigen::Index;
using Eigen::VectorXd;
using std::int32_t;
using std::size_t;

constexpr Index kGrain = 4096;
constexpr size_t kMaxLevels = 64;
// Diffusion time of the average of scales [squared mean edges]: about the finest that are chosen.
constexpr double kScaleSmoothing = 16.0;

// Where a place is looked at: the scale of its structure, and the level at which its line is drawn.
struct Scale {
  double level = 0.0;
  double tau = 0.0;
  bool is_peak = false;
  double drawn = 0.0;  // level
};

class ScaleChoice {
 public:
  ScaleChoice(const TensorStack& stack, const SurfaceGraph& graph, const CrestOptions& options)
      : tau_(stack.tau),
        first_(std::min<Index>(options.finest, stack.num_levels() - 1)),
        share_(options.drawn_share),
        turn_(options.max_turn / graph.mean_edge) {
    for (Index l = 0; l < stack.num_levels(); ++l) {
      curvature_.push_back(detail::level_curvature(stack, l));
      factor_.push_back(std::pow(tau_[l], 0.5 * options.gamma));
      least_.push_back(options.noise_factor *
                       detail::plane_noise(tau_[l], options.noise_sigma, graph.mean_edge));
    }
  }

  Scale at_vertex(Index v) const {
    return choose([&](Index l) {
      return Pair{static_cast<double>(at(l).strength[v]), static_cast<double>(at(l).largest[v])};
    });
  }
  Scale at_crossing(const EdgeCrossing& c) const {
    return choose([&](Index l) {
      return Pair{detail::interpolate(at(l).strength, c), detail::interpolate(at(l).largest, c)};
    });
  }
  double normalised(Index v, double level) const {
    const Index l = std::lround(level);
    return factor_[static_cast<size_t>(l)] * static_cast<double>(at(l).strength[v]);
  }
  // ||k1| - |k2|| between levels.
  double strength(const EdgeCrossing& c, double level) const {
    const auto below = static_cast<Index>(level);
    const Index above = std::min(below + 1, tau_.size() - 1);
    const double weight = level - static_cast<double>(below);
    return (1.0 - weight) * detail::interpolate(at(below).strength, c) +
           weight * detail::interpolate(at(above).strength, c);
  }
  double tau(double level) const {
    const auto below = static_cast<Index>(level);
    const Index above = std::min(below + 1, tau_.size() - 1);
    const double weight = level - static_cast<double>(below);
    return (1.0 - weight) * tau_[below] + weight * tau_[above];
  }

 private:
  struct Pair {
    double strength;
    double largest;
  };

  const detail::LevelCurvature& at(Index l) const { return curvature_[static_cast<size_t>(l)]; }

  // The first maximum of the normalised strength over the levels that stands above the noise.
  template <class Curve>
  Scale choose(const Curve& curve) const {
    const Index last = tau_.size() - 1;
    std::array<double, kMaxLevels> value{};
    Index clear = -1;  // finest level above the noise
    Index best = -1;
    double bend = 0.0;  // largest so far: averages of tensors that are too wide have less
    Index l = first_;
    for (; l <= last; ++l) {
      const auto i = static_cast<size_t>(l);
      const Pair pair = curve(l);
      value[i] = factor_[i] * pair.strength;
      if (clear < 0 && pair.strength >= least_[i]) clear = l;
      if (clear >= 0) bend = std::max(bend, pair.largest);
      if (clear >= 0 && l > clear && std::sqrt(tau_[l]) * bend > turn_) break;
      if (clear >= 0 && (best < 0 || value[i] > value[static_cast<size_t>(best)])) best = l;
      if (best > first_ && best == l - 1 &&
          value[static_cast<size_t>(best - 1)] < value[static_cast<size_t>(best)])
        return finish(interpolated(value, best), clear);
    }
    if (clear < 0) clear = last;
    if (best < 0) best = last;
    return finish({static_cast<double>(best), tau_[best], false, 0.0}, clear);
  }

  Scale finish(Scale scale, Index clear) const {
    const double wanted = share_ * scale.tau;
    Index l = first_;
    while (l + 1 < tau_.size() && tau_[l + 1] <= wanted) ++l;
    double level = static_cast<double>(l);
    if (l + 1 < tau_.size() && wanted > tau_[l])
      level += (wanted - tau_[l]) / (tau_[l + 1] - tau_[l]);
    scale.drawn = std::max(level, static_cast<double>(clear));
    return scale;
  }

  // The top of a parabola over the levels, whose logarithms of tau hardly differ in spacing.
  Scale interpolated(const std::array<double, kMaxLevels>& value, Index best) const {
    const auto i = static_cast<size_t>(best);
    const double bend = value[i - 1] - 2.0 * value[i] + value[i + 1];
    const double offset =
        bend < 0.0 ? std::clamp(0.5 * (value[i - 1] - value[i + 1]) / bend, -0.5, 0.5) : 0.0;
    const Index other = offset < 0.0 ? best - 1 : best + 1;
    const double step = std::abs(offset);
    return {static_cast<double>(best) + offset,
            std::exp((1.0 - step) * std::log(tau_[best]) + step * std::log(tau_[other])), true,
            0.0};
  }

  VectorXd tau_;
  Index first_;
  double share_;
  double turn_;  // sqrt(tau) k0 beyond which an average of tensors means nothing [1/mu]
  std::vector<detail::LevelCurvature> curvature_;
  std::vector<double> factor_;  // t^(gamma / 2)
  std::vector<double> least_;   // strength that noise does not reach [1/mu]
};

// The level of every vertex: its own scale, averaged over the surface with the square of the
// normalised strength for a weight, so that the flanks of a line follow its crest.
std::optional<VectorXd> local_levels(const SurfaceGraph& graph, const ScaleChoice& choice,
                                     const CrestOptions& options, const RunControl& run) {
  const Index count = graph.points.rows();
  VectorXd weight(count);
  VectorXd level(count);
  parallel_for(0, count, kGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      const Scale scale = choice.at_vertex(v);
      // Capped: only its ratios count, and single precision holds their sums then.
      const double value =
          std::min(choice.normalised(v, scale.level) * graph.mean_edge, detail::kLargestBend);
      weight[v] = value * value;
      level[v] = scale.drawn;
    }
  });
  const DiffusionOperator op = umbrella_operator(graph.topology.ring, &graph.topology);
  ScaleSpaceOptions wanted;
  wanted.schedule = {2, kScaleSmoothing, 1.0};
  wanted.want_loc = false;
  const ScaleSpaceF below = compute_scale_space_single(op, weight, wanted, run.stage(0.0, 0.5));
  const ScaleSpaceF above =
      compute_scale_space_single(op, weight.cwiseProduct(level), wanted, run.stage(0.5, 1.0));
  if (below.status == Status::cancelled || above.status == Status::cancelled) return std::nullopt;
  const double low = static_cast<double>(options.finest);
  const double high = static_cast<double>(options.schedule.num_levels - 1);
  for (Index v = 0; v < count; ++v) {
    const auto total = static_cast<double>(below.levels(1, v));
    if (total > 0.0 && std::isfinite(total))
      level[v] =
          std::clamp(static_cast<double>(above.levels(1, v)) / total, std::min(low, high), high);
  }
  return level;
}

// Points of the chains of one kind.
std::vector<detail::Chain> make_chains(const SurfaceGraph& graph, const ScaleChoice& choice,
                                       const VectorXd& level, const BendField& field,
                                       CrestKind kind, const CrestOptions& options) {
  const bool is_one_level = options.level > 0;
  const double ratio = detail::draw_ratio(options);
  const RidgeSegments found = detail::find_ridge_segments(graph, field);
  std::vector<CrestPoint> points(found.crossings.size());
  const double edge = graph.mean_edge;
  parallel_for(0, static_cast<Index>(points.size()), 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const EdgeCrossing& c = found.crossings[static_cast<size_t>(i)];
      CrestPoint& p = points[static_cast<size_t>(i)];
      p.edge = c;
      p.position = (1.0 - c.weight) * graph.points.row(c.a) + c.weight * graph.points.row(c.b);
      p.level = is_one_level ? level[c.a] : detail::interpolate(level, c);
      p.anisotropy = detail::interpolate(field.strength, c) / detail::interpolate(field.bend, c);
      p.curvature = (kind == CrestKind::ridge ? 1.0 : -1.0) * detail::interpolate(field.bend, c);
      const Scale scale = choice.at_crossing(c);
      p.is_scale_peak = scale.is_peak;
      p.radius = std::sqrt(scale.tau) * graph.mean_edge;
      // On one level a strength is that level's: what the thesis draws.
      const double at = is_one_level ? p.level : scale.level;
      const double radius =
          is_one_level ? std::sqrt(choice.tau(p.level)) * graph.mean_edge : p.radius;
      p.scale_level = at;
      p.strength = radius * choice.strength(c, at);
      p.sharpness = c.sharpness * detail::resolved_tau(choice.tau(p.level), ratio) * edge * edge /
                    std::abs(p.curvature);
    }
  });
  std::vector<detail::Chain> chains;
  for (const std::vector<int32_t>& indices : detail::link_segments(found)) {
    detail::Chain chain;
    for (const int32_t i : indices) chain.push_back(points[static_cast<size_t>(i)]);
    chains.push_back(std::move(chain));
  }
  return chains;
}

}  // namespace

void validate(const CrestOptions& options) {
  validate(options.schedule);
  const auto require = [](bool is_legal, const std::string& what, const std::string& range) {
    if (!is_legal) throw InvalidArgument(what + ", legal range " + range);
  };
  const int last = options.schedule.num_levels - 1;
  require(options.level >= 0 && options.level <= last, "level is " + std::to_string(options.level),
          "0 to " + std::to_string(last));
  require(options.finest >= 1, "finest is " + std::to_string(options.finest), ">= 1");
  require(options.schedule.num_levels <= static_cast<int>(kMaxLevels),
          "levels is " + std::to_string(options.schedule.num_levels),
          "2 to " + std::to_string(kMaxLevels));
  require(options.normal_smoothing >= 0 && options.normal_smoothing <= 1000,
          "normal_smoothing is " + std::to_string(options.normal_smoothing), "0 to 1000");
  require(std::isfinite(options.gamma) && options.gamma > 0.0 && options.gamma <= 2.0,
          "gamma is " + std::to_string(options.gamma), "(0, 2]");
  require(options.low >= 0.0 && options.high >= options.low && std::isfinite(options.high),
          "low is " + std::to_string(options.low) + " and high is " + std::to_string(options.high),
          "0 <= low <= high");
  require(std::isfinite(options.max_turn) && options.max_turn > 0.0,
          "max_turn is " + std::to_string(options.max_turn), "> 0");
  // Between .95 and 1 the difference of two levels is lost in their rounding.
  require(options.drawn_share > 0.0 && (options.drawn_share <= 0.95 || options.drawn_share == 1.0),
          "drawn_share is " + std::to_string(options.drawn_share), "(0, 0.95], or 1");
  require(options.min_anisotropy >= 0.0 && options.min_anisotropy < 1.0,
          "min_anisotropy is " + std::to_string(options.min_anisotropy), "[0, 1)");
  const std::pair<const char*, double> lengths[] = {{"noise_sigma", options.noise_sigma},
                                                    {"noise_factor", options.noise_factor},
                                                    {"min_sharpness", options.min_sharpness},
                                                    {"min_length", options.min_length},
                                                    {"max_gap", options.max_gap}};
  for (const auto& [name, value] : lengths) {
    require(std::isfinite(value) && value >= 0.0,
            std::string(name) + " is " + std::to_string(value), ">= 0");
  }
}

CrestSet find_crest_lines(const SurfaceGraph& graph, const CrestOptions& options, RunControl run) {
  validate(options);
  if (!graph.is_mesh()) {
    throw AnalysisError("E_NO_FACES", "crest lines need faces, this is a point cloud",
                        "triangulate the points first");
  }
  CrestSet set;
  set.tau = level_scales(options.schedule, ScaleMeasure::exact);
  set.level = VectorXd::Constant(graph.points.rows(), options.level);
  if (!(graph.mean_edge > 0.0)) return set;
  const auto cancelled = [&] {
    set.status = Status::cancelled;
    return set;
  };
  const detail::GradientStencil stencil =
      detail::gradient_stencil(graph.points, graph.triangles, graph.topology.ring);
  const std::optional<TensorStack> stack = detail::make_tensor_stack(
      graph, graph.points, {options.schedule, options.filter, options.normal_smoothing}, stencil,
      run.stage(0.0, 0.7));
  if (!stack) return cancelled();
  set.tau = stack->tau;
  const ScaleChoice choice(*stack, graph, options);
  if (options.level == 0) {
    std::optional<VectorXd> level = local_levels(graph, choice, options, run.stage(0.75, 0.85));
    if (!level) return cancelled();
    set.level = std::move(*level);
  }
  for (const CrestKind kind : {CrestKind::ridge, CrestKind::valley}) {
    if (run.cancelled()) return cancelled();
    const BendField field =
        detail::bend_field(graph, *stack, set.level, detail::draw_ratio(options), stencil, kind);
    detail::assemble_lines(make_chains(graph, choice, set.level, field, kind, options), kind,
                           graph.mean_edge, options, set.lines);
  }
  std::stable_sort(set.lines.begin(), set.lines.end(), [](const CrestLine& a, const CrestLine& b) {
    return a.strength * a.length > b.strength * b.length;
  });
  run.report(1.0);
  return set;
}

}  // namespace dupin
