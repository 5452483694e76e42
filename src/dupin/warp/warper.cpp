#include "dupin/warp/warper.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/control_samples.h"
#include "dupin/warp/warp_depth.h"

namespace dupin {
namespace {

using detail::label;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void require(bool condition, const std::string& message) {
  if (!condition) throw InvalidArgument(message);
}

void require_options(const WarpOptions& options) {
  require(std::isfinite(options.beta) && options.beta >= 1.0, "beta must be >= 1");
  require(options.iterations >= 0, "iterations must be >= 0");
  require(options.tolerance >= 0.0 && options.tolerance < 1.0, "tolerance must be in [0, 1)");
  require(options.rotation_iterations >= 1, "rotation_iterations must be >= 1");
  require(std::isfinite(options.frozen_residual) && options.frozen_residual >= 0.0,
          "frozen_residual must be >= 0");
  require(std::isfinite(options.line_spacing_px) && options.line_spacing_px >= 0.0,
          "line_spacing_px must be >= 0");
}

RowVector2d turned(const RowVector2d& v, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
}

// Corners with a part in the place: one, two on an edge, or three.
std::vector<std::int32_t> support(const Triangles& triangles, const MeshPoint& place) {
  std::vector<std::int32_t> result;
  if (place.triangle < 0) return result;
  for (Index k = 0; k < 3; ++k) {
    if (place.weights[k] > 0.0) result.push_back(triangles(place.triangle, k));
  }
  return result;
}

// Vertices of the ring: of a vertex its neighbours, of a place in a triangle the corners.
std::vector<std::int32_t> ring_of(const PlanarMesh& mesh, const PlanarGraph& graph,
                                  const MeshPoint& place) {
  std::vector<std::int32_t> result = support(mesh.triangles, place);
  if (result.size() == 1) {
    const Adjacency& ring = graph.topology.ring;
    const std::int32_t v = result[0];
    result.insert(result.end(), ring.begin(v), ring.end(v));
  } else if (place.triangle >= 0) {
    result.clear();
    for (Index k = 0; k < 3; ++k) result.push_back(mesh.triangles(place.triangle, k));
  }
  return result;
}

}  // namespace

Warper::Warper(const PlanarMesh& mesh, const std::vector<Pin>& pins,
               const std::vector<ControlLine>& lines, const WarpOptions& options, RunControl run)
    : mesh_(mesh), options_(options) {
  validate(mesh_);
  require_options(options_);
  detail::require_pins(pins);
  detail::require_lines(lines, pins.size());
  graph_ = std::make_shared<const PlanarGraph>(make_planar_graph(mesh_));
  place_pins(pins, !lines.empty());
  run.throw_if_cancelled();
  prepare_mls(pins, lines, run.stage(0.0, 0.6));
  run.throw_if_cancelled();
  prepare_arap(pins, run);
  run.throw_if_cancelled();
  run.report(1.0);
}

void Warper::place_pins(const std::vector<Pin>& pins, bool may_be_outside) {
  detail::PlacedPins placed = detail::place_pins(mesh_, pins);
  sources_ = std::move(placed.sources);
  targets_ = std::move(placed.targets);
  places_ = std::move(placed.places);
  rotations_ = VectorXd::Constant(sources_.rows(), kNone);
  for (Index m = 0; m < sources_.rows(); ++m) {
    const Pin& pin = pins[at(m)];
    if (pin.rotation) rotations_[m] = *pin.rotation;
    if (places_[at(m)].triangle >= 0 || may_be_outside) continue;
    throw AnalysisError("E_PIN_OUTSIDE", label(pin, m) + " lies outside the shape or in a hole",
                        "move it onto the shape");
  }
  const double least = detail::one_place_distance(mesh_);
  for (Index m = 0; m < sources_.rows(); ++m) {
    const auto corners = support(mesh_.triangles, places_[at(m)]);
    for (Index k = 0; k < m; ++k) {
      if ((sources_.row(m) - sources_.row(k)).norm() > least) continue;
      const auto others = support(mesh_.triangles, places_[at(k)]);
      const bool is_shared = corners.empty() || others.empty() ||
                             std::find_first_of(corners.begin(), corners.end(), others.begin(),
                                                others.end()) != corners.end();
      if (!is_shared) continue;
      throw AnalysisError(
          "E_PIN_CONFLICT",
          label(pins[at(k)], k) + " and " + label(pins[at(m)], m) + " are at one place",
          "delete one of them");
    }
  }
}

void Warper::prepare_mls(const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                         RunControl run) {
  const double edge = mean_edge_length(mesh_.points, graph_->topology.ring);
  const detail::ControlSamples samples = detail::sample_controls(
      pins, sources_, lines, options_.line_spacing_px > 0.0 ? options_.line_spacing_px : edge);
  const MatrixXd distance =
      detail::control_distances(mesh_, *graph_, sources_, places_, samples, options_.metric, run);
  VectorXd radius(static_cast<Index>(pins.size()));
  for (Index m = 0; m < radius.size(); ++m) radius[m] = std::max(pins[at(m)].radius, edge);
  mls_ = std::make_shared<const MlsWarp>(
      mesh_.points, sources_, samples.where,
      Eigen::Map<const VectorXd>(samples.weight.data(), distance.cols()), distance, radius,
      options_.mls, run);
  pin_distance_ = distance.leftCols(radius.size());
  detail::UnreachedParts unreached =
      detail::find_unreached(mesh_, *graph_, distance, options_.is_unanchored_allowed);
  is_still_ = std::move(unreached.is_still);
  still_components_ = std::move(unreached.still_components);
}

std::vector<Warper::Held> Warper::held_rings(const std::vector<Pin>& pins) const {
  std::vector<std::int32_t> owner(at(mesh_.points.rows()), -1);
  std::vector<std::uint8_t> is_pinned(at(mesh_.points.rows()), 0);
  for (Index m = 0; m < sources_.rows(); ++m) {
    for (const std::int32_t v : support(mesh_.triangles, places_[at(m)])) {
      // A vertex that two pins have a part in belongs to neither.
      is_pinned[at(v)] = 1;
      owner[at(v)] = owner[at(v)] == -1 ? static_cast<std::int32_t>(m) : -2;
    }
  }
  std::vector<std::int32_t> holder(at(mesh_.points.rows()), -1);
  for (Index m = 0; m < sources_.rows(); ++m) {
    if (!pins[at(m)].rotation || places_[at(m)].triangle < 0) continue;
    std::vector<std::int32_t> vertices = ring_of(mesh_, *graph_, places_[at(m)]);
    for (Index v = 0; v < mesh_.points.rows(); ++v) {
      if (pin_distance_(v, m) <= pins[at(m)].radius)
        vertices.push_back(static_cast<std::int32_t>(v));
    }
    for (const std::int32_t v : vertices) {
      if (is_pinned[at(v)] != 0 && owner[at(v)] != m) continue;
      std::int32_t& best = holder[at(v)];
      if (best < 0 || pin_distance_(v, m) < pin_distance_(v, best))
        best = static_cast<std::int32_t>(m);
    }
  }
  std::vector<Held> held;
  for (std::int32_t v = 0; v < mesh_.points.rows(); ++v) {
    const std::int32_t m = holder[at(v)];
    if (m < 0 || (is_pinned[at(v)] != 0 && support(mesh_.triangles, places_[at(m)]).size() == 1))
      continue;
    held.push_back({v, m, mesh_.points.row(v) - sources_.row(m)});
  }
  return held;
}

VectorXd Warper::vertex_weights(const std::vector<Pin>& pins) const {
  VectorXd weight = VectorXd::Ones(mesh_.points.rows());
  const auto raise = [&](Index v, double value) { weight[v] = std::max(weight[v], value); };
  const Adjacency& ring = graph_->topology.ring;
  for (Index m = 0; m < sources_.rows(); ++m) {
    for (const std::int32_t v : support(mesh_.triangles, places_[at(m)])) {
      raise(v, options_.beta);
      for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k)
        raise(*k, 0.5 * options_.beta);
    }
    if (pins[at(m)].radius == 0.0) continue;
    for (Index v = 0; v < mesh_.points.rows(); ++v) {
      if (pin_distance_(v, m) <= pins[at(m)].radius) raise(v, options_.beta);
    }
  }
  return weight;
}

