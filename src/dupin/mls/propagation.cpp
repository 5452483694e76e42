#include "dupin/mls/propagation.h"

#include <Eigen/LU>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/math/symmetric3.h"

namespace dupin {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;

Eigen::Matrix<double, 2, 10> curvature_jacobian(const PatchVector& beta) {
  const double b5 = beta[4];
  const double b6 = beta[5];
  const double b7 = beta[6];
  const double p = beta[7];
  const double q = beta[8];
  const double w2 = 1.0 + p * p + q * q;
  const double w3 = w2 * std::sqrt(w2);
  const double w5 = w3 * w2;
  const double k = 4.0 * b5 * b7 - b6 * b6;
  const double h = b5 * (1.0 + q * q) - b6 * p * q + b7 * (1.0 + p * p);
  Eigen::Matrix<double, 2, 10> jacobian = Eigen::Matrix<double, 2, 10>::Zero();
  jacobian.row(0).segment<5>(4) << 4.0 * b7 / (w2 * w2), -2.0 * b6 / (w2 * w2),
      4.0 * b5 / (w2 * w2), -4.0 * k * p / (w2 * w2 * w2), -4.0 * k * q / (w2 * w2 * w2);
  jacobian.row(1).segment<5>(4) << (1.0 + q * q) / w3, -p * q / w3, (1.0 + p * p) / w3,
      (2.0 * b7 * p - b6 * q) / w3 - 3.0 * h * p / w5,
      (2.0 * b5 * q - b6 * p) / w3 - 3.0 * h * q / w5;
  jacobian.row(1) *= -1.0;  // the thesis's H is negative on a sphere with outward normal
  return jacobian;
}

Eigen::Matrix2d curvature_covariance(const PatchVector& beta, const PatchMatrix& covariance) {
  const Eigen::Matrix<double, 2, 10> jacobian = curvature_jacobian(beta);
  return jacobian * covariance * jacobian.transpose();
}

// n = (-p, -q, 1) / w: dn/dp = (-1, 0, 0) / w - n p / w^2, and so for q.
Matrix3d patch_normal_covariance(const PatchVector& beta, const PatchMatrix& covariance) {
  const double p = beta[7];
  const double q = beta[8];
  const double w = std::sqrt(1.0 + p * p + q * q);
  const Eigen::Vector3d n = Eigen::Vector3d(-p, -q, 1.0) / w;
  Eigen::Matrix<double, 3, 2> jacobian;
  jacobian.col(0) = -Eigen::Vector3d::UnitX() / w - n * (p / (w * w));
  jacobian.col(1) = -Eigen::Vector3d::UnitY() / w - n * (q / (w * w));
  return jacobian * covariance.block<2, 2>(7, 7) * jacobian.transpose();
}

Matrix3d plane_normal_covariance(const Points& offsets, const Eigen::VectorXd& weights,
                                 const Matrix3d& noise) {
  if (offsets.rows() != weights.size() || offsets.rows() < 3) {
    throw InvalidArgument("offsets: " + std::to_string(offsets.rows()) + " rows and " +
                          std::to_string(weights.size()) +
                          " weights, need as many of both and at least 3");
  }
  const Matrix3d scatter = offsets.transpose() * weights.asDiagonal() * offsets;
  const SymmetricEigen3 axes = eigen_symmetric(scatter);
  if (!(axes.values[1] - axes.values[0] > 1e-12 * axes.values[2])) {
    throw AnalysisError("E_DEGENERATE",
                        "the neighbourhood has no smallest axis: its normal is not determined");
  }
  const Eigen::Vector3d n = axes.vectors.col(0);
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
  a.topLeftCorner<3, 3>() = 2.0 * (scatter - axes.values[0] * Matrix3d::Identity());
  a.topRightCorner<3, 1>() = 2.0 * n;
  a.bottomLeftCorner<1, 3>() = 2.0 * n.transpose();
  // B S B^T: noise is the same in all neighbours and independent from one to the next, and
  // dg/dq_i = 2 w_i ((n . q_i) I + q_i n^T) (E-13).
  Matrix3d middle = Matrix3d::Zero();
  for (Index i = 0; i < offsets.rows(); ++i) {
    const Eigen::Vector3d offset = offsets.row(i).transpose();
    const Matrix3d slope =
        2.0 * weights[i] * (n.dot(offset) * Matrix3d::Identity() + offset * n.transpose());
    middle += slope * noise * slope.transpose();
  }
  const Eigen::Matrix4d inverse = a.inverse();
  return inverse.topLeftCorner<3, 3>() * middle * inverse.topLeftCorner<3, 3>().transpose();
}

MatrixXd implicit_covariance(const MatrixXd& g_parameters, const MatrixXd& g_data,
                             const MatrixXd& noise) {
  const Index p = g_parameters.rows();
  const Index n = g_data.cols();
  if (p < 1 || g_parameters.cols() != p || g_data.rows() != p || noise.rows() != n ||
      noise.cols() != n) {
    throw InvalidArgument("g_parameters must be p by p, g_data p by n, noise n by n");
  }
  for (const MatrixXd* matrix : {&g_parameters, &g_data, &noise}) {
    for (Index i = 0; i < matrix->size(); ++i) {
      if (!std::isfinite(matrix->data()[i])) throw InvalidArgument("an entry is not finite");
    }
  }
  const Eigen::FullPivLU<MatrixXd> factor(g_parameters);
  if (!factor.isInvertible()) {
    throw AnalysisError("E_DEGENERATE", "the objective has no single minimum: dg/db is singular");
  }
  const MatrixXd sensitivity = factor.solve(g_data);
  return sensitivity * noise * sensitivity.transpose();
}

}  // namespace dupin
