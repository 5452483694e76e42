#include "dupin/io/affine_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dupin::detail {
namespace {

constexpr double kLargestEntry = 1e100;

bool is_finite(const Eigen::Vector3d& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

AffineMap product(const AffineMap& outer, const AffineMap& inner) {
  if (outer.is_identity) return inner;
  if (inner.is_identity) return outer;
  AffineMap result;
  result.is_identity = false;
  result.linear = outer.linear * inner.linear;
  result.translation = outer.linear * inner.translation + outer.translation;
  return result;
}

bool is_tame(const AffineMap& map) {
  for (int row = 0; row < 3; ++row) {
    if (!(std::abs(map.translation[row]) <= kLargestEntry)) return false;
    for (int col = 0; col < 3; ++col) {
      if (!(std::abs(map.linear(row, col)) <= kLargestEntry)) return false;
    }
  }
  return true;
}

bool apply(const AffineMap& map, Eigen::Vector3d& point) {
  if (map.is_identity) return true;
  const double growth = 4.0 * std::max(1.0, map.linear.cwiseAbs().maxCoeff());
  if (point.cwiseAbs().maxCoeff() > 1e300 / growth) return false;
  point = (map.linear * point + map.translation).eval();
  return true;
}

Eigen::Matrix3d cofactors(const Eigen::Matrix3d& linear) {
  Eigen::Matrix3d result;
  result.row(0) = linear.row(1).cross(linear.row(2));
  result.row(1) = linear.row(2).cross(linear.row(0));
  result.row(2) = linear.row(0).cross(linear.row(1));
  return result;
}

Eigen::Vector3d moved_normal(const AffineMap& map, const Eigen::Matrix3d& cofactors,
                             const Eigen::Vector3d& normal) {
  if (!is_finite(normal)) return Eigen::Vector3d::Zero();
  const double size = normal.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) return Eigen::Vector3d::Zero();
  if (map.is_identity) return normal;
  Eigen::Vector3d moved = cofactors * (normal / size);
  const double largest = moved.cwiseAbs().maxCoeff();
  if (!(largest > 0.0)) return Eigen::Vector3d::Zero();
  moved /= largest;
  return moved.normalized();
}

Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle_rad) {
  const double largest = axis.cwiseAbs().maxCoeff();
  if (!(largest > 0.0)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, (axis / largest).normalized()).toRotationMatrix();
}

}  // namespace dupin::detail