void Warper::prepare_arap(const std::vector<Pin>& pins, const RunControl& run) {
  if (options_.rotation == RotationMode::held) held_ = held_rings(pins);
  std::vector<std::int32_t> held_by(at(mesh_.points.rows()), -1);
  for (const Held& held : held_) held_by[at(held.vertex)] = held.pin;
  std::vector<std::uint8_t> is_anchored(is_still_.size(), 0);
  for (Index m = 0; m < sources_.rows(); ++m) {
    const MeshPoint& place = places_[at(m)];
    const auto corners = support(mesh_.triangles, place);
    if (corners.empty()) continue;
    is_anchored[at(graph_->components.label[at(corners[0])])] = 1;
    // Held corners say where the pin is.
    if (std::all_of(corners.begin(), corners.end(),
                    [&](std::int32_t v) { return held_by[at(v)] == m; }))
      continue;
    PlaceConstraint row{corners, {}, label(pins[at(m)], m)};
    for (Index k = 0; k < 3; ++k) {
      if (place.weights[k] > 0.0) row.weight.push_back(place.weights[k]);
    }
    rows_.push_back(std::move(row));
    row_pin_.push_back(static_cast<std::int32_t>(m));
  }
  for (const Held& held : held_)
    rows_.push_back({{held.vertex}, {1.0}, label(pins[at(held.pin)], held.pin)});
  for (std::int32_t v = 0; v < mesh_.points.rows(); ++v) {
    if (is_anchored[at(graph_->components.label[at(v)])] == 0) rows_.push_back({{v}, {1.0}, ""});
  }
  constraints_ = LinearConstraints(mesh_.points.rows(), rows_);
  weighting_ = dupin::edge_weights(mesh_, *graph_, options_.edge_weights);
  vertex_weight_ = vertex_weights(pins);
  arap_ = std::make_shared<const ArapSystem>(mesh_, *graph_, weighting_.weight, vertex_weight_,
                                             constraints_, run);
}

