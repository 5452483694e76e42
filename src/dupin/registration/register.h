#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/scan_features.h"

namespace dupin {

/// Why a registration was not accepted.
enum class Refusal {
  none,          ///< accepted
  no_features,   ///< no place of one scan resembles a place of the other
  no_overlap,    ///< the surfaces do not rest on each other in the best pose found
  undetermined,  ///< they do, but slide or turn on each other freely (plane, sphere, cylinder)
  contradicted,  ///< they do in parts, and cross where both are seen
  unsure,        ///< they do, but on too little to be sure
  rotation       ///< the pose turns by more than is allowed
};

/// Options of register_scans().
struct RegistrationOptions {
  bool estimate_scale = true;
  double scale = 1.0;         ///< used where the scale is not estimated, > 0
  double max_rotation = 4.0;  ///< [rad]; > pi: any
  /// false: the pose that the features agree on, as it is. Whether it is accepted, and all that is
  /// told of it, is still judged after ICP.
  bool refine = true;
  double min_confidence = 0.5;  ///< of an accepted pose, in [0, 1]
  bool try_given_pose = true;   ///< also start from `given_pose`: where the scans are
  Pose given_pose;
};

/// How two surfaces lie on each other in one pose.
struct PoseFit {
  double overlap_moving = 0.0;  ///< part of the moving surface that rests on the fixed one
  double overlap_fixed = 0.0;   ///< the other way
  double conflict = 0.0;        ///< of the surface seen by both, the part where they are apart
  double rmse = 0.0;            ///< distance where they rest on each other [mu of fixed]
  double stability = 0.0;       ///< least resistance to any motion over the mean, in [0, 1]
  Eigen::Index num_pairs = 0;
};

/// A pose found, with what speaks for it.
struct PoseCandidate {
  Pose pose;
  bool is_flipped = false;  ///< normals of the moving cloud point to the other side
  PoseFit fit;
  int matches = 0;          ///< features that agree on it
  double confidence = 0.0;  ///< in [0, 1]; orders poses, no measured frequency
};

/// A place of the moving scan and its place on the fixed one.
struct FeaturePair {
  std::int32_t moving = -1;  ///< vertex
  std::int32_t fixed = -1;   ///< vertex
};

/// Result of register_scans().
struct RegistrationResult {
  Status status = Status::ok;
  bool accepted = false;
  Refusal refusal = Refusal::no_features;
  Pose pose;  ///< the best found, accepted or not: moving to fixed
  PoseCandidate best;
  /// Others that fit as well: a symmetric object has several right poses.
  std::vector<PoseCandidate> alternatives;
  std::vector<FeaturePair> correspondences;  ///< features that agree on the pose
  /// Matches of features that do not agree on it, at most 800, the most outstanding first.
  std::vector<FeaturePair> other_matches;
  /// Covariance of rotation vector about `center` [rad], shift of `center` [mu of fixed] and
  /// logarithm of the scale, from what the points deviate from their patches. Only of accepted,
  /// refined poses; else zero, as nothing is known.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the overlap [mu of fixed]
  Eigen::Index num_matches = 0;                      ///< candidates that the features gave
};

/// The similarity that takes the surface of `moving` to that of `fixed`, for partial scans in any
/// pose, with any sampling. Local height maps of the keypoints are matched; each match gives a
/// pose; poses that several matches agree on are refined on the surfaces; the one on which most
/// surface rests and least contradicts wins, and is accepted only if its confidence is high enough
/// and the surfaces resist every motion (docs/methods/registration.md).
/// @throws InvalidArgument if an option is out of range
/// Cost: about that of both scale spaces, and again as much.
RegistrationResult register_scans(const ScanFeatures& moving, const ScanFeatures& fixed,
                                  const RegistrationOptions& options = {}, RunControl run = {});

}  // namespace dupin
