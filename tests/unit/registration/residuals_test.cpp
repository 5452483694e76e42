#include "dupin/registration/residuals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/shapes.h"
#include "dupin/registration/refine_scans.h"
#include "tests/support/rugged_body.h"
#include "tests/support/scan_pair.h"

namespace dupin {
namespace {

using Eigen::Index;

ScanFeatures sphere_of(double radius, Index points) {
  return describe_scan(make_sphere(radius, points).mesh);
}

double share(const std::vector<Contact>& contacts, Contact one) {
  return static_cast<double>(std::count(contacts.begin(), contacts.end(), one)) /
         static_cast<double>(contacts.size());
}

// A sphere of radius 1.01 lies .01 outside of that of radius 1, which lies .01 inside of it:
// heights over the patches are those, to a quadratic patch's error on a sphere of O((radius / 1)^4)
// = 1e-4.
TEST(Residuals, OfTwoSpheresAreTheirDifference) {
  const ScanFeatures large = sphere_of(1.01, 4'000);
  const ScanFeatures small = sphere_of(1.0, 3'000);
  const ScanResiduals residuals = compute_residuals(large, small, Pose());
  ASSERT_EQ(residuals.moving.size(), large.points.rows());
  ASSERT_EQ(residuals.fixed.size(), small.points.rows());
  EXPECT_EQ(share(residuals.moving_contact, Contact::none), 0.0);
  EXPECT_EQ(share(residuals.fixed_contact, Contact::none), 0.0);
  EXPECT_NEAR(residuals.moving.minCoeff(), 0.01, 5e-4);
  EXPECT_NEAR(residuals.moving.maxCoeff(), 0.01, 5e-4);
  EXPECT_NEAR(residuals.fixed.minCoeff(), -0.01, 5e-4);
  EXPECT_NEAR(residuals.fixed.maxCoeff(), -0.01, 5e-4);
}

// What rests and what is apart follows from the bound alone. Seen from three bounds out, the patch
// near a point need not reach below it: a few have no contact.
TEST(Residuals, TellContactFromDistance) {
  const ScanFeatures small = sphere_of(1.0, 3'000);
  const double bound = compute_residuals(small, small, Pose()).touching_bound;
  EXPECT_GT(bound, 0.0);
  const ScanResiduals near = compute_residuals(sphere_of(1.0 + 0.5 * bound, 3'000), small, Pose());
  EXPECT_EQ(share(near.moving_contact, Contact::touching), 1.0);
  EXPECT_EQ(share(near.fixed_contact, Contact::touching), 1.0);
  const ScanResiduals far = compute_residuals(sphere_of(1.0 + 3.0 * bound, 3'000), small, Pose());
  EXPECT_EQ(share(far.moving_contact, Contact::touching), 0.0);
  EXPECT_EQ(share(far.fixed_contact, Contact::touching), 0.0);
  EXPECT_GT(share(far.moving_contact, Contact::apart), 0.95);
  EXPECT_GT(share(far.fixed_contact, Contact::apart), 0.95);
}

// Heights are lengths of the fixed scan, whatever unit and frame the moving one has.
TEST(Residuals, DoNotDependOnTheFrameOfTheMovingScan) {
  const ScanFeatures small = sphere_of(1.0, 3'000);
  const Mesh large = make_sphere(1.01, 4'000).mesh;
  const ScanResiduals here = compute_residuals(describe_scan(large), small, Pose());
  const Pose pose = test::random_pose(2.0, 100.0, 7);
  const Mesh there{transformed(large.points, inverse(pose)), large.triangles};
  const ScanResiduals moved = compute_residuals(describe_scan(there), small, pose);
  EXPECT_NEAR(moved.touching_bound, here.touching_bound, 0.02 * here.touching_bound);
  // The grid of the samples lies elsewhere: other patches, with their own error of 1e-4.
  EXPECT_LT((moved.moving - here.moving).cwiseAbs().maxCoeff(), 5e-4);
  EXPECT_NEAR(moved.fixed.mean(), here.fixed.mean(), 2e-4);
}

// Normals that point inward turn the sign of a cloud's heights; is_flipped turns it back.
TEST(Residuals, OfAFlippedCloudHaveTheSignOfTheFixedScan) {
  const Mesh large = make_sphere(1.01, 4'000).mesh;
  PointCloud inward;
  inward.points = large.points;
  inward.normals = -large.points.rowwise().normalized();
  const ScanFeatures small = sphere_of(1.0, 3'000);
  const ScanFeatures cloud = describe_scan(inward);
  const ScanResiduals flipped = compute_residuals(cloud, small, Pose(), true);
  EXPECT_EQ(share(flipped.moving_contact, Contact::none), 0.0);
  EXPECT_NEAR(flipped.moving.mean(), 0.01, 5e-4);
  EXPECT_NEAR(flipped.fixed.mean(), -0.01, 5e-4);
  // As they are, the surfaces face each other's back: nothing is in contact.
  const ScanResiduals facing = compute_residuals(cloud, small, Pose(), false);
  EXPECT_EQ(share(facing.moving_contact, Contact::none), 1.0);
}

// Same bits for any number of threads; nothing where it was cancelled; refusals before any work.
TEST(Residuals, KeepTheContract) {
  const ScanFeatures small = sphere_of(1.0, 3'000);
  const ScanFeatures large = sphere_of(1.01, 3'000);
  set_thread_count(1);
  const ScanResiduals one = compute_residuals(large, small, Pose());
  set_thread_count(3);
  const ScanResiduals three = compute_residuals(large, small, Pose());
  set_thread_count(0);
  EXPECT_EQ(one.moving, three.moving);
  EXPECT_EQ(one.fixed_contact, three.fixed_contact);
  const RunControl run = RunControl::create();
  run.cancel();
  const ScanResiduals cancelled = compute_residuals(large, small, Pose(), false, run);
  EXPECT_EQ(cancelled.status, Status::cancelled);
  EXPECT_EQ(cancelled.moving.size(), 0);
  EXPECT_THROW(compute_residuals(ScanFeatures(), small, Pose()), InvalidArgument);
  Pose bad;
  bad.scale = 0.0;
  EXPECT_THROW(compute_residuals(large, small, bad), InvalidArgument);
  bad.scale = 1.0;
  bad.translation[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(compute_residuals(large, small, bad), InvalidArgument);
}

// A start three degrees and a few edges off comes to the truth, as meshes and as bare clouds whose
// outer side nobody knows.
TEST(RefineScans, BringsANearPoseToTheTruth) {
  test::ScanPairOptions options;
  options.overlap = 0.6;
  options.noise_percent = 10.0;
  options.seed = 3;
  const test::ScanPair pair = test::make_scan_pair(test::rugged_body(43, 8'000), options);
  Pose off;
  off.rotation = rotation_of({0.03, -0.03, 0.03});
  off.translation = Eigen::Vector3d(0.02, -0.01, 0.02) * pair.diameter;
  const Pose start = compose(off, pair.truth);
  const ScanFeatures fixed = describe_scan(pair.fixed);
  PointCloud inward;
  inward.points = pair.moving.points;
  inward.normals = -vertex_normals(pair.moving);
  ScanFeatures turned_over = describe_scan(inward);
  turned_over.has_sides = false;
  ASSERT_GT(test::pose_error(start, pair.truth, pair.moving.points).rotation_deg, 2.0);
  for (const ScanFeatures& moving : {describe_scan(pair.moving), turned_over}) {
    const RefinedPose refined = refine_scans(moving, fixed, start);
    EXPECT_EQ(refined.status, Status::ok);
    EXPECT_EQ(refined.is_flipped, !moving.has_sides);
    EXPECT_GT(refined.num_pairs, 100);
    const test::PoseError error = test::pose_error(refined.pose, pair.truth, pair.moving.points);
    EXPECT_LT(error.rotation_deg, 0.3);
    EXPECT_LT(error.translation, 0.002 * pair.diameter);
    EXPECT_EQ(refined.pose.scale, start.scale);
  }
}

// Scans that do not meet stay where they are, and the result says that they do not.
TEST(RefineScans, LeavesWhatDoesNotMeet) {
  const ScanFeatures ball = sphere_of(1.0, 2'000);
  Pose far;
  far.translation = Eigen::Vector3d(50.0, 0.0, 0.0);
  const RefinedPose refined = refine_scans(ball, ball, far);
  EXPECT_EQ(refined.num_pairs, 0);
  EXPECT_EQ(refined.pose.translation, far.translation);
  EXPECT_THROW(refine_scans(ScanFeatures(), ball, far), InvalidArgument);
  far.scale = -1.0;
  EXPECT_THROW(refine_scans(ball, ball, far), InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(refine_scans(ball, ball, Pose(), run).status, Status::cancelled);
}

}  // namespace
}  // namespace dupin
