#include "dupin/warp/mls_warp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/warp/warp_depth.h"
#include "tests/support/planar_shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVector2d;
using Eigen::VectorXd;

std::vector<ControlSample> one_each(Index count) {
  std::vector<ControlSample> samples;
  for (std::int32_t m = 0; m < count; ++m) samples.push_back({m, m, 0.0});
  return samples;
}

MatrixXd euclidean(const Points2& points, const Points2& controls) {
  MatrixXd d(points.rows(), controls.rows());
  for (Index m = 0; m < controls.rows(); ++m)
    d.col(m) = (points.rowwise() - controls.row(m)).rowwise().norm();
  return d;
}

MlsWarp make_warp(const Points2& points, const Points2& controls,
                  const MlsWarpOptions& options = {}) {
  const Index count = controls.rows();
  return {points,
          controls,
          one_each(count),
          VectorXd::Ones(count),
          euclidean(points, controls),
          VectorXd::Ones(count),
          options};
}

Points2 random_points(Index count, double size, std::uint64_t seed) {
  Rng rng(seed);
  Points2 points(count, 2);
  for (Index i = 0; i < points.size(); ++i) points.data()[i] = rng.uniform(0.0, size);
  return points;
}

// Eq. 7.6 as a function of the angle; its minimum by search, to 1e-9 rad of a smooth function.
double best_angle(const VectorXd& theta, const Points2& a, const Points2& b) {
  const RowVector2d mean_a = (theta.transpose() * a) / theta.sum();
  const RowVector2d mean_b = (theta.transpose() * b) / theta.sum();
  const auto energy = [&](double angle) {
    double sum = 0.0;
    for (Index m = 0; m < a.rows(); ++m) {
      const RowVector2d p = a.row(m) - mean_a;
      const RowVector2d turned(std::cos(angle) * p.x() - std::sin(angle) * p.y(),
                               std::sin(angle) * p.x() + std::cos(angle) * p.y());
      sum += theta[m] * (b.row(m) - mean_b - turned).squaredNorm();
    }
    return sum;
  };
  double best = 0.0;
  double width = 3.2;
  for (int round = 0; round < 30; ++round) {
    double centre = best;
    for (int i = -20; i <= 20; ++i) {
      const double angle = centre + width * i / 20.0;
      if (energy(angle) < energy(best)) best = angle;
    }
    width *= 0.2;
  }
  return best;
}

// Eq. 7.7, A.14 and B.1: the closed form is the minimum found by a search over angles. The energy
// is quadratic about its minimum, so that the search knows the angle to 1e-7 (square root of
// rounding).
TEST(MlsWarp, IsTheMinimumFoundBySearch) {
  const Points2 points = random_points(40, 100.0, 1);
  const Points2 a = random_points(6, 100.0, 2);
  const Points2 b = random_points(6, 100.0, 3);
  const Points2 q = make_warp(points, a).deform(b);
  const MatrixXd d = euclidean(points, a);
  for (Index v = 0; v < points.rows(); ++v) {
    const VectorXd theta = d.row(v).array().pow(-2.0).transpose();
    const RowVector2d mean_a = (theta.transpose() * a) / theta.sum();
    const RowVector2d mean_b = (theta.transpose() * b) / theta.sum();
    const double angle = best_angle(theta, a, b);
    const RowVector2d u = points.row(v) - mean_a;
    const RowVector2d expected =
        mean_b + RowVector2d(std::cos(angle) * u.x() - std::sin(angle) * u.y(),
                             std::sin(angle) * u.x() + std::cos(angle) * u.y());
    EXPECT_LT((q.row(v) - expected).norm(), 1e-5) << v;
  }
}

// Identity: to 1e-10 px on a picture of 2000 px, also right beside a control, where one weight is
// 1e12 times the others and absolute means would lose all digits.
TEST(MlsWarp, LeavesEverythingWhenNothingMoves) {
  Points2 points = random_points(300, 2000.0, 4);
  const Points2 a = random_points(7, 2000.0, 5);
  for (Index m = 0; m < a.rows(); ++m) {
    points.row(m) = a.row(m);
    points.row(7 + m) = a.row(m) + RowVector2d(1e-3, 2e-3);
    points.row(14 + m) = a.row(m) + RowVector2d(0.7, -0.3);
  }
  for (const auto kind : {MlsKind::rigid, MlsKind::similarity, MlsKind::affine}) {
    for (const double alpha : {1.0, 2.0, 4.0, 16.0}) {
      MlsWarpOptions options;
      options.kind = kind;
      options.alpha = alpha;
      const Points2 q = make_warp(points, a, options).deform(a);
      EXPECT_LT((q - points).cwiseAbs().maxCoeff(), 1e-10)
          << static_cast<int>(kind) << " " << alpha;
    }
  }
}

