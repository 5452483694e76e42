#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "dupin/base/random.h"
#include "dupin/mesh/mesh.h"

namespace dupin {

/// Similarity x -> scale rotation x + translation.
struct Pose {
  double scale = 1.0;                                      ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< determinant 1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< [mu of the target]
};

/// The pose that does `first`, then `second`.
Pose compose(const Pose& second, const Pose& first);

/// The pose that undoes `pose`.
Pose inverse(const Pose& pose);

/// `points` (#V by 3) moved by `pose`. Cost: O(V).
Points transformed(const Points& points, const Pose& pose);

/// `directions` (#V by 3) turned by the rotation of `pose`. Cost: O(V).
Points turned(const Points& directions, const Pose& pose);

/// The same of one point and one direction.
Eigen::RowVector3d moved_point(const Eigen::RowVector3d& point, const Pose& pose);
Eigen::RowVector3d turned_direction(const Eigen::RowVector3d& direction, const Pose& pose);

/// Angle of the rotation that leads from `a` to `b`, in [0, pi]; accurate near 0.
double rotation_angle(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

/// Nearest rotation to `m` in the Frobenius norm, never a reflection.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

/// Rotation by the length of `turn` [rad] about its direction.
Eigen::Matrix3d rotation_of(const Eigen::Vector3d& turn);

/// A rotation drawn evenly from all.
Eigen::Matrix3d random_rotation(Rng& rng);

/// Pose that takes `from` to `to` (#N by 3 each) with the least weighted sum of squares, in closed
/// form (Umeyama, PAMI 1991; Arun et al., PAMI 1987): never a reflection. `weights` (#N, >= 0, or
/// empty: equal). With `with_scale` the scale is fitted too, else it is 1.
/// @throws InvalidArgument if sizes differ, a value is not finite or a weight negative
/// @throws AnalysisError E_DEGENERATE if fewer than three points have weight, or they lie on one
///   line or at one place: the rotation is not determined
/// Cost: O(N).
Pose fit_pose(const Points& from, const Points& to, const Eigen::VectorXd& weights = {},
              bool with_scale = false);

}  // namespace dupin
