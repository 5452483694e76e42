#pragma once

#include <Eigen/Core>

namespace dupin::detail {

/// p -> linear * p + translation, as scene files place their shapes.
struct AffineMap {
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  bool is_identity = true;  ///< then points pass through bit for bit
};

/// p -> outer(inner(p)).
AffineMap product(const AffineMap& outer, const AffineMap& inner);

/// Every entry is at most 1e100 in size, so that a product of two maps cannot overflow.
bool is_tame(const AffineMap& map);

/// Moves `point`; false, leaving it, if the result could overflow. `map` must be tame and the point
/// finite.
bool apply(const AffineMap& map, Eigen::Vector3d& point);

/// Cofactors of `linear`: what takes normals along, the inverse transpose without its division.
Eigen::Matrix3d cofactors(const Eigen::Matrix3d& linear);

/// Takes `normal` along, to a unit vector unless `map` is the identity (then bit for bit); zero if
/// it is not finite or has no direction.
Eigen::Vector3d moved_normal(const AffineMap& map, const Eigen::Matrix3d& cofactors,
                             const Eigen::Vector3d& normal);

/// Rotation by `angle_rad` about `axis` of any length; the identity if the axis is zero.
Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle_rad);

}  // namespace dupin::detail
