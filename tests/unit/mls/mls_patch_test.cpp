#include "dupin/mls/mls_patch.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mls/patch_kernels.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

// A cubic over a disk of the plane z = 0, its centre the first point.
Points sampled_cubic(const PatchVector& beta, Index count, double radius, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Index i = 0; i < count; ++i) {
    const double r = radius * std::sqrt(rng.uniform());
    const double angle = rng.uniform(0.0, 2.0 * M_PI);
    const double x = i == 0 ? 0.0 : r * std::cos(angle);
    const double y = i == 0 ? 0.0 : r * std::sin(angle);
    PatchVector m;
    m << x * x * x, x * x * y, x * y * y, y * y * y, x * x, x * y, y * y, x, y, 1.0;
    points.row(i) << x, y, beta.dot(m);
  }
  return points;
}

// H and K of the graph z = g(x, y) at the foot of z-coordinates: independent of the fit's frame.
PatchCurvature curvature_of(const Points& points, const MlsOptions& options) {
  return patch_curvature(fit_mls_patch(points.row(0), points, options, RowVector3d::UnitZ()).beta);
}

const PatchVector& some_cubic() {
  static const PatchVector beta =
      (PatchVector() << 0.3, -0.2, 0.5, 0.1, -0.4, 0.25, 0.15, 0.0, 0.0, 0.0).finished();
  return beta;
}

// exp of the kernel against std::exp over its whole range.
TEST(PatchKernels, GaussianWeightsAreExponentials) {
  constexpr Index kCount = 4'000;
  std::vector<double> z(kCount);
  std::vector<double> out(kCount);
  for (Index i = 0; i < kCount; ++i)
    z[static_cast<std::size_t>(i)] = 700.0 * static_cast<double>(i * i) / (kCount * kCount);
  detail::gaussian_weights(kCount, z.data(), 1.0, out.data());
  for (std::size_t i = 0; i < z.size(); ++i) {
    EXPECT_NEAR(out[i], std::exp(-z[i]), 2e-15 * (1.0 + 0.1 * z[i]) * std::exp(-z[i])) << z[i];
  }
}

// The moments are the plain sums.
TEST(PatchKernels, MomentsArePlainSums) {
  constexpr Index kCount = 52;
  Rng rng(4);
  Eigen::Array<double, kCount, 4> data;
  for (Index i = 0; i < data.size(); ++i) data.data()[i] = rng.uniform(-1.0, 1.0);
  const auto x = data.col(0);
  const auto y = data.col(1);
  const auto h = data.col(2);
  const auto w = data.col(3);
  std::vector<double> scratch(static_cast<std::size_t>(11 * kCount));
  detail::PatchMoments moments;
  detail::sum_moments(kCount, x.data(), y.data(), h.data(), w.data(), true, scratch.data(),
                      moments);
  for (int a = 0; a <= 6; ++a) {
    for (int b = 0; a + b <= 6; ++b) {
      const auto monomial = x.pow(a) * y.pow(b);
      EXPECT_NEAR(moments.weight[a][b], (w * monomial).sum(), 1e-13);
      EXPECT_NEAR(moments.squared[a][b], (w * w * monomial).sum(), 1e-13);
      if (a + b <= 3) {
        EXPECT_NEAR(moments.height[a][b], (w * h * monomial).sum(), 1e-13);
      }
    }
  }
}

// The fit of an exact cubic in a frame tilted against the plane is the surface itself: H, K and the
// directions come out exactly, with any weights. A cubic stays a cubic only in its own frame, so
// the cubic is a plane's: the tilt of the reference plane is small, and the error falls with
// radius^2.
TEST(MlsPatch, ReproducesAQuadricToFourthOrder) {
  PatchVector beta = some_cubic();
  const PatchCurvature truth = patch_curvature(beta);
  for (const MlsWeight weight : {MlsWeight::gaussian, MlsWeight::uniform}) {
    double previous = 0.0;
    for (const double radius : {0.4, 0.2, 0.1, 0.05}) {
      const PatchCurvature fit =
          curvature_of(sampled_cubic(beta, 100, radius, 7), {.weight = weight});
      const double error = std::abs(fit.mean - truth.mean) + std::abs(fit.gauss - truth.gauss);
      if (previous > 0.0) {
        EXPECT_LT(error, 0.4 * previous) << radius;
      }
      previous = error;
    }
    EXPECT_LT(previous, 1e-3);
  }
}

