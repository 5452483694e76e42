// Identities of the propagation formulas. What draws of noise say is in propagation_draws_test.cpp.
#include "dupin/mls/propagation.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd random_matrix(Index rows, Index cols, std::uint64_t seed) {
  Rng rng(seed);
  MatrixXd matrix(rows, cols);
  for (Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = rng.normal();
  return matrix;
}

// All 20 entries of Eq. 4.39 against central differences of Eq. 4.18 (E-10).
TEST(CurvatureJacobian, IsTheDerivative) {
  PatchVector b;
  b << 0.1, 0.2, -0.3, 0.4, -0.5, 0.3, 0.7, 0.2, -0.6, 0.1;
  const auto jacobian = curvature_jacobian(b);
  for (Index i = 0; i < 10; ++i) {
    constexpr double kStep = 1e-6;
    PatchVector up = b;
    PatchVector down = b;
    up[i] += kStep;
    down[i] -= kStep;
    const PatchCurvature high = patch_curvature(up);
    const PatchCurvature low = patch_curvature(down);
    EXPECT_NEAR(jacobian(0, i), (high.gauss - low.gauss) / (2.0 * kStep), 1e-8);
    EXPECT_NEAR(jacobian(1, i), (high.mean - low.mean) / (2.0 * kStep), 1e-8);
  }
}

// At an umbilic K = H^2 to first order, so the covariance of (K, H) has rank 1 (E-10b).
TEST(CurvatureCovariance, HasRankOneAtAnUmbilic) {
  PatchVector cap = PatchVector::Zero();
  cap[4] = cap[6] = -0.5;
  const MatrixXd root = random_matrix(10, 10, 1);
  const Eigen::Matrix2d covariance = curvature_covariance(cap, root * root.transpose());
  EXPECT_NEAR(covariance.determinant(), 0.0, 1e-12 * covariance.squaredNorm());
  EXPECT_GT(covariance(0, 0), 0.0);
}

// The implicit model is exact where the estimate is linear: g = 2 A^T W (A b - h) gives the
// covariance (A^T W A)^-1 A^T W S W A (A^T W A)^-1 of Eq. 4.30 (B7).
TEST(ImplicitCovariance, OfALinearFitIsTheSandwich) {
  const MatrixXd a = random_matrix(30, 4, 2);
  const MatrixXd root = random_matrix(30, 30, 3);
  const MatrixXd noise = root * root.transpose();
  const MatrixXd w = random_matrix(30, 1, 4).cwiseAbs().asDiagonal();
  const MatrixXd normal = a.transpose() * w * a;
  const MatrixXd sandwich = normal.inverse() * a.transpose() * w * noise * w * a * normal.inverse();
  const MatrixXd found = implicit_covariance(2.0 * normal, -2.0 * a.transpose() * w, noise);
  EXPECT_LT((found - sandwich).norm(), 1e-10 * sandwich.norm());
}

// And to first order where it is not: the parameter of g = b^3 - sum h has db/dh = 1 / (3 b^2).
TEST(ImplicitCovariance, OfANonlinearEquationIsTheDerivativeOfItsSolution) {
  const double b = 1.7;
  const MatrixXd found =
      implicit_covariance(MatrixXd::Constant(1, 1, 3.0 * b * b), MatrixXd::Constant(1, 2, -1.0),
                          0.04 * MatrixXd::Identity(2, 2));
  EXPECT_NEAR(found(0, 0), 2.0 * 0.04 / std::pow(3.0 * b * b, 2), 1e-15);
}

TEST(ImplicitCovariance, RefusesWhatHasNoAnswer) {
  const MatrixXd one = MatrixXd::Identity(2, 2);
  EXPECT_THROW(implicit_covariance(one, MatrixXd::Identity(3, 2), one), InvalidArgument);
  EXPECT_THROW(implicit_covariance(one, one, MatrixXd::Identity(3, 3)), InvalidArgument);
  EXPECT_THROW(implicit_covariance(MatrixXd::Zero(2, 2), one, one), AnalysisError);
  MatrixXd broken = one;
  broken(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(implicit_covariance(one, broken, one), InvalidArgument);
  EXPECT_THROW(plane_normal_covariance(Points::Zero(2, 3), Eigen::VectorXd::Ones(2),
                                       Eigen::Matrix3d::Identity()),
               InvalidArgument);
  // On a line every normal across it is as good.
  Points line = Points::Zero(5, 3);
  line.col(0).setLinSpaced(0.0, 1.0);
  EXPECT_THROW(plane_normal_covariance(line, Eigen::VectorXd::Ones(5), Eigen::Matrix3d::Identity()),
               AnalysisError);
}

}  // namespace
}  // namespace dupin