Points2 Warper::constraint_values(const Points2& start, const Points2& targets,
                                  const VectorXd& rotations) const {
  Points2 values(static_cast<Index>(rows_.size()), 2);
  Index r = 0;
  for (const std::int32_t m : row_pin_) values.row(r++) = targets.row(m);
  for (const Held& held : held_)
    values.row(r++) = targets.row(held.pin) + turned(held.offset, rotations[held.pin]);
  for (; r < values.rows(); ++r) values.row(r) = start.row(rows_[at(r)].vertex[0]);
  return values;
}

WarpStep Warper::drag(const Points2& targets, const VectorXd& rotations, bool measure,
                      const RunControl& run) const {
  require(targets.rows() == sources_.rows(), "there must be one target a pin");
  require(rotations.size() == 0 || rotations.size() == sources_.rows(),
          "there must be one rotation a pin, or none");
  VectorXd angles = rotations_;
  for (Index m = 0; m < targets.rows(); ++m) {
    require(std::isfinite(targets(m, 0)) && std::isfinite(targets(m, 1)),
            "the target of pin " + std::to_string(m) + " is not finite");
    if (rotations.size() == 0 || std::isnan(angles[m])) continue;
    require(std::isfinite(rotations[m]),
            "the rotation of pin " + std::to_string(m) + " is not finite");
    angles[m] = rotations[m];
  }
  const bool has_rotation =
      std::any_of(angles.begin(), angles.end(), [](double angle) { return !std::isnan(angle); });
  if (has_rotation && options_.rotation == RotationMode::thesis)
    return drag_as_thesis(targets, angles, measure, run);
  run.throw_if_cancelled();
  WarpStep step;
  step.points = mls_->deform(targets, has_rotation ? angles : VectorXd());
  constraints_.enforce(step.points, constraint_values(step.points, targets, angles));
  iterate(step, measure, run);
  return step;
}