// Heights over the very plane of the fit: every coefficient is recovered to rounding (B3). The
// points come in mirrored pairs, so that the smallest axis of the scatter is z exactly.
TEST(MlsPatch, RecoversTheCoefficientsOfACubicInItsOwnFrame) {
  Rng rng(11);
  const Index half = 60;
  Points points(8 * half, 3);
  for (Index i = 0; i < half; ++i) {
    const double x = rng.uniform(0.05, 1.0);
    const double y = rng.uniform(0.05, 0.8);
    Index row = 8 * i;
    for (const double sx : {1.0, -1.0}) {
      for (const double sy : {1.0, -1.0}) {
        const double h = 0.1 * (x * x + 2.0 * y * y);
        points.row(row++) << sx * x, sy * y, h;
        points.row(row++) << sx * x, sy * y, h;
      }
    }
  }
  const MlsPatch patch = fit_mls_patch(RowVector3d::Zero(), points, {}, RowVector3d::UnitZ());
  ASSERT_EQ(patch.order, 10);
  const double cx = std::abs(patch.u1[0]) > 0.5 ? patch.beta[4] : patch.beta[6];
  const double cy = std::abs(patch.u1[0]) > 0.5 ? patch.beta[6] : patch.beta[4];
  EXPECT_NEAR(cx, 0.1, 1e-12);
  EXPECT_NEAR(cy, 0.2, 1e-12);
  for (const Index i : {0, 1, 2, 3, 5, 7, 8}) EXPECT_NEAR(patch.beta[i], 0.0, 1e-12);
  EXPECT_NEAR(patch.projected()[2], 0.0, 1e-12);
  EXPECT_LT(patch.variance, 1e-28);
}

// Curvature of a tilted plane patch is 0; of the paraboloid z = -(x^2 + y^2) / 2 it is H = 1, K =
// 1, of a saddle H = 0, K < 0 with the directions along the axes.
TEST(PatchCurvature, HasTheSignsOfTheConventions) {
  PatchVector cap = PatchVector::Zero();
  cap[4] = cap[6] = -0.5;
  EXPECT_DOUBLE_EQ(patch_curvature(cap).mean, 1.0);
  EXPECT_DOUBLE_EQ(patch_curvature(cap).gauss, 1.0);
  PatchVector saddle = PatchVector::Zero();
  saddle[4] = 0.5;
  saddle[6] = -1.0;
  const PatchCurvature c = patch_curvature(saddle);
  EXPECT_DOUBLE_EQ(c.k1, 2.0);
  EXPECT_DOUBLE_EQ(c.k2, -1.0);
  EXPECT_NEAR(std::abs(c.d1[1]), 1.0, 1e-15);
  EXPECT_NEAR(std::abs(c.d2[0]), 1.0, 1e-15);
  PatchVector tilted = PatchVector::Zero();
  tilted[7] = 0.7;
  EXPECT_EQ(patch_curvature(tilted).mean, 0.0);
}

// Eq. 4.18 as printed (its sign of H turned), at random coefficients, and S d = k d for the
// directions: I^-1 II applied to them.
TEST(PatchCurvature, AgreesWithThePrintedFormulas) {
  Rng rng(3);
  for (int trial = 0; trial < 100; ++trial) {
    PatchVector b;
    for (Index i = 0; i < 10; ++i) b[i] = rng.uniform(-1.0, 1.0);
    const double w2 = b[8] * b[8] + b[7] * b[7] + 1.0;
    const double gauss = (4.0 * b[4] * b[6] - b[5] * b[5]) / (w2 * w2);
    const double mean =
        -(b[4] * b[8] * b[8] - b[5] * b[7] * b[8] + b[6] * b[7] * b[7] + b[6] + b[4]) /
        std::pow(w2, 1.5);
    const PatchCurvature c = patch_curvature(b);
    EXPECT_NEAR(c.gauss, gauss, 1e-13);
    EXPECT_NEAR(c.mean, mean, 1e-13);
    Eigen::Matrix2d first;
    first << 1.0 + b[7] * b[7], b[7] * b[8], b[7] * b[8], 1.0 + b[8] * b[8];
    Eigen::Matrix2d second;
    second << 2.0 * b[4], b[5], b[5], 2.0 * b[6];
    const Eigen::Matrix2d shape = -first.inverse() * second / std::sqrt(w2);
    EXPECT_LT((shape * c.d1.head<2>().transpose() - c.k1 * c.d1.head<2>().transpose()).norm(),
              1e-12);
    EXPECT_NEAR(c.d1.norm(), 1.0, 1e-13);
    EXPECT_NEAR(c.d1.dot(c.d2), 0.0, 1e-13);
    EXPECT_NEAR(c.d1.dot(c.normal), 0.0, 1e-13);
  }
}

// Lengths scale over 16 decades: beta of x^a y^b by s^(1 - a - b), dof not at all.
TEST(MlsPatch, ScalesWithTheUnitOfLength) {
  const Points points = sampled_cubic(some_cubic(), 60, 0.5, 2);
  const MlsPatch unit = fit_mls_patch(points.row(0), points, {}, RowVector3d::UnitZ());
  for (const double s : {1e-8, 1e8}) {
    const Points scaled = s * points;
    const MlsPatch patch = fit_mls_patch(scaled.row(0), scaled, {}, RowVector3d::UnitZ());
    ASSERT_EQ(patch.order, 10);
    constexpr int kDegree[] = {3, 3, 3, 3, 2, 2, 2, 1, 1, 0};
    for (Index i = 0; i < 10; ++i) {
      EXPECT_NEAR(patch.beta[i] * std::pow(s, kDegree[i] - 1), unit.beta[i], 1e-9);
      EXPECT_NEAR(
          patch.unit_covariance(i, i) * std::pow(s, 2 * kDegree[i]) / unit.unit_covariance(i, i),
          1.0, 1e-9);
    }
    EXPECT_NEAR(patch.dof, unit.dof, 1e-9);
  }
}

