#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"

namespace dupin {

/// Options of robust_pose().
struct RobustPoseOptions {
  /// Largest distance between a moved point and its place, where the match is right, > 0 [mu of
  /// `to`].
  double noise_bound = 0.0;
  bool with_scale = false;
  int seeds = 64;  ///< matches from which a consistent set is grown, >= 1
};

/// A pose that many matches agree on.
struct RobustPose {
  Status status = Status::ok;
  bool is_found = false;  ///< at least four matches agree on it, or three of at most ten
  Pose pose;
  std::vector<std::int32_t> inliers;  ///< matches within noise_bound of their place, ascending
};

/// Pose of matches most of which may be wrong (95 % of a thousand): matches i and j are consistent
/// if their points are as far apart as their places; seeds are the matches whose consistent
/// partners are consistent with each other most often (second-order consistency: Chen et al.,
/// "SC2-PCR", CVPR 2022); from each seed grows a pose by repeated weighted fits of the matches
/// within the bound; that with most matches wins. An unknown scale is first voted for by the ratios
/// of the distances (Yang et al., "TEASER", T-RO 2021).
/// @throws InvalidArgument if sizes differ, a coordinate is not finite or beyond 1e150 or an option
///   is out of range
/// Cost: O(N^2) time and N^2 / 8 bytes; more than 8192 matches are refused (E_TOO_LARGE).
RobustPose robust_pose(const Points& from, const Points& to, const RobustPoseOptions& options,
                       RunControl run = {});

}  // namespace dupin
