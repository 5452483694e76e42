#include "dupin/registration/residuals.h"

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/registration/scan_samples.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

constexpr Index kGrain = 1024;
constexpr double kNormalCosine = 0.5;  // as ICP pairs samples

void check(const ScanFeatures& moving, const ScanFeatures& fixed, const Pose& pose) {
  if (moving.coarse.rows() == 0 || fixed.coarse.rows() == 0)
    throw InvalidArgument("a scan has no points: describe_scan() makes its features");
  bool is_finite = std::isfinite(pose.scale) && pose.scale > 0.0;
  for (Index i = 0; i < 9; ++i) is_finite = is_finite && std::isfinite(pose.rotation.data()[i]);
  for (Index i = 0; i < 3; ++i) is_finite = is_finite && std::isfinite(pose.translation[i]);
  if (!is_finite) throw InvalidArgument("the pose is not finite, or its scale is not > 0");
}

struct Distances {
  Eigen::VectorXd height;
  std::vector<Contact> contact;
};

// Of the points of `scan`, moved by `pose`, over the patches of `surface`; in its unit.
Distances measure(const SurfaceSamples& surface, const ScanFeatures& scan, const Pose& pose,
                  double sign, double touching, double apart, const RunControl& run) {
  Distances out;
  const Index count = scan.points.rows();
  out.height = Eigen::VectorXd::Zero(count);
  out.contact.assign(static_cast<std::size_t>(count), Contact::none);
  if (surface.grid.empty()) return out;
  parallel_for(0, count, kGrain, [&](Index first, Index last) {
    if (run.cancelled()) return;
    for (Index i = first; i < last; ++i) {
      const RowVector3d place = moved_point(scan.points.row(i), pose);
      const Index at = surface.near(place);
      if (at < 0) continue;
      const auto foot = surface.foot(at, place);
      if (!foot || std::abs(foot->distance) > apart) continue;
      // A normal of zero is unknown: it says nothing against the contact.
      const RowVector3d normal = sign * turned_direction(scan.normals.row(i), pose);
      if (normal.squaredNorm() > 0.0 && normal.dot(foot->normal) < kNormalCosine) continue;
      out.height[i] = foot->distance;
      out.contact[static_cast<std::size_t>(i)] =
          std::abs(foot->distance) <= touching ? Contact::touching : Contact::apart;
    }
  });
  return out;
}

}  // namespace

ScanResiduals compute_residuals(const ScanFeatures& moving, const ScanFeatures& fixed,
                                const Pose& pose, bool is_flipped, RunControl run) {
  check(moving, fixed, pose);
  ScanResiduals result;
  const double sign = is_flipped ? -1.0 : 1.0;
  const detail::ScanSamples samples =
      detail::sample_finely(moving, fixed, pose.scale, run.stage(0.0, 0.6));
  const double noise =
      std::hypot(pose.scale * samples.moving.noise_sigma, samples.fixed.noise_sigma);
  result.touching_bound = 0.15 * samples.fixed.spacing + 3.0 * noise;
  const double apart = std::max(samples.bounds.apart, result.touching_bound);
  if (!run.cancelled()) {
    Distances of_moving =
        measure(samples.fixed, moving, pose, sign, result.touching_bound, apart, run);
    Distances of_fixed = measure(samples.moving, fixed, inverse(pose), sign,
                                 result.touching_bound / pose.scale, apart / pose.scale, run);
    result.moving = std::move(of_moving.height);
    result.moving_contact = std::move(of_moving.contact);
    // Over a surface whose normals point inward, above is below.
    result.fixed = sign * pose.scale * of_fixed.height;
    result.fixed_contact = std::move(of_fixed.contact);
  }
  run.report(1.0);
  if (!run.cancelled()) return result;
  ScanResiduals cancelled;
  cancelled.status = Status::cancelled;
  return cancelled;
}

}  // namespace dupin