void Warper::iterate(WarpStep& step, bool measure, const RunControl& run) const {
  const auto start = std::chrono::steady_clock::now();
  const auto is_settled = [&] {
    const std::size_t count = step.energy.size();
    return count > 1 && step.energy[count - 2] - step.energy[count - 1] <=
                            options_.tolerance * step.energy[count - 2];
  };
  bool is_done = false;
  while (!is_done && step.iterations < options_.iterations) {
    run.throw_if_cancelled();
    step.energy.push_back(arap_->iterate(step.points));
    ++step.iterations;
    is_done = options_.tolerance > 0.0 && is_settled();
  }
  if (step.iterations > 0) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    step.seconds_per_iteration = spent.count() / step.iterations;
  }
  if (measure || options_.tolerance > 0.0) step.energy.push_back(arap_->energy(step.points));
  step.is_converged = options_.tolerance == 0.0 || is_done || is_settled();
}

Points2 Warper::nearest_pin_start(const Points2& targets, const VectorXd& rotations) const {
  Points2 q = mesh_.points;
  for (Index v = 0; v < q.rows(); ++v) {
    Index nearest = -1;
    for (Index m = 0; m < targets.rows(); ++m) {
      if (!std::isfinite(pin_distance_(v, m))) continue;
      if (nearest < 0 || pin_distance_(v, m) < pin_distance_(v, nearest)) nearest = m;
    }
    if (nearest < 0) continue;
    const RowVector2d offset = q.row(v) - sources_.row(nearest);
    const double angle = std::isnan(rotations[nearest]) ? 0.0 : rotations[nearest];
    q.row(v) = targets.row(nearest) + turned(offset, angle);
  }
  return q;
}

// 7.3.3. Vertices whose cell the start leaves rigid are held where they are; what is held changes
// with every iteration, and with it the factor.
WarpStep Warper::drag_as_thesis(const Points2& targets, const VectorXd& rotations, bool measure,
                                const RunControl& run) const {
  WarpStep step;
  step.points = nearest_pin_start(targets, rotations);
  constraints_.enforce(step.points, constraint_values(step.points, targets, rotations));
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < options_.rotation_iterations; ++k) {
    run.throw_if_cancelled();
    const VectorXd residual = arap_->residuals(step.points);
    std::vector<PlaceConstraint> rows;
    std::vector<std::uint8_t> is_frozen(at(residual.size()), 0);
    for (std::int32_t v = 0; v < residual.size(); ++v) {
      if (residual[v] >= options_.frozen_residual &&
          constraints_.role(v) != LinearConstraints::Role::fixed)
        continue;
      is_frozen[at(v)] = 1;
      rows.push_back({{v}, {1.0}, ""});
    }
    for (const PlaceConstraint& row : rows_) {
      const bool is_implied = std::all_of(row.vertex.begin(), row.vertex.end(),
                                          [&](std::int32_t v) { return is_frozen[at(v)] != 0; });
      if (!is_implied) rows.push_back(row);
    }
    const LinearConstraints constraints(step.points.rows(), rows);
    const ArapSystem system(mesh_, *graph_, weighting_.weight, vertex_weight_, constraints, run);
    step.energy.push_back(system.iterate(step.points));
    ++step.iterations;
  }
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
  step.seconds_per_iteration = spent.count() / step.iterations;
  if (measure || options_.tolerance > 0.0) step.energy.push_back(arap_->energy(step.points));
  return step;
}

VectorXd Warper::depth(const VectorXd& depths) const {
  require(depths.size() == sources_.rows(), "there must be one depth a pin");
  return interpolate_depth(mls_->weights(), depths);
}

double Warper::largest_violation(const Points2& q, const Points2& targets,
                                 const VectorXd& rotations) const {
  return constraints_.largest_violation(q, constraint_values(q, targets, rotations));
}

}  // namespace dupin
