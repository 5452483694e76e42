#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/warp/planar_mesh.h"

namespace dupin {

struct ExteriorPointOptions {
  double detail = 60.0;     ///< beta > 6, at most num_samples: sigma = I / beta (Eq. 7.36 ff.)
  double prominence = 0.0;  ///< least prominence [rad of turning]; 0: from the noise of the contour
  double separation = 0.0;  ///< least arc length between two points [px]; 0: sigma of the kernel
  Eigen::Index num_samples = 512;  ///< I, 64 to 65536
};

struct ExteriorPoint {
  double arc = 0.0;             ///< [px] along the loop from its first corner, in [0, length)
  Eigen::RowVector2d position;  ///< [px] on the loop
  double curvature = 0.0;       ///< [1/px] at sigma, > 0 convex on an outer loop
  /// By how much |curvature| stands above the higher of the two valleys beside it, times the width
  /// of the kernel: about the angle by which a corner turns more than its surroundings [rad].
  double prominence = 0.0;
};

struct ExteriorPoints {
  std::vector<ExteriorPoint> points;  ///< by rising arc
  double sigma_px = 0.0;              ///< standard deviation of the kernel along the contour
  double noise_px = 0.0;              ///< standard deviation of the contour's noise per sample
  double least_prominence = 0.0;      ///< what a point needed [rad]
  double length = 0.0;                ///< of the loop [px]
};

/// The places where the unsigned curvature of a closed contour is locally largest (thesis 7.3.5,
/// automatic exterior control points), as few as the noise of the contour warrants: maxima count
/// when their prominence is above that of the maxima that noise alone would make (once in a hundred
/// contours), and above 0.3 rad; where two are closer than `separation`, the more prominent stays.
/// A circle has none. The set is the same for every first corner, direction, place, size and
/// rotation of the loop, up to rounding.
/// @param loop at least three corners, finite, not all at one place
/// @throws InvalidArgument for a bad loop or an option outside its range
/// Cost: O(corners + I^2 / detail).
ExteriorPoints find_exterior_points(const Points2& loop, const ExteriorPointOptions& options = {});

/// Standard deviation of independent noise across a contour, per sample [px], from how samples
/// deviate from a smooth curve through their neighbours; robust against corners, 0 for polygons
/// with few of them. @param samples evenly spaced, at least 16. @throws InvalidArgument. Cost: O(I
/// log I).
double estimate_contour_noise(const Points2& samples);

}  // namespace dupin
