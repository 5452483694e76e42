#include "dupin/warp/control_samples.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/planar_geodesics.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector2d;
using Eigen::Vector2d;

constexpr double kOnePlace = 1e-12;  // of the box diagonal
constexpr double kMostLineSamples = 256.0;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void require(bool condition, const std::string& message) {
  if (!condition) throw InvalidArgument(message);
}

bool is_finite(const Vector2d& p) { return std::isfinite(p.x()) && std::isfinite(p.y()); }

}  // namespace

std::string label(const Pin& pin, Index m) {
  return pin.name.empty() ? "pin " + std::to_string(m) : "pin " + pin.name;
}

void require_pins(const std::vector<Pin>& pins) {
  for (std::size_t m = 0; m < pins.size(); ++m) {
    const Pin& pin = pins[m];
    const std::string name = label(pin, static_cast<Index>(m));
    require(is_finite(pin.source), name + ": source is not finite");
    require(is_finite(pin.target), name + ": target is not finite");
    require(!pin.rotation || std::isfinite(*pin.rotation), name + ": rotation is not finite");
    require(std::isfinite(pin.depth), name + ": depth is not finite");
    require(std::isfinite(pin.radius) && pin.radius >= 0.0, name + ": radius must be >= 0");
    require(std::isfinite(pin.weight) && pin.weight > 0.0, name + ": weight must be > 0");
  }
}

void require_lines(const std::vector<ControlLine>& lines, std::size_t num_pins) {
  const auto count = static_cast<std::int32_t>(num_pins);
  for (const ControlLine& line : lines) {
    require(line.first >= 0 && line.first < count && line.second >= 0 && line.second < count,
            "a control line names a pin that is not there");
  }
}

PlacedPins place_pins(const PlanarMesh& mesh, const std::vector<Pin>& pins) {
  const auto count = static_cast<Index>(pins.size());
  PlacedPins placed{Points2(count, 2), Points2(count, 2), std::vector<MeshPoint>(pins.size())};
  for (Index m = 0; m < count; ++m) {
    const Pin& pin = pins[at(m)];
    placed.sources.row(m) = pin.source.transpose();
    placed.targets.row(m) = pin.target.transpose();
    std::optional<MeshPoint> place = pin.anchor;
    if (place) {
      require(place->triangle >= 0 && place->triangle < mesh.triangles.rows() &&
                  place->weights.minCoeff() >= 0.0 && std::abs(place->weights.sum() - 1.0) <= 1e-9,
              label(pin, m) + ": its anchor is on no triangle");
    } else {
      place = locate(mesh, pin.source);
    }
    if (!place) continue;
    placed.places[at(m)] = *place;
    placed.sources.row(m) = position(mesh.points, mesh.triangles, *place).transpose();
    // An anchor may be a little beside the source, by the grid of the mesher: the motion counts.
    if (pin.anchor) placed.targets.row(m) += placed.sources.row(m) - pin.source.transpose();
  }
  return placed;
}

double one_place_distance(const PlanarMesh& mesh) { return kOnePlace * box_diagonal(mesh.points); }

ControlSamples sample_controls(const std::vector<Pin>& pins, const Points2& sources,
                               const std::vector<ControlLine>& lines, double spacing) {
  ControlSamples samples;
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

MatrixXd control_distances(const PlanarMesh& mesh, const PlanarGraph& graph, const Points2& sources,
                           const std::vector<MeshPoint>& places, const ControlSamples& samples,
                           WarpMetric metric, const RunControl& run) {
  const auto num_samples = static_cast<Index>(samples.where.size());
  const auto method = metric == WarpMetric::edges ? GeodesicMethod::edges : GeodesicMethod::exact;
  MatrixXd distance(mesh.points.rows(), num_samples);
  parallel_for(0, num_samples, 1, [&](Index first, Index last) {
    for (Index s = first; s < last && !run.cancelled(); ++s) {
      const ControlSample& sample = samples.where[at(s)];
      const RowVector2d place =
          (1.0 - sample.t) * sources.row(sample.first) + sample.t * sources.row(sample.second);
      if (metric == WarpMetric::euclidean) {
        distance.col(s) = (mesh.points.rowwise() - place).rowwise().norm();
        continue;
      }
      const bool is_pin_inside = s < sources.rows() && places[at(s)].triangle >= 0;
      const MeshPoint where =
          is_pin_inside ? places[at(s)] : closest_mesh_point(mesh, place.transpose());
      distance.col(s) = geodesic_distances(mesh, graph, where, method, run);
      if (is_pin_inside) continue;
      distance.col(s).array() +=
          (position(mesh.points, mesh.triangles, where).transpose() - place).norm();
    }
  });
  run.throw_if_cancelled();
  return distance;
}

UnreachedParts find_unreached(const PlanarMesh& mesh, const PlanarGraph& graph,
                              const MatrixXd& distance, bool is_unanchored_allowed) {
  UnreachedParts parts;
  parts.is_still.assign(at(graph.components.count), 1);
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    std::uint8_t& still = parts.is_still[at(graph.components.label[at(v)])];
    for (Index s = 0; still != 0 && s < distance.cols(); ++s) {
      if (std::isfinite(distance(v, s))) still = 0;
    }
  }
  std::vector<std::uint8_t> has_face(parts.is_still.size(), 0);
  for (Index i = 0; i < mesh.triangles.size(); ++i)
    has_face[at(graph.components.label[at(mesh.triangles.data()[i])])] = 1;
  for (std::size_t c = 0; c < parts.is_still.size(); ++c) {
    if (parts.is_still[c] == 0 || has_face[c] == 0) continue;
    parts.still_components.push_back(static_cast<std::int32_t>(c));
    if (is_unanchored_allowed) continue;
    throw AnalysisError("E_COMPONENT_UNANCHORED",
                        "part " + std::to_string(c) + " of the shape has no pin",
                        "give every part of the shape a pin");
  }
  return parts;
}

}  // namespace dupin::detail
