#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/register.h"

namespace dupin {

/// Options of register_all().
struct RegisterAllOptions {
  double min_confidence = 0.5;  ///< of the pose of a pair, in [0, 1]
  int max_iterations = 30;      ///< of the joint refinement, >= 0; 0: none
};

/// What one pair of scans says.
struct ScanPairResult {
  std::int32_t moving = -1;
  std::int32_t fixed = -1;
  Pose pose;  ///< moving to fixed
  PoseFit fit;
  double confidence = 0.0;
  bool is_used = false;  ///< agrees with the loops it is part of
  /// How far the pose of the pair is from that which the poses of all scans say, where both scans
  /// have one: turn and shift of the middle of the moving scan.
  std::optional<double> loop_turn;   ///< [rad]
  std::optional<double> loop_shift;  ///< [mu]
};

/// A pair of scans that was not accepted.
struct RefusedPair {
  std::int32_t moving = -1;
  std::int32_t fixed = -1;
  Refusal refusal = Refusal::no_features;
};

/// Result of register_all().
struct RegisterAllResult {
  Status status = Status::ok;
  /// #N: scan to the frame of scan `reference`; nothing where the scan found no place.
  std::vector<std::optional<Pose>> poses;
  std::int32_t reference = -1;        ///< the first scan of the largest set that holds together
  std::vector<ScanPairResult> pairs;  ///< accepted pairs, moving < fixed
  std::vector<RefusedPair> refused;   ///< all others, moving < fixed
  double rmse = 0.0;                  ///< distance of all used pairs after the refinement [mu]
};

/// Brings scans of one object, in one unit, into one frame: all pairs are registered; pairs that
/// close triangles without error vouch for each other; a spanning tree of the best of them gives
/// first poses; pairs that contradict it are dropped; then all poses are refined together, every
/// used pair pulling at both of its scans (point to patch, Tukey weights). The largest connected
/// set is kept.
/// @throws InvalidArgument if an option is out of range or there are fewer than two scans
/// Cost: N (N - 1) / 2 registrations.
RegisterAllResult register_all(const std::vector<ScanFeatures>& scans,
                               const RegisterAllOptions& options = {}, RunControl run = {});

}  // namespace dupin
