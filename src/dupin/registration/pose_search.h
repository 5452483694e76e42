#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/registration/height_maps.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/scan_features.h"

namespace dupin::detail {

/// A pose and the matches that agree on it.
struct PoseHypothesis {
  Pose pose;
  bool is_flipped = false;
  double support = 0.0;               ///< sum of the weights of its matches
  std::vector<std::int32_t> members;  ///< matches
};

/// Options of search_poses().
struct PoseSearchOptions {
  double position_error = 0.0;  ///< of an anchor against its counterpart [mu of fixed]
  bool with_scale = false;
  double scale = 1.0;  ///< used where with_scale is false
  int max_hypotheses = 200;
};

/// Poses that matches of local frames agree on, best supported first, distinct. Two matches are
/// consistent if distances, normals and whole frames agree; each seed grows by its partners of
/// second order, as in robust_pose().
std::vector<PoseHypothesis> search_poses(const ScanFeatures& moving, const ScanFeatures& fixed,
                                         const std::vector<FeatureMatch>& matches,
                                         const PoseSearchOptions& options, const RunControl& run);

}  // namespace dupin::detail
