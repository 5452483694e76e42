#pragma once

#include <Eigen/Core>

#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// A closed polyline by equal steps along itself.
struct ResampledLoop {
  Points2 points;        ///< I by 2 [px]
  Eigen::VectorXd arcs;  ///< I, of each point from the first corner of the loop [px], rising from 0
  double length = 0.0;   ///< of the polyline [px]
  double spacing = 0.0;  ///< length / I [px]
};

/// `count` points of `loop` at equal steps of arc length, the first at its first corner.
/// @param loop  at least three corners, finite, not all at one place
/// @param count 8 to 65536
/// @throws InvalidArgument otherwise. Cost: O(corners + count).
ResampledLoop resample_loop(const Points2& loop, Eigen::Index count);

/// As above, but equal steps of the arc length that the loop has once smoothed by a Gaussian of
/// `sigma` samples: noise makes a polyline longer, and unevenly so. The points lie on `loop`, the
/// length is that of the loop without the smoothed-off noise.
/// @param sigma 0 (no smoothing) or in [1, count / 6)
ResampledLoop resample_loop_smoothly(const Points2& loop, Eigen::Index count, double sigma);

/// Tangents and curvature of a closed, evenly sampled curve at one scale.
struct ContourCurvature {
  Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor> tangents;  ///< I by 2, unit
  Eigen::VectorXd curvature;   ///< I [1/px], > 0 where an outer loop (positive area) is convex
  Eigen::Index num_cusps = 0;  ///< samples without a tangent, which took that of the one before
};

/// Eqs. 7.34 to 7.36 with erratum E-40: the samples are convolved with the derivative of a
/// Gaussian, made unit, convolved again; the norm of the result over the spacing is |curvature|. On
/// a circle of radius r it is exp(-(2 pi sigma / I)^2 / 2) / r. The sign s of Eq. 7.36 is +1 here:
/// the derivative of the smoothed curve points forward by itself, and the sign against the raw
/// difference of neighbours flips tangents wherever noise is larger than the spacing.
/// @param samples I by 2, I >= 8, finite, evenly spaced by `spacing` > 0 [px]
/// @param sigma   in [1, I / 6) samples
/// @throws InvalidArgument otherwise. Cost: O(I min(I, 12 sigma)).
ContourCurvature compute_contour_curvature(const Points2& samples, double spacing, double sigma);

/// `samples` convolved circularly with a Gaussian of `sigma` samples.
/// @throws InvalidArgument as compute_contour_curvature()
Points2 smooth_contour(const Points2& samples, double sigma);

/// Point at arc length `arc` (any real number, taken round the loop) from the first corner.
/// @param loop as resample_loop(). Cost: O(corners).
Eigen::RowVector2d point_at_arc(const Points2& loop, double arc);

/// Length of the closed polyline [px]. Cost: O(corners).
double loop_length(const Points2& loop);

}  // namespace dupin
