#include "dupin/registration/pose.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Points random_points(Eigen::Index count, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = rng.normal();
  return points;
}

Pose random_pose(std::uint64_t seed, double scale) {
  Rng rng(seed);
  Pose pose;
  pose.scale = scale;
  Vector3d axis(rng.normal(), rng.normal(), rng.normal());
  pose.rotation = rotation_of(axis.normalized() * rng.uniform(0.0, std::numbers::pi));
  pose.translation = 5.0 * Vector3d(rng.normal(), rng.normal(), rng.normal());
  return pose;
}

// Closed form: exact correspondences give the pose back, whatever its scale.
TEST(FitPose, RecoversAnExactSimilarity) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const double scale = std::pow(10.0, -2.0 + 4.0 * static_cast<double>(seed) / 99.0);
    const Pose truth = random_pose(seed, scale);
    const Points from = random_points(3 + static_cast<Eigen::Index>(seed % 7), 1000 + seed);
    const Pose pose = fit_pose(from, transformed(from, truth), {}, true);
    EXPECT_NEAR(pose.scale / truth.scale, 1.0, 1e-12);
    EXPECT_LT(rotation_angle(pose.rotation, truth.rotation), 1e-7);
    EXPECT_LT((pose.translation - truth.translation).norm(), 1e-10 * (1.0 + scale));
  }
}

// Without scale, stretched places leave the rotation alone and the scale at 1.
TEST(FitPose, KeepsScaleOneUnlessAsked) {
  const Points from = random_points(20, 5);
  Pose truth = random_pose(6, 3.0);
  const Pose pose = fit_pose(from, transformed(from, truth));
  EXPECT_EQ(pose.scale, 1.0);
  EXPECT_LT(rotation_angle(pose.rotation, truth.rotation), 1e-7);
}

// The best orthogonal map of a mirrored set is a reflection; the answer must still be a rotation,
// and the best one: no small turn of it fits better.
TEST(FitPose, NeverReflects) {
  const Points from = random_points(12, 7);
  Points to = from;
  to.col(0) *= -1.0;
  const Pose pose = fit_pose(from, to, {}, true);
  EXPECT_NEAR(pose.rotation.determinant(), 1.0, 1e-12);
  const auto cost = [&](const Matrix3d& rotation) {
    const Eigen::RowVector3d a = from.colwise().mean();
    const Eigen::RowVector3d b = to.colwise().mean();
    return ((pose.scale * (from.rowwise() - a) * rotation.transpose()) - (to.rowwise() - b))
        .squaredNorm();
  };
  Rng rng(8);
  for (int i = 0; i < 200; ++i) {
    const Vector3d turn(0.05 * rng.normal(), 0.05 * rng.normal(), 0.05 * rng.normal());
    EXPECT_GE(cost(rotation_of(turn) * pose.rotation), cost(pose.rotation) * (1.0 - 1e-12));
  }
}

// Points of weight zero do not count; three in one plane are enough.
TEST(FitPose, WeightsAndPlanarPoints) {
  Points from(4, 3);
  from << 0, 0, 0, 1, 0, 0, 0, 2, 0, 9, 9, 9;
  const Pose truth = random_pose(11, 1.0);
  Points to = transformed(from, truth);
  to.row(3).setConstant(-100.0);
  Eigen::VectorXd weights(4);
  weights << 1, 2, 1, 0;
  const Pose pose = fit_pose(from, to, weights);
  EXPECT_LT(rotation_angle(pose.rotation, truth.rotation), 1e-7);
  EXPECT_LT((pose.translation - truth.translation).norm(), 1e-10);
}

// Errors of the places of deviation s turn the pose by about s over the spread: the mean square of
// the angle is s^2 tr(I^-1) for the inertia I of the points.
TEST(FitPose, ErrorFollowsFirstOrder) {
  const Points from = random_points(50, 21);
  const Points centered = from.rowwise() - from.colwise().mean();
  const Matrix3d scatter = centered.transpose() * centered;
  const Matrix3d inertia = scatter.trace() * Matrix3d::Identity() - scatter;
  const double sigma = 1e-3;
  double sum = 0.0;
  const int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    const Points noise = random_points(50, 100 + static_cast<std::uint64_t>(run));
    const Pose pose = fit_pose(from, from + sigma * noise);
    sum += std::pow(rotation_angle(Matrix3d::Identity(), pose.rotation), 2);
  }
  // Sum of three squares over 2000 runs: relative standard deviation below sqrt(2 / 2000) = 3.2 %.
  EXPECT_NEAR(sum / runs / (sigma * sigma * inertia.inverse().trace()), 1.0, 0.13);
}

TEST(FitPose, RefusesWhatDeterminesNothing) {
  Points line(4, 3);
  line << 0, 0, 0, 1, 2, 3, 2, 4, 6, 5, 10, 15;
  const auto code_of = [](const auto& call) {
    try {
      call();
    } catch (const Error& error) {
      return error.code();
    }
    return std::string("none");
  };
  EXPECT_EQ(code_of([&] { fit_pose(line, line); }), "E_DEGENERATE");
  EXPECT_EQ(code_of([&] { fit_pose(Points::Zero(2, 3), Points::Zero(3, 3)); }), "E_OPTION");
  EXPECT_EQ(code_of([&] { fit_pose(Points::Zero(5, 3), Points::Zero(5, 3)); }), "E_DEGENERATE");
  const Points two = random_points(2, 1);
  EXPECT_EQ(code_of([&] { fit_pose(two, two); }), "E_DEGENERATE");
  Points bad = random_points(5, 2);
  const Points good = bad;
  bad(3, 1) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(code_of([&] { fit_pose(good, bad); }), "E_OPTION");
  EXPECT_EQ(code_of([&] { fit_pose(good, good, Eigen::VectorXd::Constant(5, -1.0)); }), "E_OPTION");
}

// inverse and compose form a group.
TEST(Pose, InverseUndoes) {
  const Pose a = random_pose(31, 2.5);
  const Pose b = random_pose(32, 0.01);
  const Points points = random_points(10, 33);
  const Points there = transformed(points, compose(b, a));
  EXPECT_LT((there - transformed(transformed(points, a), b)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((transformed(there, inverse(compose(b, a))) - points).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_LT((turned(points, a).rowwise().norm() - points.rowwise().norm()).cwiseAbs().maxCoeff(),
            1e-12);
}

// acos of the trace loses half the digits near 0 and pi; the angle here does not.
TEST(Pose, AnglesNearZeroAndPi) {
  for (const double angle : {0.0, 1e-9, 1e-4, 1.0, std::numbers::pi - 1e-4, std::numbers::pi}) {
    const Matrix3d turn = rotation_of(angle * Vector3d(1, 2, -2) / 3.0);
    EXPECT_NEAR(rotation_angle(Matrix3d::Identity(), turn), angle, 1e-14);
    EXPECT_LT((nearest_rotation(turn + 1e-9 * Matrix3d::Ones()) - turn).norm(), 1e-8);
  }
}

}  // namespace
}  // namespace dupin
