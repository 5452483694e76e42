#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"

namespace dupin {

/// Options of estimate_noise().
struct NoiseLevelOptions {
  int neighbors = 20;  ///< of each patch, > 10; small, so that the patch follows the surface
  Eigen::Index num_samples = 1000;  ///< points at which a patch is fitted; 0: all
  std::uint64_t seed = 0;           ///< of the choice of points
};

/// Noise of a surface along its normal.
struct NoiseLevel {
  Status status = Status::ok;
  double sigma = 0.0;                 ///< standard deviation [mu]
  double sigma_standard_error = 0.0;  ///< of sigma [mu]
  Eigen::Index num_samples = 0;       ///< patches used: those of full order
  Eigen::Index num_repeated = 0;      ///< points at a place that another has, left out
  Eigen::Index first_repeated = -1;   ///< the first of those points; -1: none
};

/// Standard deviation of the noise of a surface (thesis 4.2.4): cubic patches with uniform weights
/// on small neighbourhoods of random points; their residual variances, each with N - 10 degrees of
/// freedom, are averaged before the root is taken (the mean of the roots is biased, E-7).
/// Points at one place count once: repeated, they would have the residual of one and count as two.
/// Neighbourhoods overlap, so the standard error is that of the mean over groups of samples, but at
/// least that of as many degrees of freedom as the points in use leave.
/// What the surface itself deviates from cubics over 20 points counts as noise.
/// @throws InvalidArgument if an option is out of range or a coordinate is not finite
/// @throws AnalysisError E_TOO_FEW_POINTS if there are not more than 10 places, E_DEGENERATE if no
///   neighbourhood determines a cubic
/// Cost: O(V log V + samples neighbors).
NoiseLevel estimate_noise(const Points& points, const NoiseLevelOptions& options = {},
                          RunControl run = {});

}  // namespace dupin