// Interpolation, and reproduction of the maps of each kind.
TEST(MlsWarp, InterpolatesAndReproducesItsKindOfMap) {
  Points2 points = random_points(200, 500.0, 6);
  const Points2 a = random_points(5, 500.0, 7);
  points.topRows(5) = a;
  const Points2 anywhere = random_points(5, 500.0, 8);
  Eigen::Matrix2d linear;
  linear << 1.3, -0.4, 0.9, 0.7;
  const auto error = [&](MlsKind kind, const Points2& b, const Points2& expected) {
    MlsWarpOptions options;
    options.kind = kind;
    return (make_warp(points, a, options).deform(b) - expected).cwiseAbs().maxCoeff();
  };
  for (const auto kind : {MlsKind::rigid, MlsKind::similarity, MlsKind::affine}) {
    MlsWarpOptions options;
    options.kind = kind;
    const Points2 q = make_warp(points, a, options).deform(anywhere);
    EXPECT_LT((q.topRows(5) - anywhere).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT(error(kind, test::moved_rigidly(a, 2.1, 40.0, -7.0),
                    test::moved_rigidly(points, 2.1, 40.0, -7.0)),
              1e-9);
  }
  const Points2 affine_a = a * linear.transpose();
  const Points2 affine_points = points * linear.transpose();
  EXPECT_LT(error(MlsKind::affine, affine_a, affine_points), 1e-9);
  EXPECT_GT(error(MlsKind::rigid, affine_a, affine_points), 10.0);
  EXPECT_LT(error(MlsKind::similarity, 2.0 * a, 2.0 * points), 1e-9);
  EXPECT_GT(error(MlsKind::rigid, 2.0 * a, 2.0 * points), 10.0);
}

// One control, controls on a line, all at one place, a mirrored quadruple: finite, and a
// translation where the targets say no rotation.
TEST(MlsWarp, SurvivesDegenerateControls) {
  const Points2 points = random_points(30, 10.0, 9);
  Points2 one(1, 2);
  one << 3.0, 4.0;
  Points2 target(1, 2);
  target << 8.0, 2.0;
  Points2 shifted = points;
  shifted.rowwise() += RowVector2d(5.0, -2.0);
  for (const auto kind : {MlsKind::rigid, MlsKind::similarity, MlsKind::affine}) {
    MlsWarpOptions options;
    options.kind = kind;
    EXPECT_LT((make_warp(points, one, options).deform(target) - shifted).norm(), 1e-12);
    Points2 line(3, 2);
    line << 0.0, 0.0, 5.0, 5.0, 10.0, 10.0;
    EXPECT_LT((make_warp(points, line, options).deform(line) - points).norm(), 1e-11);
  }
  // The centre of four points mirrored at an axis: the sum for the rotation is zero there.
  Points2 corners(4, 2);
  corners << 1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0;
  Points2 mirrored = corners;
  for (Index m = 0; m < 4; ++m) mirrored(m, 0) = -corners(m, 0);
  Points2 near_centre(1, 2);
  near_centre << 0.0, 0.0;
  EXPECT_LT(make_warp(near_centre, corners).deform(mirrored).norm(), 1e-12);
}

// Weights of what a vertex cannot reach are zero; without any it stays.
TEST(MlsWarp, LeavesUnreachedVerticesStill) {
  const Points2 points = random_points(4, 10.0, 10);
  const Points2 a = random_points(2, 10.0, 11);
  MatrixXd d = euclidean(points, a);
  const double infinity = std::numeric_limits<double>::infinity();
  d.row(1).setConstant(infinity);
  d(2, 0) = infinity;
  const MlsWarp warp(points, a, one_each(2), VectorXd::Ones(2), d, VectorXd::Ones(2));
  Points2 b = a;
  b.rowwise() += RowVector2d(100.0, 0.0);
  b(0, 1) += 50.0;
  const Points2 q = warp.deform(b);
  EXPECT_EQ((q.row(1) - points.row(1)).norm(), 0.0);
  EXPECT_LT((q.row(2) - points.row(2) - RowVector2d(100.0, 0.0)).norm(), 1e-12);
  EXPECT_EQ(warp.weights()(1, 0) + warp.weights()(1, 1), 0.0);
  EXPECT_EQ(warp.weights()(2, 1), 1.0);
}

// A rotation at a pin turns what is near by its angle; one pin with a rotation turns all.
TEST(MlsWarp, TurnsWithThePin) {
  const Points2 points = random_points(50, 100.0, 12);
  Points2 one(1, 2);
  one << 50.0, 50.0;
  const Points2 q = make_warp(points, one).deform(one, VectorXd::Constant(1, 0.5));
  Points2 centred = points;
  centred.rowwise() -= one.row(0);
  const Points2 expected = test::moved_rigidly(centred, 0.5, 50.0, 50.0);
  EXPECT_LT((q - expected).cwiseAbs().maxCoeff(), 1e-11);
  const Points2 a = random_points(4, 100.0, 21);
  for (const auto kind : {MlsKind::rigid, MlsKind::similarity, MlsKind::affine}) {
    MlsWarpOptions options;
    options.kind = kind;
    const MlsWarp warp = make_warp(points, a, options);
    EXPECT_LT((warp.deform(a, VectorXd::Zero(4)) - points).cwiseAbs().maxCoeff(), 1e-11);
    const Points2 turned =
        warp.deform(test::moved_rigidly(a, 0.5, 1.0, 2.0), VectorXd::Constant(4, 0.5));
    EXPECT_LT((turned - test::moved_rigidly(points, 0.5, 1.0, 2.0)).cwiseAbs().maxCoeff(), 1e-10);
  }
}

// The samples of a line move with its ends: collapsing them into the ends changes nothing.
TEST(MlsWarp, FoldsTheSamplesOfALineIntoItsEnds) {
  const Points2 points = random_points(30, 100.0, 13);
  Points2 ends(3, 2);
  ends << 0.0, 0.0, 100.0, 10.0, 20.0, 90.0;
  std::vector<ControlSample> samples = one_each(3);
  Points2 places(3 + 9, 2);
  places.topRows(3) = ends;
  const Points2 targets = random_points(3, 100.0, 14);
  Points2 all_targets(12, 2);
  all_targets.topRows(3) = targets;
  for (int i = 1; i < 10; ++i) {
    const double t = 0.1 * i;
    samples.push_back({0, 1, t});
    places.row(2 + i) = (1.0 - t) * ends.row(0) + t * ends.row(1);
    all_targets.row(2 + i) = (1.0 - t) * targets.row(0) + t * targets.row(1);
  }
  const MlsWarp folded(points, ends, samples, VectorXd::Ones(12), euclidean(points, places),
                       VectorXd::Ones(3));
  const Points2 expected = make_warp(points, places).deform(all_targets);
  EXPECT_LT((folded.deform(targets) - expected).cwiseAbs().maxCoeff(), 1e-9);
}

// csch falls off faster: beside one control it weighs the other less than any power does, and far
// away, where the thesis saw it fail, it stays finite.
TEST(MlsWarp, CanFallOffAsCsch) {
  Points2 points(2, 2);
  points << 0.0, 5.0, 1e6, 0.0;
  Points2 a(2, 2);
  a << 0.0, 0.0, 100.0, 0.0;
  MlsWarpOptions options;
  options.falloff = MlsFalloff::csch;
  options.scale_px = 5.0;
  const MatrixXd w = make_warp(points, a, options).weights();
  const double expected = std::sinh(1.0) / std::sinh(std::hypot(100.0, 5.0) / 5.0);
  EXPECT_NEAR(w(0, 1) / w(0, 0), expected, 1e-12 * expected);
  EXPECT_NEAR(w.row(1).sum(), 1.0, 1e-12);
}

TEST(MlsWarp, HasTheSameBitsForAnyNumberOfThreads) {
  const Points2 points = random_points(5000, 100.0, 15);
  const Points2 a = random_points(9, 100.0, 16);
  const Points2 b = random_points(9, 100.0, 17);
  set_thread_count(1);
  const Points2 one = make_warp(points, a).deform(b);
  set_thread_count(3);
  const Points2 three = make_warp(points, a).deform(b);
  set_thread_count(0);
  EXPECT_TRUE((one.array() == three.array()).all());
}

TEST(MlsWarp, RefusesWhatDoesNotFit) {
  const Points2 points = random_points(3, 1.0, 18);
  MlsWarpOptions options;
  options.alpha = 0.0;
  EXPECT_THROW(make_warp(points, points, options), InvalidArgument);
  EXPECT_THROW(make_warp(points, points).deform(points.topRows(2)), InvalidArgument);
  EXPECT_THROW(MlsWarp(points, points, one_each(3), VectorXd::Zero(3), euclidean(points, points),
                       VectorXd::Ones(3)),
               InvalidArgument);
}

// Eq. 7.27 to 7.30: interpolation, constants reproduced to the bit, bounds.
TEST(WarpDepth, InterpolatesAndReproducesConstants) {
  Points2 points = random_points(50, 100.0, 19);
  const Points2 a = random_points(4, 100.0, 20);
  points.topRows(4) = a;
  const MatrixXd w = make_warp(points, a).weights();
  VectorXd z(4);
  z << 3.0, -1.0, 0.5, 2.0;
  const VectorXd depth = interpolate_depth(w, z);
  EXPECT_LT((depth.head(4) - z).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_GE(depth.minCoeff(), -1.0 - 1e-12);
  EXPECT_LE(depth.maxCoeff(), 3.0 + 1e-12);
  EXPECT_TRUE((interpolate_depth(w, VectorXd::Constant(4, 0.3)).array() == 0.3).all());
}

// Farther triangles first, equal ones by number.
TEST(WarpDepth, PaintsFromFarToNear) {
  Triangles triangles(4, 3);
  triangles << 0, 1, 2, 3, 4, 5, 0, 1, 3, 0, 2, 1;
  VectorXd depth(6);
  depth << 1.0, 1.0, 1.0, -2.0, 0.0, 0.0;
  EXPECT_EQ(paint_order(triangles, depth), (std::vector<std::int32_t>{1, 2, 0, 3}));
  EXPECT_THROW(paint_order(triangles, depth.head(5)), InvalidArgument);
  depth[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(paint_order(triangles, depth), InvalidArgument);
}

}  // namespace
}  // namespace dupin
