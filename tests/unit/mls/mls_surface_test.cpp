#include "dupin/mls/mls_surface.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;

// On a torus H and K agree with the closed form, better with every halving of the spacing: a cubic
// leaves an error of second order in the radius of the neighbourhood. Halving the spacing halves
// the radius of 100 neighbours.
TEST(EstimateCurvatureMls, ConvergesOnATorus) {
  double previous = 0.0;
  for (const Index count : {5'000, 20'000, 80'000}) {
    const AnalyticSurface torus = make_torus(1.0, 0.4, count);
    const MlsCurvature found =
        estimate_curvature_mls(torus.mesh.points, torus.normals, {.want_deviations = false});
    ASSERT_EQ(found.field.num_skipped, 0);
    const double error = std::sqrt((found.field.mean() - torus.mean).squaredNorm() /
                                   static_cast<double>(torus.mean.size()));
    if (previous > 0.0) {
      EXPECT_LT(error, previous / 3.0) << count;
    }  // second order: / 4
    previous = error;
  }
  EXPECT_LT(previous, 0.01);
}

// H = 1 / R, K = 1 / R^2, sign by the outward normals; without normals only the sign is open. The
// cubic leaves (rho / R)^2 / 4 of H, rho = .2 R the radius of 100 of 10,000 points.
TEST(EstimateCurvatureMls, OfASphereIsItsRadius) {
  const AnalyticSurface sphere = make_sphere(2.0, 10'000);
  const MlsCurvature found = estimate_curvature_mls(sphere.mesh.points, sphere.normals);
  EXPECT_NEAR(found.field.mean().minCoeff(), 0.5, 0.01 * 0.5 + 1e-3);
  EXPECT_NEAR(found.field.mean().maxCoeff(), 0.5, 0.01 * 0.5 + 1e-3);
  EXPECT_NEAR(found.field.gauss().minCoeff(), 0.25, 0.02 * 0.25);
  const MlsCurvature either = estimate_curvature_mls(sphere.mesh.points, Points(0, 3));
  EXPECT_NEAR(either.field.mean().cwiseAbs().minCoeff(), 0.5, 0.01 * 0.5 + 1e-3);
}

TEST(EstimateCurvatureMls, HasTheSameBitsForEveryThreadCount) {
  const AnalyticSurface surface = make_torus(1.0, 0.4, 3'000);
  const int before = thread_count();
  set_thread_count(1);
  const MlsCurvature one = estimate_curvature_mls(surface.mesh.points, surface.normals);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    const MlsCurvature many = estimate_curvature_mls(surface.mesh.points, surface.normals);
    EXPECT_EQ(one.field.k1, many.field.k1);
    EXPECT_EQ(one.mean_sd, many.mean_sd);
    EXPECT_EQ(one.projected, many.projected);
  }
  set_thread_count(before);
}

// Radius neighbourhoods: isolated points keep their place and have no curvature.
TEST(EstimateCurvatureMls, LeavesPointsWithoutNeighboursAlone) {
  AnalyticSurface plane = make_plane({.num_vertices = 400});
  Points points(plane.mesh.points.rows() + 1, 3);
  points.topRows(plane.mesh.points.rows()) = plane.mesh.points;
  points.bottomRows(1) << 50.0, 0.0, 0.0;
  MlsCurvatureOptions options;
  options.patch.radius = 0.5;
  const MlsCurvature found = estimate_curvature_mls(points, Points(0, 3), options);
  EXPECT_EQ(found.order[points.rows() - 1], 0);
  EXPECT_EQ(found.projected.row(points.rows() - 1), points.row(points.rows() - 1));
  EXPECT_EQ(found.field.num_skipped, 1);
  EXPECT_LT(found.field.mean().cwiseAbs().maxCoeff(), 1e-9);
}

// B4: the radial error of a noisy sphere falls more than four times by one projection, and
// projecting the result again with the same cloud does not move it (Eq. 4.14).
TEST(ProjectMls, SmoothsANoisySphereAndIsIdempotent) {
  const Mesh sphere = make_sphere(1.0, 10'000).mesh;
  const NoisyMesh noisy = add_noise(sphere, {.percent = 50.0, .seed = 1});
  const auto radial = [](const Points& points) {
    return std::sqrt((points.rowwise().norm().array() - 1.0).square().mean());
  };
  const MlsProjection once =
      project_mls(noisy.mesh.points, noisy.mesh.points, Points(0, 3), {.max_iterations = 1});
  EXPECT_LT(radial(once.points), 0.25 * radial(noisy.mesh.points));
  MlsProjectionOptions options;
  options.max_iterations = 30;
  options.patch.radius = 0.25;
  options.patch.weight_width = 0.3;  // a weight that ends near 0, else points come and go in steps
  const MlsProjection fixed =
      project_mls(noisy.mesh.points, noisy.mesh.points, Points(0, 3), options);
  ASSERT_EQ(fixed.status, Status::ok);
  const MlsProjection again = project_mls(fixed.points, noisy.mesh.points, Points(0, 3),
                                          {.patch = options.patch, .max_iterations = 1});
  EXPECT_LT(again.step.maxCoeff(), 1e-5);
}

TEST(ProjectMls, RefusesWhatIsOutOfRangeAndStopsWhenCancelled) {
  const Points points = make_sphere(1.0, 100).mesh.points;
  EXPECT_THROW(project_mls(points, points, Points(0, 3), {.max_iterations = 0}), InvalidArgument);
  EXPECT_THROW(project_mls(points, points, Points(3, 3)), InvalidArgument);
  EXPECT_THROW(estimate_curvature_mls(points.topRows(2), Points(0, 3)), AnalysisError);
  EXPECT_THROW(estimate_curvature_mls(points, Points(0, 3), {.noise_sigma = -1.0}),
               InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(project_mls(points, points, Points(0, 3), {}, run).status, Status::cancelled);
  EXPECT_EQ(estimate_curvature_mls(points, Points(0, 3), {}, run).status, Status::cancelled);
}

}  // namespace
}  // namespace dupin
