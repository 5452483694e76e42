#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/scan_features.h"

namespace dupin {

/// A pose from elsewhere, refined on the surfaces.
struct RefinedPose {
  Status status = Status::ok;
  Pose pose;                ///< the start itself where the surfaces do not meet
  bool is_flipped = false;  ///< normals of the moving cloud point to the other side
  Eigen::Index num_pairs =
      0;  ///< samples of both sides that rest on the other; 0: they do not meet
};

/// refine_pose() of two scans from `start`, first on coarse, then on fine samples, as
/// register_scans() ends. Where a cloud does not know its outer side, both are tried and the one
/// with more pairs stays. The scale stays that of `start`.
/// @throws InvalidArgument as refine_pose(), or if a scan has no points
/// Cost: O(V log V) of both, and some dozen steps on thousands of samples.
RefinedPose refine_scans(const ScanFeatures& moving, const ScanFeatures& fixed, const Pose& start,
                         RunControl run = {});

}  // namespace dupin
