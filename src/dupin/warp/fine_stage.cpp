#include "dupin/warp/fine_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/mls_warp.h"
#include "dupin/warp/planar_geodesics.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

constexpr double kOnePlace = 1e-12;  // of the box diagonal: pins nearer than that are at one place
constexpr double kMostLineSamples = 256.0;
constexpr int kReleases = 4;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

bool is_finite(const Eigen::Vector2d& p) { return std::isfinite(p.x()) && std::isfinite(p.y()); }

std::string label(const Pin& pin, Index m) {
  return pin.name.empty() ? "pin " + std::to_string(m) : "pin " + pin.name;
}

struct Controls {
  Points2 sources;
  Points2 targets;
  std::vector<MeshPoint> places;  // triangle -1 outside
};

Controls place_controls(const PlanarMesh& rest, const std::vector<Pin>& pins) {
  Controls controls;
  const auto count = static_cast<Index>(pins.size());
  controls.sources.resize(count, 2);
  controls.targets.resize(count, 2);
  controls.places.resize(pins.size());
  const double least = kOnePlace * box_diagonal(rest.points);
  for (Index m = 0; m < count; ++m) {
    const Pin& pin = pins[at(m)];
    if (!is_finite(pin.source) || !is_finite(pin.target))
      throw InvalidArgument(label(pin, m) + " is not finite");
    if (!std::isfinite(pin.weight) || !(pin.weight > 0.0))
      throw InvalidArgument(label(pin, m) + ": weight must be > 0");
    controls.sources.row(m) = pin.source.transpose();
    controls.targets.row(m) = pin.target.transpose();
    if (pin.anchor) {
      const MeshPoint& anchor = *pin.anchor;
      if (anchor.triangle < 0 || anchor.triangle >= rest.triangles.rows() ||
          !(anchor.weights.minCoeff() >= 0.0) || !(std::abs(anchor.weights.sum() - 1.0) <= 1e-9))
        throw InvalidArgument(label(pin, m) + ": its anchor is on no triangle");
      controls.places[at(m)] = anchor;
      controls.sources.row(m) = position(rest.points, rest.triangles, anchor).transpose();
      controls.targets.row(m) += controls.sources.row(m) - pin.source.transpose();
    } else if (const std::optional<MeshPoint> place = locate(rest, pin.source)) {
      controls.places[at(m)] = *place;
    }
    for (Index k = 0; k < m; ++k) {
      if ((controls.sources.row(m) - controls.sources.row(k)).norm() > least) continue;
      if ((controls.targets.row(m) - controls.targets.row(k)).norm() <= least) continue;
      throw AnalysisError("E_PIN_CONFLICT",
                          label(pins[at(k)], k) + " and " + label(pin, m) + " are at one place",
                          "delete one of them");
    }
  }
  return controls;
}

struct Samples {
  std::vector<ControlSample> where;
  std::vector<double> weight;
};

Samples sample_lines(const std::vector<Pin>& pins, const Points2& sources,
                     const std::vector<ControlLine>& lines, double spacing) {
  Samples samples;
  for (std::size_t m = 0; m < pins.size(); ++m) {
    samples.where.push_back({static_cast<std::int32_t>(m), static_cast<std::int32_t>(m), 0.0});
    samples.weight.push_back(pins[m].weight);
  }
  const auto length_of = [&](const ControlLine& line) {
    return (sources.row(line.first) - sources.row(line.second)).norm();
  };
  double total = 0.0;
  for (const ControlLine& line : lines) total += length_of(line);
  const double step = std::max(spacing, total / kMostLineSamples);
  for (const ControlLine& line : lines) {
    const double pieces = step > 0.0 ? std::ceil(length_of(line) / step) : 1.0;
    for (double piece = 1.0; piece < pieces; piece += 1.0) {
      const double t = piece / pieces;
      samples.where.push_back({line.first, line.second, t});
      samples.weight.push_back((1.0 - t) * pins[at(line.first)].weight +
                               t * pins[at(line.second)].weight);
    }
  }
  return samples;
}

