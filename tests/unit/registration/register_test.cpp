#include "dupin/registration/register.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/shapes.h"
#include "dupin/registration/assessment.h"
#include "tests/support/data.h"
#include "tests/support/rugged_body.h"
#include "tests/support/scan_pair.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

Mesh rugged(std::uint64_t seed, Index vertices = 8'000) {
  return test::rugged_body(seed, vertices);
}

RegistrationOptions blind(bool estimate_scale) {
  RegistrationOptions options;
  options.estimate_scale = estimate_scale;
  options.try_given_pose = false;
  return options;
}

ScanFeatures as_cloud(const Mesh& mesh) {
  PointCloud cloud;
  cloud.points = mesh.points;
  return describe_scan(cloud);
}

test::ScanPair make_pair(std::uint64_t seed, double overlap, double noise, double scale_range) {
  test::ScanPairOptions options;
  options.overlap = overlap;
  options.noise_percent = noise;
  options.scale_range = scale_range;
  options.seed = seed;
  return test::make_scan_pair(rugged(40 + seed), options);
}

// Two parts of a surface that share half of it, sampled at other places, with noise, in any pose:
// the pose comes back within one degree and half a percent of the diameter, mesh on bare points and
// mesh on mesh.
TEST(Register, BringsPartialScansTogether) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const test::ScanPair pair = make_pair(seed, 0.5, seed % 2 == 0 ? 0.0 : 30.0, 1.0);
    const ScanFeatures moving = describe_scan(pair.moving);
    const ScanFeatures fixed = seed < 2 ? as_cloud(pair.fixed) : describe_scan(pair.fixed);
    const RegistrationResult result = register_scans(moving, fixed, blind(false));
    EXPECT_TRUE(result.accepted) << seed;
    const test::PoseError error = test::pose_error(result.pose, pair.truth, pair.moving.points);
    EXPECT_LT(error.rotation_deg, 1.0) << seed;
    EXPECT_LT(error.translation, 0.005 * pair.diameter) << seed;
    EXPECT_NEAR(result.best.fit.overlap_moving, pair.overlap, 0.12) << seed;
    EXPECT_GE(result.correspondences.size(), 3U) << seed;
    // What agrees on the pose is one set of matches, what does not another.
    EXPECT_FALSE(result.other_matches.empty()) << seed;
    EXPECT_LE(result.other_matches.size(), 800U) << seed;
    for (const FeaturePair& other : result.other_matches) {
      EXPECT_TRUE(std::none_of(result.correspondences.begin(), result.correspondences.end(),
                               [&](const FeaturePair& known) {
                                 return known.moving == other.moving && known.fixed == other.fixed;
                               }));
    }
  }
}

// The unit of the moving scan is unknown: its scale comes back within half a percent.
TEST(Register, FindsAnUnknownScale) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const test::ScanPair pair = make_pair(seed, 0.6, 10.0, 100.0);
    const RegistrationResult result =
        register_scans(describe_scan(pair.moving), describe_scan(pair.fixed), blind(true));
    EXPECT_TRUE(result.accepted) << seed;
    const test::PoseError error = test::pose_error(result.pose, pair.truth, pair.moving.points);
    EXPECT_LT(error.rotation_deg, 1.0) << seed;
    EXPECT_LT(std::abs(error.scale), 0.005) << seed;
  }
}

// Other objects, mirror images and parts that share nothing are refused, and the reason is told.
TEST(Register, RefusesWhatDoesNotBelongTogether) {
  const test::ScanPair pair = make_pair(1, 0.7, 0.0, 1.0);
  const ScanFeatures moving = describe_scan(pair.moving);
  const ScanFeatures other = describe_scan(rugged(99));
  const RegistrationResult different = register_scans(moving, other, blind(true));
  EXPECT_FALSE(different.accepted);
  EXPECT_NE(different.refusal, Refusal::none);
  const RegistrationResult mirror = register_scans(describe_scan(test::mirrored(pair.moving)),
                                                   describe_scan(pair.fixed), blind(false));
  EXPECT_FALSE(mirror.accepted);
  const Mesh whole = rugged(41);
  const Vector3d axis(0.3, 0.5, 1.0);
  const ScanFeatures low = describe_scan(test::slice(whole, axis, 0.0, 0.35));
  const ScanFeatures high = describe_scan(test::slice(whole, axis, 0.65, 1.0));
  EXPECT_FALSE(register_scans(low, high, blind(false)).accepted);
}

