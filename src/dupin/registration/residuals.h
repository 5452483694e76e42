#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/scan_features.h"

namespace dupin {

/// How a point of one scan lies against the other scan.
enum class Contact : std::uint8_t {
  none,      ///< the other scan has no surface there, or one that faces another way
  touching,  ///< rests on it, as far as noise and sampling can tell
  apart      ///< lies over it, but farther away
};

/// Distances of the points of two scans from the smooth surface of the other one.
struct ScanResiduals {
  Status status = Status::ok;  ///< cancelled: everything else is empty
  /// #V of the moving scan: height of the moved point over the fixed surface, > 0 on its outer
  /// side; 0 where there is no contact. [mu of fixed]
  Eigen::VectorXd moving;
  Eigen::VectorXd fixed;  ///< #V of the fixed scan over the moved surface [mu of fixed]
  std::vector<Contact> moving_contact;  ///< #V of the moving scan
  std::vector<Contact> fixed_contact;   ///< #V of the fixed scan
  double touching_bound = 0.0;  ///< touching points lie within it: three standard deviations of the
                                ///< noise of both scans and .15 of a patch [mu of fixed]
};

/// Both surfaces are fitted with the patches that refine the pose; every point is measured against
/// the patch that it lies over. The distance of a single point has its noise in it, unlike the rmse
/// of PoseFit, which is that of patches. `is_flipped` as in PoseCandidate.
/// @throws InvalidArgument if the pose is not finite or its scale not > 0, or a scan has no points
/// Cost: O(V log V) of both.
ScanResiduals compute_residuals(const ScanFeatures& moving, const ScanFeatures& fixed,
                                const Pose& pose, bool is_flipped = false, RunControl run = {});

}  // namespace dupin
