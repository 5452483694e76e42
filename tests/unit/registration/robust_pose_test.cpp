#include "dupin/registration/robust_pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

struct Matches {
  Points from;
  Points to;
  Pose truth;
};

// Points of the unit ball; a share of the places is random, the rest right but for noise.
Matches make_matches(Index count, double outliers, double sigma, double scale, std::uint64_t seed) {
  Rng rng(seed);
  Matches matches;
  matches.truth.scale = scale;
  Vector3d axis(rng.normal(), rng.normal(), rng.normal());
  matches.truth.rotation = rotation_of(axis.normalized() * rng.uniform(0.0, std::numbers::pi));
  matches.truth.translation = Vector3d(rng.normal(), rng.normal(), rng.normal());
  matches.from.resize(count, 3);
  for (Index i = 0; i < matches.from.size(); ++i) matches.from.data()[i] = rng.uniform(-0.5, 0.5);
  matches.to = transformed(matches.from, matches.truth);
  for (Index i = 0; i < count; ++i) {
    const bool is_wrong = rng.uniform() < outliers;
    for (Index k = 0; k < 3; ++k) {
      matches.to(i, k) += is_wrong ? scale * rng.uniform(-1.5, 1.5) : sigma * rng.normal();
    }
  }
  return matches;
}

// 95 % of a thousand matches are wrong, the rest has noise of a hundredth: the pose is found within
// a degree, with known and with unknown scale.
TEST(RobustPose, SurvivesNineteenWrongMatchesOfTwenty) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const bool with_scale = seed % 2 == 1;
    const double scale = with_scale ? std::pow(10.0, -1.0 + 0.3 * static_cast<double>(seed)) : 1.0;
    const Matches matches = make_matches(1000, 0.95, 0.01 * scale, scale, seed);
    RobustPoseOptions options;
    options.noise_bound = 0.04 * scale;
    options.with_scale = with_scale;
    const RobustPose found = robust_pose(matches.from, matches.to, options);
    ASSERT_TRUE(found.is_found);
    EXPECT_LT(
        rotation_angle(found.pose.rotation, matches.truth.rotation) * 180.0 / std::numbers::pi,
        1.0 + (with_scale ? 0.5 : 0.0))
        << seed;
    EXPECT_NEAR(found.pose.scale / scale, 1.0, with_scale ? 0.03 : 1e-15);
  }
}

// Without a common pose there is none: random places agree on less than four matches in a hundred.
TEST(RobustPose, RandomMatchesAgreeOnLittle) {
  for (std::uint64_t seed = 50; seed < 55; ++seed) {
    const Matches matches = make_matches(200, 1.0, 0.0, 1.0, seed);
    RobustPoseOptions options;
    options.noise_bound = 0.02;
    EXPECT_LT(robust_pose(matches.from, matches.to, options).inliers.size(), 9U);
  }
}

// The same bits for any number of threads.
TEST(RobustPose, ThreadsDoNotMatter) {
  const Matches matches = make_matches(600, 0.9, 0.005, 1.0, 77);
  RobustPoseOptions options;
  options.noise_bound = 0.02;
  const int before = thread_count();
  set_thread_count(1);
  const RobustPose one = robust_pose(matches.from, matches.to, options);
  set_thread_count(3);
  const RobustPose three = robust_pose(matches.from, matches.to, options);
  set_thread_count(before);
  EXPECT_EQ(one.inliers, three.inliers);
  EXPECT_EQ((one.pose.rotation - three.pose.rotation).norm(), 0.0);
}

TEST(RobustPose, RefusesBadInputAndHeedsCancellation) {
  RobustPoseOptions options;
  EXPECT_THROW(robust_pose(Points::Zero(3, 3), Points::Zero(3, 3), options), InvalidArgument);
  options.noise_bound = 0.1;
  EXPECT_THROW(robust_pose(Points::Zero(3, 3), Points::Zero(4, 3), options), InvalidArgument);
  EXPECT_THROW(robust_pose(Points::Zero(9000, 3), Points::Zero(9000, 3), options), Error);
  EXPECT_THROW(robust_pose(Points::Constant(5, 3, 1e200), Points::Zero(5, 3), options),
               InvalidArgument);
  EXPECT_FALSE(robust_pose(Points::Zero(0, 3), Points::Zero(0, 3), options).is_found);
  EXPECT_FALSE(robust_pose(Points::Zero(50, 3), Points::Zero(50, 3), options).is_found);
  const RunControl run = RunControl::create();
  run.cancel();
  const Matches matches = make_matches(100, 0.5, 0.0, 1.0, 3);
  EXPECT_EQ(robust_pose(matches.from, matches.to, options, run).status, Status::cancelled);
}

}  // namespace
}  // namespace dupin
