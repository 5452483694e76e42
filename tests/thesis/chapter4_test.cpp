// Tables of chapter 4. All of them, with every figure: bench/thesis_chapter4.cpp; why some differ:
// docs/methods/local_scale.md.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "dupin/mesh/noise.h"
#include "dupin/mls/local_scale.h"
#include "dupin/mls/mls_surface.h"
#include "dupin/mls/noise_level.h"
#include "dupin/spatial/neighborhoods.h"
#include "tests/support/thesis_surfaces.h"

namespace dupin {
namespace {

using Eigen::Index;
using thesis::Site;
using thesis::TorusPoint;

constexpr int kStep = 10;  // between two sizes
constexpr int kExperiments = 10;

const Site& sphere() {
  static const Site site = thesis::sphere();
  return site;
}

LocalScaleOptions options_for(const Site& site, double noise) {
  LocalScaleOptions options;
  options.draws = thesis_patch_draws(noise * site.edge);
  options.draws.experiments = kExperiments;
  return options;
}

LocalScale scale_at(const Site& site, double noise, int experiments = kExperiments) {
  LocalScaleOptions options = options_for(site, noise);
  options.draws.experiments = experiments;
  return find_local_scale(site.points, site.vertex, site.normal, options);
}

struct Averages {
  double beta5 = 0.0, beta7 = 0.0, gauss = 0.0, mean = 0.0;
};

// Every fourth point of the sphere, 100 neighbours.
Averages averages(double percent, std::uint64_t seed) {
  const NoisyMesh noisy =
      add_noise(make_icosphere(1.0, 6).mesh, {.percent = percent, .seed = seed});
  const Points& points = noisy.mesh.points;
  constexpr Index kStride = 4;
  const Index count = points.rows() / kStride;
  Points queries(count, 3);
  for (Index i = 0; i < count; ++i) queries.row(i) = points.row(i * kStride);
  const NeighborTable table = NeighborSearch(points).nearest(queries, 100);
  Averages sum;
  Points near(100, 3);
  for (Index i = 0; i < count; ++i) {
    for (Index j = 0; j < 100; ++j) near.row(j) = points.row(table.index(i, j));
    const MlsPatch patch = fit_mls_patch(queries.row(i), near, {}, queries.row(i));
    const PatchCurvature curvature = patch_curvature(patch.beta);
    sum.beta5 += patch.beta[4] / static_cast<double>(count);
    sum.beta7 += patch.beta[6] / static_cast<double>(count);
    sum.gauss += curvature.gauss / static_cast<double>(count);
    sum.mean += curvature.mean / static_cast<double>(count);
  }
  return sum;
}

// Mean over three draws of noise.
Averages averages(double percent) {
  Averages sum;
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const Averages one = averages(percent, seed);
    sum.beta5 += one.beta5 / 3.0;
    sum.beta7 += one.beta7 / 3.0;
    sum.gauss += one.gauss / 3.0;
    sum.mean += one.mean / 3.0;
  }
  return sum;
}

// The bias of the averages by noise: exact without noise but for the fourth order of the sphere (a
// cubic of radius .1: H off by .0023), then within 15 % for the coefficients and 8 % for H, whose
// printed values come from one sample of noise in an unstated direction. The mean of K at 1 l and
// beyond has no first-order meaning (its printed values rise again); only .5 l is compared.
TEST(Table41And42, ReproduceTheBiasOfCoefficientsAndCurvature) {
  const Averages ideal = averages(0.0);
  EXPECT_NEAR(ideal.beta5, -0.5, 0.002);
  EXPECT_NEAR(ideal.beta7, -0.5, 0.002);
  EXPECT_NEAR(ideal.gauss, 1.0, 0.006);
  EXPECT_NEAR(ideal.mean, 1.0, 0.003);
  struct Printed {
    double percent, beta5, beta7, mean;
  };
  double previous = ideal.mean;
  for (const Printed& printed : {Printed{50.0, -0.4814, -0.4750, 0.9521},
                                 {100.0, -0.3938, -0.3823, 0.7645},
                                 {150.0, -0.2674, -0.2720, 0.5261}}) {
    SCOPED_TRACE(printed.percent);
    const Averages found = averages(printed.percent);
    const double beta = 0.5 * (found.beta5 + found.beta7);
    const double expected = 0.5 * (printed.beta5 + printed.beta7);
    EXPECT_NEAR(beta, expected, 0.15 * std::abs(expected));
    EXPECT_NEAR(found.mean, printed.mean, 0.08 * printed.mean);
    EXPECT_LT(found.mean, previous);
    previous = found.mean;
    if (printed.percent == 50.0) {
      EXPECT_NEAR(found.gauss, 0.9011, 0.12 * 0.9011);
    }
  }
}

// T(beta) falls from about a thousand to its distribution between 60 and 70 neighbours, where the
// last linear eigenvalue drops below 1e-3; the values are within 15 %. At 60 the printed one,
// 517.7, still has one linear eigenvalue and ours two (E-15).
TEST(Table44, TheStatisticOfTheCoefficientsJumpsBetween60And70) {
  LocalScaleOptions options = options_for(sphere(), 0.5);
  // A single T has a deviation of 8.4 (35 degrees of freedom): the mean of 60 has one of 1.1, 3 %.
  options.draws.experiments = 60;
  options.sizes = {30, 40, 50, 60, 70, 80, 90, 100, 130, 200};
  options.stop_at_first_pass = false;
  const LocalScale scale =
      find_local_scale(sphere().points, sphere().vertex, sphere().normal, options);
  const std::array<double, 10> printed = {709.8, 864.0, 950.2, 517.7, 37.6,
                                          38.5,  38.1,  35.8,  37.3,  38.0};
  for (std::size_t i = 0; i < printed.size(); ++i) {
    const ScaleTest& test = scale.tests[i];
    SCOPED_TRACE(test.neighbors);
    if (test.neighbors == 60) {
      EXPECT_GT(test.T_beta, 500.0);
      EXPECT_GE(test.rank_beta, 8);
      continue;
    }
    EXPECT_NEAR(test.T_beta, printed[i], 0.15 * printed[i]);
    EXPECT_EQ(test.rank_beta, test.neighbors < 60 ? 9 : 7);
    EXPECT_EQ(test.T_beta <= test.critical_beta, test.neighbors >= 70);
  }
  // (K, H) is late by two steps, but falls to the 2 of one variable as printed.
  EXPECT_GT(scale.tests[0].T_kappa, 50.0);
  EXPECT_LT(scale.tests[8].T_kappa, 5.0);
}

void expect_row(const Site& site, const std::vector<double>& noises,
                const std::vector<int>& printed, int steps, int experiments = kExperiments) {
  int previous = 0;
  for (std::size_t i = 0; i < noises.size(); ++i) {
    SCOPED_TRACE(noises[i]);
    const LocalScale scale = scale_at(site, noises[i], experiments);
    ASSERT_TRUE(scale.passed());
    EXPECT_NEAR(scale.test().neighbors, printed[i], steps * kStep);
    EXPECT_GE(scale.test().neighbors, previous);
    previous = scale.test().neighbors;
  }
}

TEST(Table45, TheSizeGrowsWithTheNoiseOnASphere) {
  expect_row(sphere(), {0.2, 0.5, 0.8, 1.0, 1.5}, {30, 70, 100, 130, 210}, 2);
}

// The plane does not depend on (K, H): T(beta) alone, within one step.
TEST(Table46, TheSizesOnThePlaneAreWithinOneStep) {
  expect_row(thesis::plane(), {0.4, 0.6, 0.8, 1.0, 1.2, 1.4}, {60, 80, 110, 130, 160, 180}, 1);
}

// T(kappa) decides at the parabolic and elliptic points; its mean has a heavy tail, hence two
// steps.
TEST(Table46, TheSizesOnTheTorusAreWithinTwoSteps) {
  const std::vector<double> noises = {0.2, 0.4, 0.6, 0.8, 1.0, 1.2};
  constexpr int kMore = 60;
  expect_row(thesis::torus(TorusPoint::hyperbolic, false), noises, {70, 100, 130, 160, 200, 250}, 2,
             kMore);
  expect_row(thesis::torus(TorusPoint::parabolic, false), noises, {70, 100, 140, 170, 180, 200}, 2,
             kMore);
  expect_row(thesis::torus(TorusPoint::elliptic, false), noises, {70, 100, 130, 160, 190, 190}, 2,
             kMore);
}

// The radii of Table 4.7 at the printed sizes are those of a grid in both angles: density 1 / (R +
// r cos v). That is the evidence for the sampling of the torus.
TEST(Table47, TheRadiiAreThoseOfAGridInBothAngles) {
  struct Printed {
    TorusPoint where;
    int size;
    double radius;
  };
  for (const Printed& printed : {Printed{TorusPoint::hyperbolic, 260, 0.1135},
                                 {TorusPoint::hyperbolic, 100, 0.0713},
                                 {TorusPoint::parabolic, 250, 0.1508},
                                 {TorusPoint::parabolic, 140, 0.1130},
                                 {TorusPoint::elliptic, 250, 0.1925},
                                 {TorusPoint::elliptic, 130, 0.1378}}) {
    const Site site = thesis::torus(printed.where, false);
    const NeighborTable table =
        NeighborSearch(site.points).nearest(site.points.row(site.vertex), printed.size);
    EXPECT_NEAR(std::sqrt(table.squared(0, printed.size - 1)), printed.radius,
                0.05 * printed.radius);
  }
}

TEST(Table48, AQuarterOfThePointsNeedsHalfTheNeighbours) {
  const std::vector<double> noises = {0.2, 0.6, 1.0, 1.4};
  expect_row(thesis::torus(TorusPoint::hyperbolic, true), noises, {30, 60, 100, 140}, 2);
  expect_row(thesis::torus(TorusPoint::parabolic, true), noises, {30, 50, 80, 100}, 2);
  expect_row(thesis::torus(TorusPoint::elliptic, true), noises, {30, 60, 70, 90}, 2);
}

// Beyond some noise no size up to 300 passes. The printed limit is 200 to 280 %; with our rule, and
// a torus whose size is not known, it lies between 280 and 560 %.
TEST(Table410, BeyondSomeNoiseNoSizePasses) {
  const std::vector<double> noises = {0.4, 0.8, 1.2, 1.6};
  expect_row(thesis::torus(TorusPoint::hyperbolic, true), noises, {50, 80, 120, 180}, 3);
  expect_row(thesis::torus(TorusPoint::parabolic, true), noises, {50, 70, 90, 110}, 2);
  expect_row(thesis::torus(TorusPoint::elliptic, true), noises, {40, 70, 90, 100}, 2);
  for (const TorusPoint where :
       {TorusPoint::hyperbolic, TorusPoint::parabolic, TorusPoint::elliptic}) {
    EXPECT_FALSE(scale_at(thesis::torus(where, true), 5.6).passed());
  }
}

// The example of 4.2.4: 1000 samples of 20 points on a model of 75,000 vertices with noise of
// 2.862e-3 gave 2.877e-3, .5 % high. Its model is not named; on a bumpy sphere of as many vertices
// the estimate is within three standard errors of the truth, and these are below 1 %: 1000 patches
// with 10 degrees of freedom each know a deviation to 1 / sqrt(2 * 10,000) = .7 %, more where they
// share points. The printed error is within them too.
TEST(NoiseLevelExample, IsWithinThreeStandardErrorsOfTheTruth) {
  constexpr double kSigma = 2.862e-3;
  const Mesh mesh = make_bumpy_sphere(1.0, 75'000).surface.mesh;
  const double edge = add_noise(mesh, {.percent = 100.0}).sigma;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const NoisyMesh noisy = add_noise(mesh, {.percent = 100.0 * kSigma / edge, .seed = seed});
    ASSERT_NEAR(noisy.sigma, kSigma, 1e-12);
    const NoiseLevel level =
        estimate_noise(noisy.mesh.points, {.neighbors = 20, .num_samples = 1'000, .seed = seed});
    EXPECT_LT(level.sigma_standard_error, 0.01 * kSigma);
    EXPECT_GT(level.sigma_standard_error, 0.005 * kSigma);
    EXPECT_NEAR(level.sigma, kSigma, 3.0 * level.sigma_standard_error);
    EXPECT_NEAR(2.877e-3, kSigma, level.sigma_standard_error);
  }
}

}  // namespace
}  // namespace dupin