// Rotating and shifting the points rotates the patch: same curvature, same projection, moved.
TEST(MlsPatch, MovesWithThePoints) {
  const Points points = sampled_cubic(some_cubic(), 80, 0.5, 5);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.9, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  const RowVector3d shift(3.0, -1.0, 2.0);
  const Points moved = (points * turn.transpose()).rowwise() + shift;
  const MlsPatch a = fit_mls_patch(points.row(0), points, {}, RowVector3d::UnitZ());
  const MlsPatch b = fit_mls_patch(moved.row(0), moved, {}, turn.col(2).transpose());
  EXPECT_NEAR(patch_curvature(a.beta).mean, patch_curvature(b.beta).mean, 1e-10);
  EXPECT_NEAR(patch_curvature(a.beta).gauss, patch_curvature(b.beta).gauss, 1e-10);
  EXPECT_LT((a.projected() * turn.transpose() + shift - b.projected()).norm(), 1e-12);
  // The other side: H changes its sign, K does not.
  const MlsPatch below = fit_mls_patch(points.row(0), points, {}, -RowVector3d::UnitZ());
  EXPECT_NEAR(patch_curvature(below.beta).mean, -patch_curvature(a.beta).mean, 1e-12);
  EXPECT_NEAR(patch_curvature(below.beta).gauss, patch_curvature(a.beta).gauss, 1e-12);
}

// The order falls to what the points determine, and never to a legal-looking cubic: fewer than ten
// points, points on a conic, collinear points, two points, coincident points (degenerate list 8).
TEST(MlsPatch, FallsBackToWhatThePointsDetermine) {
  const Points cubic = sampled_cubic(some_cubic(), 100, 0.5, 9);
  const auto order_of = [](const Points& points) {
    return fit_mls_patch(points.row(0), points).order;
  };
  EXPECT_EQ(order_of(cubic), 10);
  EXPECT_EQ(order_of(cubic.topRows(10)), 10);
  EXPECT_EQ(order_of(cubic.topRows(9)), 6);
  EXPECT_EQ(order_of(cubic.topRows(5)), 3);
  EXPECT_EQ(order_of(cubic.topRows(2)), 0);
  Points line(30, 3);
  Points circle(30, 3);
  Points lattice(16, 3);
  for (Index i = 0; i < 30; ++i) {
    const double angle = 2.0 * M_PI * static_cast<double>(i) / 30.0;
    line.row(i) << 0.1 * static_cast<double>(i), 0.2 * static_cast<double>(i), 0.0;
    circle.row(i) << std::cos(angle), std::sin(angle), 0.0;
  }
  for (Index i = 0; i < 16; ++i)
    lattice.row(i) << static_cast<double>(i % 2), static_cast<double>(i / 2), 0.0;
  EXPECT_EQ(order_of(line), 0);  // one direction: not even a plane
  for (Index i = 0; i < 30; ++i) line.row(i) = 0.1 * static_cast<double>(i) * RowVector3d(1, 2, 3);
  EXPECT_EQ(order_of(line), 0);     // what rounding leaves across it is no second direction
  EXPECT_EQ(order_of(circle), 3);   // x^2 + y^2 = 1 on all of them
  EXPECT_EQ(order_of(lattice), 3);  // x^2 = x on two columns
  EXPECT_EQ(order_of(Points::Constant(40, 3, 2.0)), 0);
  const MlsPatch exact = fit_mls_patch(cubic.row(0), cubic.topRows(10));
  EXPECT_EQ(exact.dof, 0.0);  // ten points, ten coefficients: no variance
  EXPECT_EQ(exact.variance, 0.0);
}

TEST(MlsPatch, RefusesWhatIsOutOfRange) {
  const Points points = sampled_cubic(some_cubic(), 20, 0.5, 1);
  const RowVector3d r = points.row(0);
  EXPECT_THROW(fit_mls_patch(r, points, {.neighbors = 2}), InvalidArgument);
  EXPECT_THROW(fit_mls_patch(r, points, {.radius = -1.0}), InvalidArgument);
  EXPECT_THROW(fit_mls_patch(r, points, {.weight_width = 0.0}), InvalidArgument);
  EXPECT_THROW(fit_mls_patch(r, points, {.degree = 4}), InvalidArgument);
  EXPECT_THROW(fit_mls_patch(r, points, {.rank_tolerance = 1.0}), InvalidArgument);
  Points broken = points;
  broken(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(fit_mls_patch(r, broken), InvalidArgument);
}

}  // namespace
}  // namespace dupin
