#include "dupin/registration/thesis_features.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/scale_space.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using Eigen::VectorXd;

void check(const ThesisFeatureOptions& options) {
  validate(options.schedule);
  if (!(options.min_contrast >= 0.0)) throw InvalidArgument("min_contrast must be >= 0");
  if (options.max_features < 0) throw InvalidArgument("max_features must be >= 0");
  if (!std::isfinite(options.neighborhood) || !(options.neighborhood > 0.0)) {
    throw InvalidArgument("neighborhood must be finite and > 0");
  }
}

// The vertices within `radius` of `center` that can be reached through such vertices, ascending.
std::vector<std::int32_t> connected_ball(const SurfaceGraph& graph, std::int32_t center,
                                         double radius) {
  std::vector<std::int32_t> ball{center};
  std::vector<std::int32_t> front{center};
  const Eigen::RowVector3d middle = graph.points.row(center);
  while (!front.empty()) {
    std::vector<std::int32_t> next;
    for (const std::int32_t v : front) {
      for (const std::int32_t* n = graph.topology.ring.begin(v); n != graph.topology.ring.end(v);
           ++n) {
        if ((graph.points.row(*n) - middle).norm() <= radius) next.push_back(*n);
      }
    }
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
    front.clear();
    std::set_difference(next.begin(), next.end(), ball.begin(), ball.end(),
                        std::back_inserter(front));
    std::vector<std::int32_t> merged;
    merged.reserve(ball.size() + front.size());
    std::merge(ball.begin(), ball.end(), front.begin(), front.end(), std::back_inserter(merged));
    ball.swap(merged);
  }
  return ball;
}

// Gradient of a signal at a vertex by the simple weighted differences of 5.5.3: those along the
// edges in the tangent plane, each over its squared length. Exact where the ring is even.
RowVector3d gradient_at(const SurfaceGraph& graph, const LevelMatrix& levels, Index level,
                        std::int32_t v) {
  const RowVector3d normal = graph.normals.row(v);
  RowVector3d sum = RowVector3d::Zero();
  double count = 0.0;
  for (const std::int32_t* n = graph.topology.ring.begin(v); n != graph.topology.ring.end(v); ++n) {
    RowVector3d edge = graph.points.row(*n) - graph.points.row(v);
    edge -= edge.dot(normal) * normal;
    const double squared = edge.squaredNorm();
    if (!(squared > 0.0)) continue;
    sum += (levels(level, *n) - levels(level, v)) / squared * edge;
    count += 1.0;
  }
  return count > 0.0 ? RowVector3d(2.0 / count * sum) : sum;
}

Eigen::Matrix3d frame_of(const SurfaceGraph& graph, const ScaleSpace& space,
                         const ThesisFeature& feature, const std::vector<std::int32_t>& ball,
                         FrameRule rule) {
  const Index level = feature.keypoint.level;
  const RowVector3d normal = graph.normals.row(feature.keypoint.vertex);
  Points rows(static_cast<Index>(ball.size()), 3);
  VectorXd weights(rows.rows());
  for (Index i = 0; i < rows.rows(); ++i) {
    const std::int32_t v = ball[static_cast<std::size_t>(i)];
    const double away = (graph.points.row(v) - feature.position).norm() / feature.radius;
    rows.row(i) = rule == FrameRule::gradient ? gradient_at(graph, space.levels, level, v)
                                              : RowVector3d(graph.points.row(v));
    weights[i] = rule == FrameRule::loc       ? space.loc(level, v)
                 : rule == FrameRule::uniform ? 1.0
                                              : std::exp(-2.0 * away * away);
  }
  return rule == FrameRule::gradient ? gradient_frame(rows, weights, normal)
                                     : principal_frame(rows, weights, normal);
}

ThesisFeature describe(const SurfaceGraph& graph, const ScaleSpace& space, double factor,
                       const Keypoint& keypoint, const ThesisFeatureOptions& options) {
  ThesisFeature feature;
  feature.keypoint = keypoint;
  feature.position = graph.points.row(keypoint.vertex);
  feature.radius = options.neighborhood * keypoint.radius;
  const std::vector<std::int32_t> ball = connected_ball(graph, keypoint.vertex, feature.radius);
  feature.values.reserve(ball.size());
  for (const std::int32_t v : ball) {
    const double value = options.value == DescriptorValue::loc
                             ? factor * space.loc(keypoint.level, v)
                             : space.levels(keypoint.level, v);
    feature.values.push_back(value * keypoint.radius);
  }
  std::sort(feature.values.begin(), feature.values.end());
  feature.frame = frame_of(graph, space, feature, ball, options.frame);
  return feature;
}

void require_frame_input(const Points& rows, const VectorXd& weights) {
  if (rows.rows() != weights.size()) throw InvalidArgument("rows and weights differ in size");
  const auto is_finite = [](double x) { return std::isfinite(x); };
  if (!std::all_of(rows.data(), rows.data() + rows.size(), is_finite) ||
      !std::all_of(weights.data(), weights.data() + weights.size(), is_finite)) {
    throw InvalidArgument("points, gradients and weights must be finite");
  }
}

}  // namespace

