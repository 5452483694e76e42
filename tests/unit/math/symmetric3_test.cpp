#include "dupin/math/symmetric3.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

// Q diag(d) Q^T gives back d and columns of Q, over twelve decades of scale.
TEST(EigenSymmetric, RecoversAPlantedDecomposition) {
  Rng rng(3);
  for (const double scale : {1e-6, 1.0, 1e6}) {
    const Eigen::Quaterniond q(rng.normal(), rng.normal(), rng.normal(), rng.normal());
    const Eigen::Matrix3d rotation = q.normalized().toRotationMatrix();
    const Eigen::Vector3d d = scale * Eigen::Vector3d(-2.0, 0.5, 3.0);
    const SymmetricEigen3 eigen = eigen_symmetric(rotation * d.asDiagonal() * rotation.transpose());
    EXPECT_LT((eigen.values - d).norm(), 1e-14 * scale * 10);
    for (Eigen::Index c = 0; c < 3; ++c) {
      EXPECT_NEAR(std::abs(eigen.vectors.col(c).dot(rotation.col(c))), 1.0, 1e-14);
      EXPECT_GT(eigen.vectors.col(c).cwiseAbs().maxCoeff(), 0.0);
    }
  }
}

TEST(EigenSymmetric, TheZeroMatrixHasZeroValuesAndAnOrthonormalBasis) {
  const SymmetricEigen3 eigen = eigen_symmetric(Eigen::Matrix3d::Zero());
  EXPECT_EQ(eigen.values.norm(), 0.0);
  EXPECT_NEAR((eigen.vectors.transpose() * eigen.vectors - Eigen::Matrix3d::Identity()).norm(), 0.0,
              1e-15);
}

TEST(EigenSymmetric, RefusesNaN) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  m(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(eigen_symmetric(m), InvalidArgument);
}

TEST(TangentBasis, IsRightHandedAndOrthonormal) {
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const Eigen::RowVector3d n =
        Eigen::RowVector3d(rng.normal(), rng.normal(), rng.normal()).normalized();
    Eigen::RowVector3d u;
    Eigen::RowVector3d w;
    tangent_basis(n, u, w);
    EXPECT_NEAR((u.cross(w) - n).norm(), 0.0, 1e-14);
    EXPECT_NEAR(u.norm(), 1.0, 1e-15);
    EXPECT_NEAR(w.norm(), 1.0, 1e-14);
  }
}

}  // namespace
}  // namespace dupin
