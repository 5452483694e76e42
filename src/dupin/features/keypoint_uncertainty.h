#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dupin/features/keypoints.h"
#include "dupin/scalespace/stack_noise.h"

namespace dupin {

/// How sure a keypoint is.
struct KeypointUncertainty {
  double snr = 0.0;      ///< |response| over its standard deviation at its level and vertex
  double p_value = 1.0;  ///< family-wise, see MaximumLaw
  /// Root mean square distance of the extremum from its place without noise [mu]; absent where the
  /// response is no round extremum of a quadratic over two rings.
  std::optional<double> position_sd;
  std::optional<double> radius_sd;  ///< [mu]; absent where the scale is no peak of the response
  /// Share of sixteen replicas in which it is found again; absent without StackNoise::samples. A
  /// replica is the stack with .6 of one more noise added, searched as the stack was, but for
  /// contrast, edges and number. Found again: a keypoint of the same kind within 1.5 mean edges,
  /// and .15 more, up to 2.5, for every level that a track (KeypointRule::persistent) is longer
  /// than it must be.
  std::optional<double> stability;
};

/// Distribution of the largest |LoC| / sd that noise alone shows over all vertices and levels
/// searched: P(max > u) = 1 - exp(-rate rho(u)) with the tail of a smooth Gaussian field over a
/// surface and a scale axis, rho(u) = (u^2 - 1) exp(-u^2 / 2) (constant below its top at sqrt 3).
/// The shape is theory, the rate is fitted to the replicas.
struct MaximumLaw {
  double rate = 0.0;
  /// Probability that noise alone reaches `snr` somewhere.
  double p_value(double snr) const;
};

/// Maximum likelihood: rate = (R + 1) / sum rho(maxima), its relative standard error 1 / sqrt(R);
/// the 1 leans to larger p-values. Without maxima the rate is 0.
MaximumLaw fit_maximum_law(const Eigen::VectorXd& maxima);

/// Options of StackNoise for keypoints of `options`: searches the levels that find_keypoints()
/// does.
StackNoiseOptions keypoint_noise_options(const SurfaceGraph& graph, const LevelSchedule& schedule,
                                         const KeypointOptions& options);

/// Uncertainty of keypoints found with `options`, aligned with them. `noise` belongs to the stack
/// and was made with keypoint_noise_options(). Where noise is zero the snr is the largest double
/// and the p-value 0. Empty when cancelled.
/// @throws InvalidArgument if sizes differ
/// Cost: O(1) a keypoint; with samples sixteen times find_keypoints() and a stack of memory.
std::vector<KeypointUncertainty> estimate_keypoint_uncertainty(
    const SurfaceGraph& graph, const LevelMatrix& loc, const LevelSchedule& schedule,
    const StackNoise& noise, const std::vector<Keypoint>& keypoints, const KeypointOptions& options,
    RunControl run = {});

/// Is the keypoint there, and is it where it says, but for a chance of `alpha`? Both: p_value <=
/// alpha; stability >= 1 - alpha (docs/adr/0016-found-again-in-replicas.md), which no keypoint
/// without a stability has. With `alpha` 1 every keypoint.
/// @throws InvalidArgument if alpha is not in (0, 1]
bool is_significant(const KeypointUncertainty& uncertainty, double alpha);

/// Lowest level whose noise is small against what the surface itself shows there: the root mean
/// square of `sd` is at most `share` of the spread of `field` over the vertices after the noise has
/// been taken from it. `field` is L by V (F or LoC), `sd` its noise. -1: no level (thesis 5.3 with
/// the standard deviation in place of the expectation, which is always 0: erratum E-26).
/// @throws InvalidArgument if sizes differ or share is not > 0
int advise_level(const LevelMatrix& field, const LevelMatrixF& sd, double share = 0.5);

}  // namespace dupin
