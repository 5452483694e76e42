#pragma once

#include <Eigen/Core>

#include "dupin/registration/pose.h"
#include "dupin/registration/surface_samples.h"

namespace dupin::detail {

/// Calls visit(at, i, place, normal) for every so many samples i of `other`, moved by `pose` into
/// the frame of `surface`, that have a sample `at` of it near.
template <class Visit>
void visit_near_samples(const SurfaceSamples& surface, const SurfaceSamples& other,
                        const Pose& pose, Eigen::Index every, const Visit& visit) {
  if (surface.grid.empty()) return;
  for (Eigen::Index i = 0; i < other.points.rows(); i += every) {
    const Eigen::RowVector3d place = moved_point(other.points.row(i), pose);
    const Eigen::Index at = surface.near(place);
    if (at >= 0) visit(at, i, place, turned_direction(other.normals.row(i), pose));
  }
}

}  // namespace dupin::detail
