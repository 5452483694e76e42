#include "dupin/warp/pin_transfer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::VectorXd;

constexpr Index kSamples = 512;
constexpr double kTolerance = 0.03;  // of the height
// Deviation of a place: a floor for the place of corners, and shares of the way to the next pair.
constexpr double kFloor = 0.005;  // of the height
constexpr double kBridge = 0.15;
constexpr double kStretch = 0.25;

double cross(const RowVector2d& a, const RowVector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Samples of the first contour with all that the match says about them.
struct Boundary {
  Points2 from;
  Points2 to;
  VectorXd posterior;
  VectorXd variance;  // [px^2] of the second picture, along the contour
  double spacing = 0.0;
};

Boundary boundary_of(const Points2& from, const Points2& to, const ContourMatch& match,
                     double height) {
  const ResampledLoop samples = resample_loop(from, kSamples);
  Boundary boundary;
  boundary.from = samples.points;
  boundary.spacing = samples.spacing;
  boundary.to.resize(kSamples, 2);
  boundary.posterior.resize(kSamples);
  boundary.variance.resize(kSamples);
  const double overall = match.length_to / match.length_from;
  for (Index i = 0; i < kSamples; ++i) {
    const double arc = samples.arcs(i);
    boundary.to.row(i) = point_at_arc(to, map_arc(match, arc));
    boundary.posterior(i) = confidence_at(match, arc);
    const MatchedRun run = matched_run(match, arc);
    const double bridge = run.before + run.after > 0.0
                              ? run.before * run.after / (run.before + run.after) * overall
                              : 0.0;
    const double stretch = std::abs(std::log(std::max(run.stretch, 1e-6) / overall));
    const double deviation = kBridge * bridge + kStretch * bridge * std::min(1.0, stretch);
    boundary.variance(i) =
        deviation * deviation + run.deviation * run.deviation + kFloor * kFloor * height * height;
  }
  return boundary;
}

// Mean value coordinates of `place` with respect to the polygon: tan of half angles over distances.
// A place on the polygon gets its two corners alone.
VectorXd mean_value_weights(const Points2& polygon, const RowVector2d& place) {
  const Index count = polygon.rows();
  const Points2 arms = polygon.rowwise() - place;
  const VectorXd lengths = arms.rowwise().norm();
  VectorXd weights = VectorXd::Zero(count);
  for (Index i = 0; i < count; ++i) {
    const Index next = (i + 1) % count;
    const double side = (arms.row(next) - arms.row(i)).norm();
    const double area = cross(arms.row(i), arms.row(next));
    const double dot = arms.row(i).dot(arms.row(next));
    const bool is_on = dot <= 0.0 && std::abs(area) <= 1e-9 * side * side;
    if (is_on || lengths(i) <= 1e-12 * side) {
      weights.setZero();
      const double along = lengths(i) + lengths(next);
      const double t = along > 0.0 ? lengths(i) / along : 0.0;
      weights(i) = 1.0 - t;
      weights(next) += t;
      return weights;
    }
  }
  VectorXd half(count);  // tan(angle / 2) seen between i and i + 1
  for (Index i = 0; i < count; ++i) {
    const Index next = (i + 1) % count;
    const double dot = arms.row(i).dot(arms.row(next));
    half(i) = cross(arms.row(i), arms.row(next)) / (lengths(i) * lengths(next) + dot);
  }
  for (Index i = 0; i < count; ++i)
    weights(i) = (half((i + count - 1) % count) + half(i)) / lengths(i);
  return weights / weights.sum();
}

// Samples near the place say most about it.
VectorXd nearness(const Points2& polygon, const RowVector2d& place, double spacing) {
  VectorXd weights(polygon.rows());
  for (Index i = 0; i < polygon.rows(); ++i) {
    const double distance = (polygon.row(i) - place).norm() + spacing;
    weights(i) = 1.0 / (distance * distance);
  }
  return weights / weights.sum();
}

double height_of(const Points2& loop) { return loop.col(1).maxCoeff() - loop.col(1).minCoeff(); }

void require_match(const Points2& from, const Points2& to, const ContourMatch& match) {
  const auto agrees = [](double a, double b) { return std::abs(a - b) <= 1e-9 * (a + b); };
  if (match.keys.empty() || !agrees(loop_length(from), match.length_from) ||
      !agrees(loop_length(to), match.length_to))
    throw InvalidArgument("the match is not of these two loops");
}

}  // namespace

TransferredPlaces transfer_places(const Points2& from, const Points2& places, const Points2& to,
                                  const ContourMatch& match) {
  require_match(from, to, match);
  for (Index i = 0; i < places.rows(); ++i) {
    if (!std::isfinite(places(i, 0)) || !std::isfinite(places(i, 1)))
      throw InvalidArgument("place " + std::to_string(i) + " is not finite");
  }
  const double height = height_of(to);
  const Boundary boundary = boundary_of(from, to, match, height);
  TransferredPlaces result;
  result.places.resize(places.rows(), 2);
  result.deviation.resize(places.rows());
  result.confidence.resize(places.rows());
  for (Index p = 0; p < places.rows(); ++p) {
    const VectorXd weights = mean_value_weights(boundary.from, places.row(p));
    result.places.row(p) = weights.transpose() * boundary.to;
    const VectorXd near = nearness(boundary.from, places.row(p), boundary.spacing);
    result.deviation(p) = std::sqrt(near.dot(boundary.variance));
    result.confidence(p) =
        near.dot(boundary.posterior) *
        std::erf(kTolerance * height / (std::numbers::sqrt2 * result.deviation(p)));
  }
  return result;
}

TransferredPins transfer_pins(const Points2& from, const std::vector<WarpPin>& pins,
                              const Points2& to, const ContourMatch& match, TargetRule rule) {
  Points2 sources(static_cast<Index>(pins.size()), 2);
  for (Index i = 0; i < sources.rows(); ++i)
    sources.row(i) = pins[static_cast<std::size_t>(i)].source;
  const TransferredPlaces carried = transfer_places(from, sources, to, match);
  const double ratio = match.length_to / match.length_from;
  TransferredPins result;
  result.pins = pins;
  result.confidence = carried.confidence;
  for (std::size_t i = 0; i < pins.size(); ++i) {
    WarpPin& pin = result.pins[i];
    pin.source = carried.places.row(static_cast<Index>(i));
    if (rule == TargetRule::relative) {
      RowVector2d way = ratio * (pins[i].target - pins[i].source);
      if (match.is_mirrored) way.x() = -way.x();
      pin.target = pin.source + way;
    }
    pin.radius *= ratio;
    if (match.is_mirrored && pin.rotation_deg) pin.rotation_deg = -*pin.rotation_deg;
  }
  return result;
}

}  // namespace dupin
