#pragma once

#include <Eigen/Core>

namespace dupin {

/// Eigenpairs of a symmetric 3 x 3 matrix, ascending; vectors are orthonormal columns.
struct SymmetricEigen3 {
  Eigen::Vector3d values = Eigen::Vector3d::Zero();
  Eigen::Matrix3d vectors = Eigen::Matrix3d::Identity();
};

/// Iterative (tridiagonal QR) decomposition, accurate for clustered eigenvalues; reads the lower
/// triangle. The sign of each vector is fixed: its entry of largest magnitude (the first of equals)
/// is positive.
/// @throws InvalidArgument if an entry is not finite
SymmetricEigen3 eigen_symmetric(const Eigen::Matrix3d& matrix);

/// An orthonormal pair (u, w) with u x w = n for a unit vector n, chosen without branches on
/// rotation: u is perpendicular to the coordinate axis that n leans on least.
void tangent_basis(const Eigen::RowVector3d& n, Eigen::RowVector3d& u, Eigen::RowVector3d& w);

}  // namespace dupin
