#include "dupin/warp/fine_stage.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/control_samples.h"
#include "dupin/warp/mls_warp.h"

namespace dupin::detail {
namespace {

using Eigen::Index;

constexpr int kReleases = 4;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// Pins of a line may repeat, as ends of two lines do; not with two targets.
void require_one_target(const PlanarMesh& rest, const std::vector<Pin>& pins,
                        const PlacedPins& placed) {
  const double least = one_place_distance(rest);
  for (Index m = 0; m < placed.sources.rows(); ++m) {
    for (Index k = 0; k < m; ++k) {
      if ((placed.sources.row(m) - placed.sources.row(k)).norm() > least ||
          (placed.targets.row(m) - placed.targets.row(k)).norm() <= least)
        continue;
      throw AnalysisError(
          "E_PIN_CONFLICT",
          label(pins[at(k)], k) + " and " + label(pins[at(m)], m) + " are at one place",
          "delete one of them");
    }
  }
}

}  // namespace

LineWarp warp_by_lines(const PlanarMesh& rest, const PlanarGraph& graph,
                       const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                       const WarpOptions& options, RunControl run) {
  require_pins(pins);
  require_lines(lines, pins.size());
  if (!std::isfinite(options.line_spacing_px) || options.line_spacing_px < 0.0)
    throw InvalidArgument("line_spacing_px must be >= 0");
  const PlacedPins placed = place_pins(rest, pins);
  require_one_target(rest, pins, placed);
  const double edge = mean_edge_length(rest.points, graph.topology.ring);
  const ControlSamples samples = sample_controls(
      pins, placed.sources, lines, options.line_spacing_px > 0.0 ? options.line_spacing_px : edge);
  const Eigen::MatrixXd distance =
      control_distances(rest, graph, placed.sources, placed.places, samples, options.metric, run);
  const MlsWarp mls(rest.points, placed.sources, samples.where,
                    Eigen::Map<const Eigen::VectorXd>(samples.weight.data(), distance.cols()),
                    distance, Eigen::VectorXd::Constant(placed.sources.rows(), edge), options.mls,
                    run);
  LineWarp result;
  Eigen::VectorXd angles = Eigen::VectorXd::Constant(placed.sources.rows(), std::nan(""));
  for (std::size_t m = 0; m < pins.size(); ++m) {
    if (pins[m].rotation) angles[static_cast<Index>(m)] = *pins[m].rotation;
  }
  result.points = mls.deform(placed.targets, angles);
  result.still_components =
      find_unreached(rest, graph, distance, options.is_unanchored_allowed).still_components;
  run.report(1.0);
  return result;
}

HeldBorder::HeldBorder(const PlanarMesh& rest, const PlanarGraph& graph, EdgeWeights weights)
    : rest_(rest),
      graph_(graph),
      weighting_(edge_weights(rest, graph, weights)),
      is_border_(at(rest.points.rows()), 0) {
  for (Index v = 0; v < rest.points.rows(); ++v)
    is_border_[at(v)] = graph.face_begin[at(v)] == graph.face_begin[at(v) + 1] ? 1 : 0;
  for (Index f = 0; f < rest.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      if (graph.across(f, k) >= 0) continue;
      is_border_[at(rest.triangles(f, (k + 1) % 3))] = 1;
      is_border_[at(rest.triangles(f, (k + 2) % 3))] = 1;
    }
  }
  system_ = holding(is_border_);
}

std::shared_ptr<const ArapSystem> HeldBorder::holding(
    const std::vector<std::uint8_t>& is_held) const {
  std::vector<PlaceConstraint> rows;
  for (std::int32_t v = 0; v < rest_.points.rows(); ++v) {
    if (is_held[at(v)] != 0) rows.push_back({{v}, {1.0}, ""});
  }
  return std::make_shared<const ArapSystem>(rest_, graph_, weighting_.weight,
                                            Eigen::VectorXd::Ones(rest_.points.rows()),
                                            LinearConstraints(rest_.points.rows(), rows));
}

PolishResult HeldBorder::polish(const PlanarMesh& first, const Points2& deformed,
                                const PolishOptions& options, const RunControl& run) const {
  PolishResult best = polish_folds(*system_, first, deformed, options, run);
  int iterations = best.iterations;
  std::vector<std::uint8_t> is_near(is_border_.size(), 0);
  for (const std::int32_t f : measure_warp(first, best.points).flipped) {
    for (Index k = 0; k < 3; ++k) is_near[at(rest_.triangles(f, k))] = 1;
  }
  const Adjacency& ring = graph_.topology.ring;
  for (int release = 0; release < kReleases && best.flipped > 0; ++release) {
    for (int steps = 0; steps < 1 << release; ++steps) {
      const std::vector<std::uint8_t> before = is_near;
      for (std::int32_t v = 0; v < rest_.points.rows(); ++v) {
        if (before[at(v)] == 0) continue;
        for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k) is_near[at(*k)] = 1;
      }
    }
    std::vector<std::uint8_t> is_held = is_border_;
    std::vector<std::uint8_t> is_anchored(at(graph_.components.count), 0);
    for (std::size_t v = 0; v < is_held.size(); ++v) {
      if (is_near[v] != 0) is_held[v] = 0;
      if (is_held[v] != 0) is_anchored[at(graph_.components.label[v])] = 1;
    }
    // A part that would float keeps its border.
    for (std::size_t v = 0; v < is_held.size(); ++v) {
      if (is_anchored[at(graph_.components.label[v])] == 0) is_held[v] = is_border_[v];
    }
    PolishResult result = polish_folds(*holding(is_held), first, deformed, options, run);
    iterations += result.iterations;
    if (result.flipped < best.flipped) best = std::move(result);
  }
  best.iterations = iterations;
  return best;
}

}  // namespace dupin::detail
