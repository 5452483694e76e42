#include "dupin/registration/surface_samples.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"
#include "dupin/registration/icp.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using Eigen::Vector3d;

SurfaceSamples sample(const Mesh& mesh, double spacing, double radius) {
  return sample_surface(mesh.points, vertex_normals(mesh), {spacing, radius});
}

// Closed form: patches of a unit sphere tell the distance of any near point from it, up to the
// cubic rest of the height over the patch, and normals point along the radius.
TEST(SurfaceSamples, PatchesTellDistancesFromASphere) {
  const SurfaceSamples samples = sample(make_sphere(1.0, 20'000).mesh, 0.06, 0.1);
  ASSERT_GT(samples.points.rows(), 2000);
  Rng rng(1);
  int feet = 0;
  for (int i = 0; i < 500; ++i) {
    const RowVector3d direction =
        RowVector3d(rng.normal(), rng.normal(), rng.normal()).normalized();
    const double height = rng.uniform(-0.03, 0.03);
    const Index at = samples.near((1.0 + height) * direction);
    ASSERT_GE(at, 0);
    const auto foot = samples.foot(at, (1.0 + height) * direction);
    if (!foot) continue;
    ++feet;
    // Fourth order of the radius, and the slant of the patch: (height^2) / R.
    EXPECT_NEAR(foot->distance, height, 1e-4 + 0.03 * 0.03);
    EXPECT_GT(foot->normal.dot(direction), 0.999);
  }
  EXPECT_GT(feet, 450);
  for (Index i = 0; i < samples.points.rows(); ++i) {
    EXPECT_NEAR(samples.points.row(i).norm(), 1.0, 1e-4);
    EXPECT_EQ(samples.is_border[static_cast<std::size_t>(i)], 0);
  }
}

// Where the surface ends, samples know it; inside they do not.
TEST(SurfaceSamples, BordersAreWhereTheSurfaceEnds) {
  const Index side = 60;
  Points points(side * side, 3);
  for (Index i = 0; i < points.rows(); ++i)
    points.row(i) << static_cast<double>(i % side), static_cast<double>(i / side), 0.0;
  Points normals = Points::Zero(points.rows(), 3);
  normals.col(2).setOnes();
  const SurfaceSamples samples = sample_surface(points, normals, {3.0, 5.0});
  for (Index i = 0; i < samples.points.rows(); ++i) {
    const double x = samples.points(i, 0);
    const double y = samples.points(i, 1);
    const double edge = std::min(std::min(x, 59.0 - x), std::min(y, 59.0 - y));
    if (edge >= 5.0) {
      EXPECT_EQ(samples.is_border[static_cast<std::size_t>(i)], 0) << x << " " << y;
    }
    if (edge <= 1.0) {
      EXPECT_EQ(samples.is_border[static_cast<std::size_t>(i)], 1) << x << " " << y;
    }
  }
  EXPECT_EQ(samples.near(RowVector3d(1e9, 0.0, 0.0)), -1);
  EXPECT_FALSE(samples.foot(0, samples.points.row(0) + RowVector3d(40.0, 40.0, 0.0)).has_value());
}

TEST(SurfaceSamples, RefusesBadInput) {
  const Points points = Points::Random(50, 3);
  EXPECT_THROW(sample_surface(points, Points::Zero(49, 3), {1.0, 1.0}), InvalidArgument);
  EXPECT_THROW(sample_surface(points, points, {0.0, 1.0}), InvalidArgument);
  EXPECT_THROW(sample_surface(points, points, {1.0, std::numeric_limits<double>::quiet_NaN()}),
               InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(sample_surface(points, points, {1.0, 1.0}, run).status, Status::cancelled);
}

// An ellipsoid with three different axes holds every motion: a start that is off by several degrees
// and a spacing comes back to the truth, with the scale too when it is asked for.
TEST(Icp, ReturnsToTheTruth) {
  Mesh mesh = make_sphere(1.0, 10'000).mesh;
  mesh.points.col(0) *= 1.6;
  mesh.points.col(1) *= 1.25;
  const SurfaceSamples fixed = sample(mesh, 0.08, 0.14);
  Pose truth;
  truth.scale = 0.5;
  truth.rotation = rotation_of(Vector3d(0.3, -1.0, 0.4));
  truth.translation = Vector3d(1.0, 2.0, -0.5);
  Mesh moved = mesh;
  moved.points = transformed(mesh.points, inverse(truth));
  const SurfaceSamples moving = sample(moved, 0.16, 0.28);
  for (const bool with_scale : {false, true}) {
    Pose start = truth;
    start.rotation = rotation_of(Vector3d(0.05, 0.04, -0.06)) * truth.rotation;
    start.translation += Vector3d(0.03, -0.04, 0.02);
    if (with_scale) start.scale *= 1.03;
    IcpOptions options;
    options.with_scale = with_scale;
    const IcpResult result = refine_pose(moving, fixed, start, options);
    EXPECT_EQ(result.status, Status::ok);
    // Both sides are samples of one vertex set in different cells: what remains is the difference
    // of their patches.
    EXPECT_LT(rotation_angle(result.pose.rotation, truth.rotation), 2e-4);
    EXPECT_LT((transformed(moved.points, result.pose) - mesh.points).rowwise().norm().maxCoeff(),
              1e-3);
    EXPECT_NEAR(result.pose.scale / truth.scale, 1.0, with_scale ? 2e-4 : 1e-15);
  }
}

// A sphere may turn as it likes: the information has three directions without resistance.
TEST(Icp, SaysWhatASphereDoesNotResist) {
  const SurfaceSamples sphere = sample(make_sphere(1.0, 10'000).mesh, 0.08, 0.14);
  const IcpResult result = refine_pose(sphere, sphere, Pose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      result.information.topLeftCorner(6, 6));
  EXPECT_LT(eigen.eigenvalues()[2], 1e-4);
  EXPECT_GT(eigen.eigenvalues()[3], 0.2);
  EXPECT_GT(result.num_pairs, sphere.points.rows());
}

TEST(Icp, WithoutOverlapNothingMoves) {
  const SurfaceSamples sphere = sample(make_sphere(1.0, 4'000).mesh, 0.12, 0.2);
  Pose far;
  far.translation = Vector3d(10.0, 0.0, 0.0);
  const IcpResult result = refine_pose(sphere, sphere, far);
  EXPECT_EQ(result.status, Status::not_converged);
  EXPECT_EQ(result.num_pairs, 0);
  EXPECT_EQ((result.pose.translation - far.translation).norm(), 0.0);
  Pose bad;
  bad.scale = -1.0;
  EXPECT_THROW(refine_pose(sphere, sphere, bad), InvalidArgument);
  IcpOptions options;
  options.max_iterations = 0;
  EXPECT_THROW(refine_pose(sphere, sphere, far, options), InvalidArgument);
}

}  // namespace
}  // namespace dupin
