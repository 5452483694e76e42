#include "dupin/warp/warper.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/warp_depth.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kOnePlace = 1e-12;  // of the box diagonal: pins nearer than that are at one place
constexpr double kMostLineSamples = 256.0;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void require(bool condition, const std::string& message) {
  if (!condition) throw InvalidArgument(message);
}

std::string label(const std::vector<Pin>& pins, Index m) {
  const std::string& name = pins[at(m)].name;
  return name.empty() ? "pin " + std::to_string(m) : "pin " + name;
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

void require_pin(const Pin& pin, const std::string& name) {
  const auto is_finite = [](const Vector2d& p) {
    return std::isfinite(p.x()) && std::isfinite(p.y());
  };
  require(is_finite(pin.source), name + ": source is not finite");
  require(is_finite(pin.target), name + ": target is not finite");
  require(!pin.rotation || std::isfinite(*pin.rotation), name + ": rotation is not finite");
  require(std::isfinite(pin.depth), name + ": depth is not finite");
  require(std::isfinite(pin.radius) && pin.radius >= 0.0, name + ": radius must be >= 0");
  require(std::isfinite(pin.weight) && pin.weight > 0.0, name + ": weight must be > 0");
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

struct Samples {
  std::vector<ControlSample> where;
  std::vector<double> weight;
};

Samples sample_controls(const std::vector<Pin>& pins, const Points2& sources,
                        const std::vector<ControlLine>& lines, double spacing) {
  Samples samples;
  for (std::size_t m = 0; m < pins.size(); ++m) {
    samples.where.push_back({static_cast<std::int32_t>(m), static_cast<std::int32_t>(m), 0.0});
    samples.weight.push_back(pins[m].weight);
  }
  double total = 0.0;
  for (const ControlLine& line : lines)
    total += (sources.row(line.first) - sources.row(line.second)).norm();
  const double step = std::max(spacing, total / kMostLineSamples);
  for (const ControlLine& line : lines) {
    const double length = (sources.row(line.first) - sources.row(line.second)).norm();
    const double pieces = step > 0.0 ? std::ceil(length / step) : 1.0;
    for (double piece = 1.0; piece < pieces; piece += 1.0) {
      const double t = piece / pieces;
      samples.where.push_back({line.first, line.second, t});
      samples.weight.push_back((1.0 - t) * pins[at(line.first)].weight +
                               t * pins[at(line.second)].weight);
    }
  }
  return samples;
}

}  // namespace

Warper::Warper(const PlanarMesh& mesh, const std::vector<Pin>& pins,
               const std::vector<ControlLine>& lines, const WarpOptions& options, RunControl run)
    : mesh_(mesh), options_(options) {
  validate(mesh_);
  require_options(options_);
  for (std::size_t m = 0; m < pins.size(); ++m)
    require_pin(pins[m], label(pins, static_cast<Index>(m)));
  for (const ControlLine& line : lines) {
    const auto num_pins = static_cast<std::int32_t>(pins.size());
    require(line.first >= 0 && line.first < num_pins && line.second >= 0 && line.second < num_pins,
            "a control line names a pin that is not there");
  }
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
  const auto num_pins = static_cast<Index>(pins.size());
  sources_.resize(num_pins, 2);
  targets_.resize(num_pins, 2);
  rotations_ = VectorXd::Constant(num_pins, kNone);
  places_.resize(pins.size());
  for (Index m = 0; m < num_pins; ++m) {
    const Pin& pin = pins[at(m)];
    targets_.row(m) = pin.target.transpose();
    if (pin.rotation) rotations_[m] = *pin.rotation;
    sources_.row(m) = pin.source.transpose();
    std::optional<MeshPoint> place = pin.anchor;
    if (place) {
      require(place->triangle >= 0 && place->triangle < mesh_.triangles.rows() &&
                  place->weights.minCoeff() >= 0.0 && std::abs(place->weights.sum() - 1.0) <= 1e-9,
              label(pins, m) + ": its anchor is on no triangle");
    } else {
      place = locate(mesh_, pin.source);
    }
    if (!place) {
      if (may_be_outside) continue;
      throw AnalysisError("E_PIN_OUTSIDE", label(pins, m) + " lies outside the shape or in a hole",
                          "move it onto the shape");
    }
    places_[at(m)] = *place;
    sources_.row(m) = position(mesh_.points, mesh_.triangles, *place).transpose();
    // An anchor may be a little beside the source, by the grid of the mesher: the motion counts.
    if (pin.anchor) targets_.row(m) += sources_.row(m) - pin.source.transpose();
  }
  const double least = kOnePlace * box_diagonal(mesh_.points);
  for (Index m = 0; m < num_pins; ++m) {
    const auto corners = support(mesh_.triangles, places_[at(m)]);
    for (Index k = 0; k < m; ++k) {
      if ((sources_.row(m) - sources_.row(k)).norm() > least) continue;
      const auto others = support(mesh_.triangles, places_[at(k)]);
      const bool is_shared = corners.empty() || others.empty() ||
                             std::find_first_of(corners.begin(), corners.end(), others.begin(),
                                                others.end()) != corners.end();
      if (is_shared) {
        throw AnalysisError("E_PIN_CONFLICT",
                            label(pins, k) + " and " + label(pins, m) + " are at one place",
                            "delete one of them");
      }
    }
  }
}

void Warper::prepare_mls(const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                         RunControl run) {
  const double edge = mean_edge_length(mesh_.points, graph_->topology.ring);
  const Samples samples = sample_controls(
      pins, sources_, lines, options_.line_spacing_px > 0.0 ? options_.line_spacing_px : edge);
  const auto num_samples = static_cast<Index>(samples.where.size());
  MatrixXd distance(mesh_.points.rows(), num_samples);
  parallel_for(0, num_samples, 1, [&](Index first, Index last) {
    for (Index s = first; s < last && !run.cancelled(); ++s) {
      const ControlSample& sample = samples.where[at(s)];
      const RowVector2d place =
          (1.0 - sample.t) * sources_.row(sample.first) + sample.t * sources_.row(sample.second);
      if (options_.metric == WarpMetric::euclidean) {
        distance.col(s) = (mesh_.points.rowwise() - place).rowwise().norm();
        continue;
      }
      const bool is_pin_inside =
          s < static_cast<Index>(pins.size()) && places_[at(s)].triangle >= 0;
      const MeshPoint where =
          is_pin_inside ? places_[at(s)] : closest_mesh_point(mesh_, place.transpose());
      const double offset =
          (position(mesh_.points, mesh_.triangles, where).transpose() - place).norm();
      distance.col(s) = geodesic_distances(
          mesh_, *graph_, where,
          options_.metric == WarpMetric::edges ? GeodesicMethod::edges : GeodesicMethod::exact,
          run);
      if (!is_pin_inside) distance.col(s).array() += offset;
    }
  });
  run.throw_if_cancelled();
  VectorXd radius(static_cast<Index>(pins.size()));
  for (Index m = 0; m < radius.size(); ++m) radius[m] = std::max(pins[at(m)].radius, edge);
  mls_ = std::make_shared<const MlsWarp>(
      mesh_.points, sources_, samples.where,
      Eigen::Map<const VectorXd>(samples.weight.data(), num_samples), distance, radius,
      options_.mls, run);
  pin_distance_ = distance.leftCols(radius.size());

  is_still_.assign(at(graph_->components.count), 1);
  for (Index v = 0; v < mesh_.points.rows(); ++v) {
    std::uint8_t& still = is_still_[at(graph_->components.label[at(v)])];
    for (Index s = 0; still != 0 && s < num_samples; ++s) {
      if (std::isfinite(distance(v, s))) still = 0;
    }
  }
  std::vector<std::uint8_t> has_face(is_still_.size(), 0);
  for (Index i = 0; i < mesh_.triangles.size(); ++i)
    has_face[at(graph_->components.label[at(mesh_.triangles.data()[i])])] = 1;
  for (std::size_t c = 0; c < is_still_.size(); ++c) {
    if (is_still_[c] == 0 || has_face[c] == 0) continue;
    still_components_.push_back(static_cast<std::int32_t>(c));
    if (!options_.is_unanchored_allowed) {
      throw AnalysisError("E_COMPONENT_UNANCHORED",
                          "part " + std::to_string(c) + " of the shape has no pin",
                          "give every part of the shape a pin");
    }
  }
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
    PlaceConstraint row{corners, {}, label(pins, m)};
    for (Index k = 0; k < 3; ++k) {
      if (place.weights[k] > 0.0) row.weight.push_back(place.weights[k]);
    }
    rows_.push_back(std::move(row));
    row_pin_.push_back(static_cast<std::int32_t>(m));
  }
  for (const Held& held : held_) rows_.push_back({{held.vertex}, {1.0}, label(pins, held.pin)});
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