Eigen::Matrix3d gradient_frame(const Points& gradients, const VectorXd& weights,
                               const RowVector3d& normal) {
  require_frame_input(gradients, weights);
  const RowVector3d n = normal.norm() > 0.0 ? normal.normalized() : RowVector3d::UnitZ().eval();
  RowVector3d along = weights.transpose() * gradients;
  along -= along.dot(n) * n;
  const double size = weights.cwiseAbs().dot(gradients.rowwise().norm());
  // What rounding leaves of gradients that cancel is no direction.
  if (!(along.norm() > 1e-12 * size)) along = n.unitOrthogonal();
  Eigen::Matrix3d frame;
  frame.col(0) = along.normalized().transpose();
  frame.col(2) = n.transpose();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

Eigen::Matrix3d principal_frame(const Points& points, const VectorXd& weights,
                                const Eigen::RowVector3d& normal) {
  require_frame_input(points, weights);
  if (points.rows() == 0) return Eigen::Matrix3d::Identity();
  VectorXd share = weights.cwiseAbs();
  const double largest = share.maxCoeff();
  share = largest > 0.0 ? VectorXd(share / largest) : VectorXd::Ones(share.size());
  share /= share.sum();
  const Eigen::RowVector3d mean = share.transpose() * points;
  Points centered = points.rowwise() - mean;
  const double size = centered.cwiseAbs().maxCoeff();
  if (size > 0.0) centered /= size;
  const Eigen::Matrix3d covariance =
      centered.transpose() * (centered.array().colwise() * share.array()).matrix();
  const SymmetricEigen3 eigen = eigen_symmetric(covariance);
  Index along = 0;
  (normal * eigen.vectors).cwiseAbs().maxCoeff(&along);
  Eigen::Matrix3d frame;
  frame.col(0) = eigen.vectors.col(along == 2 ? 1 : 2);
  frame.col(2) = eigen.vectors.col(along);
  if (normal.dot(frame.col(2)) < 0.0) frame.col(2) *= -1.0;
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

VectorXd loc_histogram(const std::vector<double>& values, double range, int bins) {
  if (bins < 1) throw InvalidArgument("bins must be >= 1");
  if (!std::isfinite(range) || !(range > 0.0)) {
    throw InvalidArgument("range must be finite and > 0");
  }
  VectorXd histogram = VectorXd::Zero(bins);
  if (values.empty()) return histogram;
  const double width = 2.0 / bins;
  for (const double value : values) {
    const double place = (std::clamp(value / range, -1.0, 1.0) + 1.0) / width;
    histogram[std::min<Index>(static_cast<Index>(place), bins - 1)] += 1.0;
  }
  histogram /= static_cast<double>(values.size());
  for (Index b = 0; b < histogram.size(); ++b) {
    histogram[b] *= (static_cast<double>(b) + 0.5) * width - 1.0;
  }
  return histogram;
}

ThesisFeatures describe_by_thesis(const SurfaceGraph& graph, const ThesisFeatureOptions& options,
                                  RunControl run) {
  check(options);
  ThesisFeatures result;
  const auto cancelled = [&] {
    if (run.cancelled()) result = {Status::cancelled, {}};
    return run.cancelled();
  };
  if (graph.points.rows() == 0) return result;
  const VectorXd signal = compute_signal(graph, options.signal, 6, run);
  if (cancelled()) return result;
  ScaleSpaceOptions stack;
  stack.schedule = options.schedule;
  stack.want_levels =
      options.frame == FrameRule::gradient || options.value == DescriptorValue::signal;
  const ScaleSpace space = compute_scale_space(
      umbrella_operator(graph.topology.ring, graph.is_mesh() ? &graph.topology : nullptr), signal,
      stack, run.stage(0.0, 0.8));
  if (cancelled()) return result;
  KeypointOptions keypoints;
  keypoints.rule = options.rule;
  keypoints.min_contrast = options.min_contrast;
  keypoints.contrast_power = options.signal == Signal::gauss ? 2 : 1;
  keypoints.top = options.max_features;
  keypoints.level = std::clamp(keypoints.level, 1, std::max(1, options.schedule.num_levels - 2));
  const KeypointSet set =
      find_keypoints(graph, space.loc, options.schedule, signal.cwiseAbs().maxCoeff(), keypoints,
                     run.stage(0.8, 0.9));
  if (cancelled()) return result;
  const VectorXd factors = response_factors(options.schedule, ScaleMeasure::exact);
  result.features.resize(set.keypoints.size());
  parallel_for(0, static_cast<Index>(set.keypoints.size()), 1, [&](Index first, Index last) {
    for (Index i = first; i < last && !run.cancelled(); ++i) {
      const Keypoint& keypoint = set.keypoints[static_cast<std::size_t>(i)];
      result.features[static_cast<std::size_t>(i)] =
          describe(graph, space, factors[keypoint.level], keypoint, options);
    }
  });
  if (cancelled()) return result;
  run.report(1.0);
  return result;
}

}  // namespace dupin
