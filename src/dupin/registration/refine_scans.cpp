#include "dupin/registration/refine_scans.h"

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/registration/icp.h"
#include "dupin/registration/scan_samples.h"

namespace dupin {
namespace {

RefinedPose refine_side(const detail::ScanSamples& coarse, const detail::ScanSamples& fine,
                        const Pose& start, bool is_flipped, const RunControl& run) {
  IcpOptions options;
  options.is_flipped = is_flipped;
  options.start_distance = 3.0 * coarse.fixed.spacing;
  options.tolerance = 1e-2;
  const IcpResult rough =
      refine_pose(coarse.moving, coarse.fixed, start, options, run.stage(0.0, 0.5));
  options.start_distance = 2.0 * fine.fixed.spacing;
  options.tolerance = IcpOptions().tolerance;
  const IcpResult refined =
      refine_pose(fine.moving, fine.fixed, rough.pose, options, run.stage(0.5, 1.0));
  RefinedPose result;
  result.is_flipped = is_flipped;
  result.num_pairs = refined.num_pairs;
  result.pose = refined.num_pairs > 0 ? refined.pose : start;
  return result;
}

}  // namespace

RefinedPose refine_scans(const ScanFeatures& moving, const ScanFeatures& fixed, const Pose& start,
                         RunControl run) {
  if (moving.coarse.rows() == 0 || fixed.coarse.rows() == 0)
    throw InvalidArgument("a scan has no points: describe_scan() makes its features");
  if (!std::isfinite(start.scale) || !(start.scale > 0.0))
    throw InvalidArgument("the scale of the start is not > 0");
  const detail::ScanSamples coarse =
      detail::sample_coarsely(moving, fixed, start.scale, run.stage(0.0, 0.2));
  const detail::ScanSamples fine =
      detail::sample_finely(moving, fixed, start.scale, run.stage(0.2, 0.4));
  RefinedPose best;
  if (!run.cancelled()) best = refine_side(coarse, fine, start, false, run.stage(0.4, 0.7));
  if (!run.cancelled() && !(moving.has_sides && fixed.has_sides)) {
    const RefinedPose other = refine_side(coarse, fine, start, true, run.stage(0.7, 1.0));
    if (other.num_pairs > best.num_pairs) best = other;
  }
  if (run.cancelled()) {
    best = RefinedPose();
    best.pose = start;
    best.status = Status::cancelled;
  }
  return best;
}

}  // namespace dupin
