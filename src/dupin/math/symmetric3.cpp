#include "dupin/math/symmetric3.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "dupin/base/error.h"

namespace dupin {

SymmetricEigen3 eigen_symmetric(const Eigen::Matrix3d& matrix) {
  // Eigen reports success for NaN input (computeDirect) or loops to its limit (compute).
  for (Eigen::Index i = 0; i < 9; ++i) {
    if (!std::isfinite(matrix(i / 3, i % 3)))
      throw InvalidArgument("matrix: an entry is not finite");
  }
  SymmetricEigen3 result;
  const double scale = matrix.cwiseAbs().maxCoeff();
  if (scale == 0.0) return result;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix / scale);
  result.values = solver.eigenvalues() * scale;
  result.vectors = solver.eigenvectors();
  for (Eigen::Index c = 0; c < 3; ++c) {
    Eigen::Index largest = 0;
    for (Eigen::Index r = 1; r < 3; ++r) {
      if (std::abs(result.vectors(r, c)) > std::abs(result.vectors(largest, c))) largest = r;
    }
    if (result.vectors(largest, c) < 0.0) result.vectors.col(c) *= -1.0;
  }
  return result;
}

void tangent_basis(const Eigen::RowVector3d& n, Eigen::RowVector3d& u, Eigen::RowVector3d& w) {
  Eigen::Index axis = 0;
  for (Eigen::Index c = 1; c < 3; ++c) {
    if (std::abs(n[c]) < std::abs(n[axis])) axis = c;
  }
  Eigen::RowVector3d e = Eigen::RowVector3d::Zero();
  e[axis] = 1.0;
  u = (e - e.dot(n) * n).normalized();
  w = n.cross(u);
}

}  // namespace dupin
