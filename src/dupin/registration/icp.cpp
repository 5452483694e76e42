#include "dupin/registration/icp.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/registration/sample_pairs.h"

namespace dupin {
namespace {

using detail::SurfacePair;
using Eigen::Index;
using Eigen::RowVector3d;
using Eigen::Vector3d;
using std::size_t;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr double kNormalCosine = 0.5;
// Over the usual one: what the residuals of a patch cannot tell, such as the other sampling.
constexpr double kLeastVariance = 0.05;

void check(const Pose& start, const IcpOptions& options) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw InvalidArgument(std::string(what));
  };
  require(std::isfinite(start.scale) && start.scale > 0.0, "the scale of the start is not > 0");
  for (Index i = 0; i < 9; ++i)
    require(std::isfinite(start.rotation.data()[i]), "the start is not finite");
  for (Index i = 0; i < 3; ++i)
    require(std::isfinite(start.translation[i]), "the start is not finite");
  for (const double distance : {options.start_distance, options.last_distance})
    require(std::isfinite(distance) && distance >= 0.0, "a distance must be finite and >= 0");
  require(options.max_iterations >= 1, "max_iterations is below 1");
  require(options.every >= 1, "every is below 1");
  require(options.tolerance > 0.0, "tolerance must be > 0");
}

// Samples of `other` (moved by `pose`) over the patches of `surface`.
template <class Add>
void pair_with(const SurfaceSamples& surface, const SurfaceSamples& other, const Pose& pose,
               double sign, double bound, Index every, const Add& add) {
  const double scale = pose.scale * pose.scale;
  const double usual =
      scale * other.noise_sigma * other.noise_sigma + surface.noise_sigma * surface.noise_sigma;
  detail::visit_near_samples(
      surface, other, pose, every,
      [&](Index at, Index i, const RowVector3d& place, const RowVector3d& normal) {
        const auto foot = surface.foot(at, place);
        if (!foot || std::abs(foot->distance) > bound) return;
        if (sign * normal.dot(foot->normal) < kNormalCosine) return;
        const double variance = scale * other.variance[static_cast<size_t>(i)] +
                                surface.variance[static_cast<size_t>(at)];
        add(place, *foot, usual > 0.0 ? 1.0 / (variance / usual + kLeastVariance) : 1.0);
      });
}

// 1.4826 times the median magnitude: the standard deviation of the pairs that fit, of weight 1.
double spread_of(const std::vector<SurfacePair>& pairs) {
  std::vector<double> size(pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i)
    size[i] = std::sqrt(pairs[i].weight) * std::abs(pairs[i].distance);
  const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2);
  std::nth_element(size.begin(), middle, size.end());
  return 1.4826 * *middle;
}

Vector3d center_of(const std::vector<SurfacePair>& pairs) {
  RowVector3d sum = RowVector3d::Zero();
  for (const SurfacePair& pair : pairs) sum += pair.point;
  return sum.transpose() / static_cast<double>(pairs.size());
}

// Derivative of the distance along the normal by the seven parameters, lengths in `extent`.
Vector7 gradient_of(const SurfacePair& pair, const Vector3d& center, double extent) {
  const Vector3d n = pair.normal.transpose();
  const Vector3d arm = (pair.point.transpose() - center) / extent;
  Vector7 gradient;
  gradient << arm.cross(n), n, arm.dot(n);
  return gradient;
}

struct Step {
  Pose pose;
  double size = 0.0;  // largest displacement that it makes at one extent [mu of fixed]
};

// One Gauss-Newton step with Tukey weights.
Step solve(const std::vector<SurfacePair>& pairs, const Pose& pose, const Vector3d& center,
           double extent, double width, bool with_scale) {
  Matrix7 normal_matrix = Matrix7::Zero();
  Vector7 right = Vector7::Zero();
  for (const SurfacePair& pair : pairs) {
    const double u = std::sqrt(pair.weight) * pair.distance / width;
    if (std::abs(u) >= 1.0) continue;
    const double weight = pair.weight * (1.0 - u * u) * (1.0 - u * u);
    const Vector7 g = gradient_of(pair, center, extent);
    normal_matrix += weight * g * g.transpose();
    right -= weight * pair.distance * g;
  }
  // What the surfaces do not resist stays as it is: a ridge far below what they do resist.
  const double ridge = 1e-9 * normal_matrix.trace() + 1e-300;
  normal_matrix.diagonal().array() += ridge;
  if (!with_scale) {
    normal_matrix.row(6).setZero();
    normal_matrix.col(6).setZero();
    normal_matrix(6, 6) = 1.0;
    right[6] = 0.0;
  }
  const Vector7 x = normal_matrix.ldlt().solve(right) / extent;
  Pose change;
  change.rotation = rotation_of(x.head<3>());
  change.scale = std::exp(std::clamp(x[6], -0.1, 0.1));
  change.translation =
      center + extent * x.segment<3>(3) - change.scale * (change.rotation * center);
  Step step;
  step.pose = compose(change, pose);
  step.pose.rotation = nearest_rotation(step.pose.rotation);
  step.size = extent * (x.head<3>().norm() + x.segment<3>(3).norm() + std::abs(x[6]));
  return step;
}

}  // namespace

