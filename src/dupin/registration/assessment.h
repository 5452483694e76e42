#pragma once

#include "dupin/registration/icp.h"
#include "dupin/registration/register.h"
#include "dupin/registration/surface_samples.h"

namespace dupin::detail {

/// Bounds of what counts as resting on each other.
struct AssessmentBounds {
  double touching = 0.0;  ///< largest distance of surfaces that rest on each other [mu of fixed]
  double apart = 0.0;     ///< beyond this the other surface was not seen there [mu of fixed]
};

/// How the surfaces lie on each other: samples over a patch of the other surface within `touching`
/// count as overlap; those farther, up to `apart`, over the inside of the other surface and facing
/// the same way, contradict the pose; all others lie where the other scan ends. `every`: takes only
/// every so many samples.
PoseFit assess_pose(const SurfaceSamples& moving, const SurfaceSamples& fixed, const Pose& pose,
                    bool is_flipped, const AssessmentBounds& bounds, Eigen::Index every = 1);

/// Fewer pairs of samples than this are no evidence of anything.
constexpr Eigen::Index kFewestPairs = 12;

/// Confidence in [0, 1] that a pose of this fit is right: logistic in what tells right poses from
/// wrong ones (docs/methods/registration.md), of the share of conflicts as it was counted. For
/// rough fits on few samples, which are looked at again.
double plain_confidence_of(const PoseFit& fit, int matches);

/// The same with the share of conflicts at the upper end of its 95 % interval (one-sided, Wilson):
/// one conflict among thirty pairs says little for a pose.
double confidence_of(const PoseFit& fit, int matches);

}  // namespace dupin::detail