// A sphere turns and a plane slides on its like: no pose is told as the right one.
TEST(Register, RefusesWhatSlides) {
  const ScanFeatures sphere = describe_scan(make_sphere(1.0, 4'000).mesh);
  const RegistrationResult ball = register_scans(sphere, sphere, blind(false));
  EXPECT_FALSE(ball.accepted);
  Points points(2500, 3);
  for (Index i = 0; i < 2500; ++i)
    points.row(i) << static_cast<double>(i % 50), static_cast<double>(i / 50), 0.0;
  PointCloud plane;
  plane.points = points;
  RegistrationOptions options = blind(false);
  options.try_given_pose = true;
  const ScanFeatures flat = describe_scan(plane);
  const RegistrationResult slide = register_scans(flat, flat, options);
  EXPECT_FALSE(slide.accepted);
  EXPECT_EQ(slide.refusal, Refusal::undetermined);
}

// An ellipsoid fits on itself in four poses: the others are told.
TEST(Register, TellsOtherPosesOfASymmetricBody) {
  Mesh mesh = make_sphere(1.0, 6'000).mesh;
  mesh.points.col(0) *= 1.8;
  mesh.points.col(1) *= 1.35;
  const ScanFeatures body = describe_scan(mesh);
  const RegistrationResult result = register_scans(body, body, blind(false));
  EXPECT_TRUE(result.accepted);
  EXPECT_GE(result.alternatives.size(), 1U);
  for (const PoseCandidate& other : result.alternatives) {
    EXPECT_GT(rotation_angle(other.pose.rotation, result.pose.rotation), 0.5);
    EXPECT_GT(other.fit.overlap_moving, 0.9);
  }
}

// Turning the moving scan by Q turns the answer by Q^-1 (to the accuracy of the refinement: the
// grids that thin and sample the scan do not turn with it).
TEST(Register, FollowsTheScans) {
  const test::ScanPair pair = make_pair(2, 0.6, 0.0, 1.0);
  const ScanFeatures fixed = describe_scan(pair.fixed);
  const RegistrationResult first = register_scans(describe_scan(pair.moving), fixed, blind(false));
  Pose turn;
  turn.rotation = rotation_of(Vector3d(0.5, 1.5, -0.7));
  turn.translation = Vector3d(3.0, -1.0, 2.0);
  Mesh moved = pair.moving;
  moved.points = transformed(moved.points, turn);
  const RegistrationResult second = register_scans(describe_scan(moved), fixed, blind(false));
  ASSERT_TRUE(first.accepted && second.accepted);
  const Pose expected = compose(first.pose, inverse(turn));
  EXPECT_LT(rotation_angle(second.pose.rotation, expected.rotation), 2e-3);
}

// The same bits for any number of threads; a limit on the rotation is kept; cancelling ends it.
TEST(Register, ThreadsLimitsAndCancellation) {
  const test::ScanPair pair = make_pair(3, 0.6, 20.0, 1.0);
  const int before = thread_count();
  RegistrationResult results[2];
  for (int k = 0; k < 2; ++k) {
    set_thread_count(1 + 2 * k);
    results[k] = register_scans(describe_scan(pair.moving), as_cloud(pair.fixed), blind(false));
  }
  set_thread_count(before);
  EXPECT_EQ((results[0].pose.rotation - results[1].pose.rotation).norm(), 0.0);
  EXPECT_EQ((results[0].pose.translation - results[1].pose.translation).norm(), 0.0);
  EXPECT_EQ(results[0].best.confidence, results[1].best.confidence);

  const ScanFeatures moving = describe_scan(pair.moving);
  const ScanFeatures fixed = describe_scan(pair.fixed);
  RegistrationOptions limited = blind(false);
  limited.max_rotation = 1e-6;
  EXPECT_EQ(register_scans(moving, fixed, limited).refusal, Refusal::rotation);
  limited.min_confidence = 2.0;
  EXPECT_THROW(register_scans(moving, fixed, limited), InvalidArgument);
  EXPECT_THROW(describe_scan(PointCloud{Points::Zero(3, 3), Points(0, 3)}), AnalysisError);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(register_scans(moving, fixed, blind(false), run).status, Status::cancelled);
  EXPECT_EQ(describe_scan(pair.moving, {}, run).status, Status::cancelled);
}

// One point far away is no part of the object: the pose comes back all the same.
TEST(Register, AStrayPointDoesNotMatter) {
  test::ScanPair pair = make_pair(2, 0.6, 0.0, 1.0);
  PointCloud cloud;
  cloud.points = pair.fixed.points;
  cloud.points.row(17) *= 1e3;
  const RegistrationResult result =
      register_scans(describe_scan(pair.moving), describe_scan(cloud), blind(false));
  EXPECT_TRUE(result.accepted);
  const test::PoseError error = test::pose_error(result.pose, pair.truth, pair.moving.points);
  EXPECT_LT(error.rotation_deg, 1.0);
}

// Normals of bare points may lie on the wrong side: then what fits are their maps turned inside
// out.
TEST(Register, NormalsOfACloudMayPointInward) {
  const test::ScanPair pair = make_pair(1, 0.7, 0.0, 1.0);
  PointCloud inward;
  inward.points = pair.moving.points;
  inward.normals = -describe_scan(pair.moving).normals;
  ScanFeatures moving = describe_scan(inward);
  moving.has_sides = false;
  const RegistrationResult result = register_scans(moving, describe_scan(pair.fixed), blind(false));
  EXPECT_TRUE(result.accepted);
  EXPECT_TRUE(result.best.is_flipped);
  EXPECT_GE(result.correspondences.size(), 50U);  // 103; 16 by chance, of maps as they are
  const test::PoseError error = test::pose_error(result.pose, pair.truth, pair.moving.points);
  EXPECT_LT(error.rotation_deg, 1.0);
}

// What cannot be registered is refused by name, whatever its size: points at one place, coordinates
// that are no numbers in a cloud large enough to be thinned, normals of another number, features of
// a cancelled or of no scan.
TEST(Register, BadFeaturesAreNamed) {
  PointCloud cloud;
  cloud.points = Points::Zero(20'000, 3);
  for (Index i = 0; i < cloud.points.rows(); ++i)
    cloud.points.row(i) << static_cast<double>(i % 141), static_cast<double>(i / 141), 0.0;
  PointCloud bad = cloud;
  bad.points(19'000, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(describe_scan(bad), InvalidArgument);
  bad = cloud;
  bad.normals = Points::Zero(19'999, 3);
  EXPECT_THROW(describe_scan(bad), InvalidArgument);
  PointCloud one;
  one.points = Points::Constant(50, 3, 2.0);
  EXPECT_THROW(describe_scan(one), AnalysisError);
  const ScanFeatures none;
  EXPECT_THROW(register_scans(none, none, blind(false)), InvalidArgument);
  ScanFeatures cancelled;
  cancelled.status = Status::cancelled;
  EXPECT_EQ(register_scans(cancelled, cancelled, blind(false)).status, Status::cancelled);
}

// Of a refused pose no deviation is told; among the poses of a symmetric body the one within the
// limit is taken.
TEST(Register, LimitsChooseAmongEqualPoses) {
  Mesh mesh = make_sphere(1.0, 6'000).mesh;
  mesh.points.col(0) *= 1.8;
  mesh.points.col(1) *= 1.35;
  const ScanFeatures body = describe_scan(mesh);
  RegistrationOptions options = blind(false);
  options.max_rotation = 0.2;
  options.try_given_pose = true;
  const RegistrationResult result = register_scans(body, body, options);
  EXPECT_TRUE(result.accepted);
  EXPECT_LT(rotation_angle(Eigen::Matrix3d::Identity(), result.pose.rotation), 0.2);
  const RegistrationResult refused =
      register_scans(describe_scan(rugged(3, 3'000)), body, blind(false));
  EXPECT_FALSE(refused.accepted);
  EXPECT_EQ(refused.covariance.norm(), 0.0);
}

// A share of conflicts that few pairs tell is uncertain: it counts as what it may well be. Three in
// a hundred of thirty pairs may be fifteen; of a thousand it is little more than three.
TEST(Confidence, OfFewPairsIsLow) {
  PoseFit fit;
  fit.overlap_moving = fit.overlap_fixed = 0.15;
  fit.conflict = 1.0 / 32.0;
  fit.num_pairs = 31;
  const double few = detail::confidence_of(fit, 22);
  EXPECT_LT(few, RegistrationOptions().min_confidence);
  EXPECT_NEAR(detail::plain_confidence_of(fit, 22), 1.0 / (1.0 + std::exp(-6.0 + 100.0 / 32.0)),
              1e-9);
  fit.num_pairs = 992;
  const double many = detail::confidence_of(fit, 22);
  // Wilson's bound of 32 in 1024 is .0415: logit 6 - 4.15.
  EXPECT_NEAR(many, 1.0 / (1.0 + std::exp(-1.85)), 0.01);
  // Wilson's bound of no conflict in n is z^2 / (n + z^2): the limit is the bare logit.
  fit.conflict = 0.0;
  fit.num_pairs = 1'000'000'000;
  EXPECT_NEAR(detail::confidence_of(fit, 22), 1.0 / (1.0 + std::exp(-6.0)), 1e-6);
  fit.num_pairs = 32;
  const double z2 = 1.645 * 1.645;
  EXPECT_NEAR(detail::confidence_of(fit, 22),
              1.0 / (1.0 + std::exp(-6.0 + 100.0 * z2 / (32.0 + z2))), 1e-9);
  fit.num_pairs = 11;
  EXPECT_EQ(detail::confidence_of(fit, 22), 0.0);
  fit.conflict = 1.0;
  fit.num_pairs = 0;
  EXPECT_EQ(detail::confidence_of(fit, 22), 0.0);
}

Points real_points(const std::string& path) { return read_surface(path).mesh.points; }

// Two views of a bunny of 361 and 397 points lie on each other; the milk carton that stands beside
// them rests on the bunny with a few samples, one of which crosses it, and is refused.
TEST(Register, RealViewsAreToldFromAnotherObject) {
  DUPIN_REQUIRE_SHARED(first, "registration/bunny_views/bun0.pcd");
  DUPIN_REQUIRE_SHARED(second, "registration/bunny_views/bun4.pcd");
  DUPIN_REQUIRE_SHARED(other, "registration/bunny_views/milk.pcd");
  const ScanFeatures fixed = describe_scan(PointCloud{real_points(first), {}});
  const RegistrationResult same =
      register_scans(describe_scan(PointCloud{real_points(second), {}}), fixed, blind(false));
  EXPECT_TRUE(same.accepted);
  EXPECT_GT(same.best.fit.overlap_moving, 0.9);
  const RegistrationResult milk =
      register_scans(describe_scan(PointCloud{real_points(other), {}}), fixed, blind(false));
  EXPECT_FALSE(milk.accepted);
}

// First order: over many draws of the noise the pose scatters as its covariance says, within a
// factor that forty draws of six parameters leave (their mean of chi^2 / 6 has deviation .09), and
// what patches take from noise of neighbouring points.
TEST(Register, CovarianceIsTheScatterOfThePose) {
  const Mesh solid = rugged(7, 5'000);
  const double edge = 0.05;
  double sum = 0.0;
  const int runs = 40;
  Rng rng(8);
  for (int run = 0; run < runs; ++run) {
    Mesh first = solid;
    Mesh second = test::dual_mesh(solid);
    for (Points* points : {&first.points, &second.points}) {
      for (Index i = 0; i < points->size(); ++i) points->data()[i] += 0.2 * edge * rng.normal();
    }
    RegistrationOptions options;
    options.estimate_scale = false;  // the truth is the identity: start there
    const RegistrationResult result =
        register_scans(describe_scan(first), describe_scan(second), options);
    ASSERT_TRUE(result.accepted);
    const Eigen::AngleAxisd turn(result.pose.rotation);
    Eigen::Matrix<double, 6, 1> error;
    error.head<3>() = turn.angle() * turn.axis();
    error.tail<3>() =
        result.pose.rotation * result.center + result.pose.translation - result.center;
    sum += error.dot(result.covariance.topLeftCorner<6, 6>().ldlt().solve(error)) / 6.0;
  }
  EXPECT_GT(sum / runs, 0.5);
  EXPECT_LT(sum / runs, 2.0);
}

}  // namespace
}  // namespace dupin
