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

}  // namespace dupin::detail