namespace detail {

std::vector<SurfacePair> find_pairs(const SurfaceSamples& moving, const SurfaceSamples& fixed,
                                    const Pose& pose, bool is_flipped, double bound, Index every) {
  std::vector<SurfacePair> pairs;
  const double sign = is_flipped ? -1.0 : 1.0;
  pair_with(fixed, moving, pose, sign, bound, every,
            [&](const RowVector3d& point, const PatchFoot& foot, double weight) {
              pairs.push_back({point, foot.normal, foot.distance, weight});
            });
  const Pose back = inverse(pose);
  pair_with(moving, fixed, back, sign, bound / pose.scale, every,
            [&](const RowVector3d& point, const PatchFoot& foot, double weight) {
              // Seen from the fixed side, the moving surface lies as far below.
              const RowVector3d place = moved_point(point, pose);
              const RowVector3d normal = sign * turned_direction(foot.normal, pose);
              const double distance = -sign * pose.scale * foot.distance;
              pairs.push_back({place + distance * normal, normal, distance, weight});
            });
  return pairs;
}

}  // namespace detail

IcpResult refine_pose(const SurfaceSamples& moving, const SurfaceSamples& fixed, const Pose& start,
                      const IcpOptions& options, RunControl run) {
  check(start, options);
  IcpResult result;
  result.pose = start;
  const double spacing = std::max(fixed.spacing, start.scale * moving.spacing);
  double bound = options.start_distance > 0.0 ? options.start_distance : 4.0 * spacing;
  const double last_bound =
      std::min(bound, options.last_distance > 0.0 ? options.last_distance : 1.5 * spacing);
  result.status = Status::not_converged;
  std::vector<SurfacePair> pairs;
  for (int it = 0; it < options.max_iterations; ++it) {
    if (run.cancelled()) {
      result.status = Status::cancelled;
      return result;
    }
    pairs =
        detail::find_pairs(moving, fixed, result.pose, options.is_flipped, bound, options.every);
    result.iterations = it + 1;
    if (pairs.size() < 12) break;
    result.center = center_of(pairs);
    double moment = 0.0;
    for (const SurfacePair& pair : pairs)
      moment += (pair.point.transpose() - result.center).squaredNorm();
    result.extent = std::sqrt(moment / static_cast<double>(pairs.size()));
    if (!(result.extent > 0.0)) break;
    // Never narrower than rounding and the patches themselves can tell.
    const double width = std::max(4.685 * spread_of(pairs), 1e-6 * spacing);
    const Step step =
        solve(pairs, result.pose, result.center, result.extent, width, options.with_scale);
    result.pose = step.pose;
    run.report(static_cast<double>(it + 1) / options.max_iterations);
    if (bound <= last_bound && step.size <= options.tolerance * spacing) {
      result.status = Status::ok;
      break;
    }
    bound = std::max(last_bound, 0.7 * bound);
  }
  pairs = detail::find_pairs(moving, fixed, result.pose, options.is_flipped, bound, options.every);
  result.num_pairs = static_cast<Index>(pairs.size());
  if (pairs.empty()) return result;
  double sum = 0.0;
  for (const SurfacePair& pair : pairs) {
    sum += pair.distance * pair.distance;
    if (!(result.extent > 0.0)) continue;
    Vector7 g = gradient_of(pair, result.center, result.extent);
    if (!options.with_scale) g[6] = 0.0;
    result.information += g * g.transpose() / static_cast<double>(pairs.size());
  }
  result.rmse = std::sqrt(sum / static_cast<double>(pairs.size()));
  return result;
}

}  // namespace dupin