Eigen::MatrixXd distances_to(const PlanarMesh& rest, const PlanarGraph& graph,
                             const Controls& controls, const Samples& samples, WarpMetric metric,
                             const RunControl& run) {
  const auto num_samples = static_cast<Index>(samples.where.size());
  Eigen::MatrixXd distance(rest.points.rows(), num_samples);
  parallel_for(0, num_samples, 1, [&](Index first, Index last) {
    for (Index s = first; s < last && !run.cancelled(); ++s) {
      const ControlSample& sample = samples.where[at(s)];
      const RowVector2d place = (1.0 - sample.t) * controls.sources.row(sample.first) +
                                sample.t * controls.sources.row(sample.second);
      if (metric == WarpMetric::euclidean) {
        distance.col(s) = (rest.points.rowwise() - place).rowwise().norm();
        continue;
      }
      const bool is_inside = s < controls.sources.rows() && controls.places[at(s)].triangle >= 0;
      const MeshPoint where =
          is_inside ? controls.places[at(s)] : closest_mesh_point(rest, place.transpose());
      distance.col(s) = geodesic_distances(
          rest, graph, where,
          metric == WarpMetric::edges ? GeodesicMethod::edges : GeodesicMethod::exact);
      if (!is_inside)
        distance.col(s).array() +=
            (position(rest.points, rest.triangles, where).transpose() - place).norm();
    }
  });
  return distance;
}

}  // namespace

LineWarp warp_by_lines(const PlanarMesh& rest, const PlanarGraph& graph,
                       const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                       const WarpOptions& options, RunControl run) {
  for (const ControlLine& line : lines) {
    const auto count = static_cast<std::int32_t>(pins.size());
    if (line.first < 0 || line.first >= count || line.second < 0 || line.second >= count)
      throw InvalidArgument("a control line names a pin that is not there");
  }
  if (!std::isfinite(options.line_spacing_px) || options.line_spacing_px < 0.0)
    throw InvalidArgument("line_spacing_px must be >= 0");
  const Controls controls = place_controls(rest, pins);
  const double edge = mean_edge_length(rest.points, graph.topology.ring);
  const Samples samples =
      sample_lines(pins, controls.sources, lines,
                   options.line_spacing_px > 0.0 ? options.line_spacing_px : edge);
  const Eigen::MatrixXd distance =
      distances_to(rest, graph, controls, samples, options.metric, run);
  run.throw_if_cancelled();
  const MlsWarp mls(rest.points, controls.sources, samples.where,
                    Eigen::Map<const Eigen::VectorXd>(samples.weight.data(), distance.cols()),
                    distance, Eigen::VectorXd::Constant(controls.sources.rows(), edge),
                    options.mls);
  LineWarp result;
  Eigen::VectorXd angles = Eigen::VectorXd::Constant(controls.sources.rows(), std::nan(""));
  bool has_angle = false;
  for (std::size_t m = 0; m < pins.size(); ++m) {
    if (!pins[m].rotation) continue;
    if (!std::isfinite(*pins[m].rotation))
      throw InvalidArgument(label(pins[m], static_cast<Index>(m)) + ": rotation is not finite");
    angles[static_cast<Index>(m)] = *pins[m].rotation;
    has_angle = true;
  }
  result.points = mls.deform(controls.targets, has_angle ? angles : Eigen::VectorXd());

  std::vector<std::uint8_t> is_reached(at(graph.components.count), 0);
  for (Index v = 0; v < rest.points.rows(); ++v) {
    std::uint8_t& reached = is_reached[at(graph.components.label[at(v)])];
    for (Index s = 0; reached == 0 && s < distance.cols(); ++s)
      reached = std::isfinite(distance(v, s)) ? 1 : 0;
  }
  std::vector<std::uint8_t> has_face(is_reached.size(), 0);
  for (Index i = 0; i < rest.triangles.size(); ++i)
    has_face[at(graph.components.label[at(rest.triangles.data()[i])])] = 1;
  for (std::size_t c = 0; c < is_reached.size(); ++c) {
    if (is_reached[c] != 0 || has_face[c] == 0) continue;
    result.still_components.push_back(static_cast<std::int32_t>(c));
    if (!options.is_unanchored_allowed)
      throw AnalysisError("E_COMPONENT_UNANCHORED",
                          "part " + std::to_string(c) + " of the shape has no pin",
                          "give every part of the shape a pin");
  }
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
                                const PolishOptions& options) const {
  PolishResult best = polish_folds(*system_, first, deformed, options);
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
    PolishResult result = polish_folds(*holding(is_held), first, deformed, options);
    iterations += result.iterations;
    if (result.flipped < best.flipped) best = std::move(result);
  }
  best.iterations = iterations;
  return best;
}

}  // namespace dupin::detail
