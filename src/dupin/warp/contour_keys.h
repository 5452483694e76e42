#pragma once

#include <array>
#include <vector>

#include "dupin/warp/contour_match.h"

namespace dupin::detail {

/// A key point and what it is recognised by.
struct ContourKey {
  double arc = 0.0;                 ///< [px]
  double share = 0.0;               ///< of the length, along the resampled contour
  std::array<double, 3> turning{};  ///< signed curvature times kernel width, at three scales [rad]
  double heading = 0.0;             ///< direction of the tangent, unwrapped along the loop [rad]
  double prominence = 0.0;          ///< [rad]
  double deviation = 0.0;           ///< of its place along the contour [px]
};

/// Key points of a loop of positive area by rising arc. At most options.max_keys.
std::vector<ContourKey> contour_keys(const Points2& loop, const ContourMatchOptions& options);

/// Pairs (index into a, index into b) of the best cyclic alignment, with posteriors.
struct KeyPair {
  int a = 0;
  int b = 0;
  double posterior = 0.0;
};
struct KeyAlignment {
  std::vector<KeyPair> pairs;
  double cost = 0.0;
};
KeyAlignment align_keys(const std::vector<ContourKey>& a, const std::vector<ContourKey>& b,
                        double upright, const RunControl& run);

}  // namespace dupin::detail
