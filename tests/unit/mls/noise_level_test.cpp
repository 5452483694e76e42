#include "dupin/mls/noise_level.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr double kSigma = 0.05;

// Points spread evenly over a square of spacing 1, with noise in z.
Points noisy_plane(Index count, std::uint64_t seed) {
  Rng rng(seed);
  const double side = std::sqrt(static_cast<double>(count));
  Points points(count, 3);
  for (Index v = 0; v < count; ++v) {
    points.row(v) << rng.uniform(0.0, side), rng.uniform(0.0, side), kSigma * rng.normal();
  }
  return points;
}

// Within 3 % of the truth at 10 to 100 % of the mean edge, on a torus and a bumpy sphere (B11).
TEST(EstimateNoise, IsWithinThreePercentOfTheTruth) {
  const Mesh surfaces[] = {make_torus(1.0, 0.4, 40'000).mesh,
                           make_bumpy_sphere(1.0, 40'000).surface.mesh};
  for (const Mesh& mesh : surfaces) {
    for (const double percent : {10.0, 20.0, 50.0, 80.0, 100.0}) {
      const NoisyMesh noisy = add_noise(mesh, {.percent = percent, .seed = 5});
      const NoiseLevel level = estimate_noise(noisy.mesh.points, {.num_samples = 4'000});
      EXPECT_NEAR(level.sigma / noisy.sigma, 1.0, 0.03)
          << percent << ", standard error " << level.sigma_standard_error / noisy.sigma;
    }
  }
}

// The scatter of the estimate over draws is what it says of itself. 60 draws know a deviation to
// 9 %; on few points the stated error is that of the degrees of freedom, up to 1.4 times too large.
TEST(EstimateNoise, ItsStandardErrorIsTheScatterOfTheEstimate) {
  constexpr int kDraws = 60;
  for (const Index count : {40, 100, 400, 2500}) {
    double sum = 0.0;
    double squares = 0.0;
    double stated = 0.0;
    for (int draw = 0; draw < kDraws; ++draw) {
      const NoiseLevel level = estimate_noise(
          noisy_plane(count, static_cast<std::uint64_t>(1000 * count + draw)), {.num_samples = 0});
      sum += level.sigma;
      squares += level.sigma * level.sigma;
      stated += level.sigma_standard_error / kDraws;
    }
    const double mean = sum / kDraws;
    const double scatter = std::sqrt((squares / kDraws - mean * mean) * kDraws / (kDraws - 1.0));
    EXPECT_GT(stated, 0.8 * scatter) << count;
    EXPECT_LT(stated, 1.6 * scatter) << count;
    EXPECT_NEAR(mean, kSigma, 4.0 * scatter / std::sqrt(kDraws) + 0.02 * kSigma) << count;
  }
}

// A merged scan holds points twice. They are no evidence that there is less noise.
TEST(EstimateNoise, RepeatedPointsChangeNothing) {
  const Points once = noisy_plane(900, 3);
  const NoiseLevel plain = estimate_noise(once);
  Points twice(2 * once.rows(), 3);
  twice << once, once;
  const NoiseLevel level = estimate_noise(twice);
  EXPECT_EQ(level.sigma, plain.sigma);
  EXPECT_EQ(level.sigma_standard_error, plain.sigma_standard_error);
  EXPECT_EQ(level.num_repeated, once.rows());
  EXPECT_EQ(level.first_repeated, once.rows());
  EXPECT_EQ(plain.num_repeated, 0);
}

TEST(EstimateNoise, ScalesWithTheUnitAndNotWithThreads) {
  const Points points = noisy_plane(900, 4);
  set_thread_count(1);
  const NoiseLevel one = estimate_noise(points);
  set_thread_count(8);
  const NoiseLevel eight = estimate_noise(points);
  set_thread_count(0);
  EXPECT_EQ(one.sigma, eight.sigma);
  EXPECT_EQ(one.sigma_standard_error, eight.sigma_standard_error);
  const NoiseLevel large = estimate_noise(Points(1024.0 * points));
  EXPECT_DOUBLE_EQ(large.sigma, 1024.0 * one.sigma);
}

// One cubic through as many points leaves nothing to estimate from; what is left is said.
TEST(EstimateNoise, RefusesWhatItCannotJudge) {
  const Points points = noisy_plane(100, 5);
  EXPECT_THROW(estimate_noise(points.topRows(10)), AnalysisError);
  EXPECT_THROW(estimate_noise(points, {.neighbors = 10}), InvalidArgument);
  EXPECT_THROW(estimate_noise(points, {.num_samples = -1}), InvalidArgument);
  Points broken = points;
  broken(7, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(estimate_noise(broken), InvalidArgument);
  Points line(50, 3);
  for (Index v = 0; v < 50; ++v)
    line.row(v) = static_cast<double>(v) * Eigen::RowVector3d(1.0, 2.0, 3.0);
  EXPECT_THROW(estimate_noise(line), AnalysisError);
  const NoiseLevel one = estimate_noise(points, {.num_samples = 1});
  EXPECT_GT(one.sigma_standard_error, 0.1 * one.sigma);  // ten degrees of freedom
}

TEST(EstimateNoise, ACancelledRunSaysSo) {
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(estimate_noise(noisy_plane(100, 6), {}, run).status, Status::cancelled);
}

}  // namespace
}  // namespace dupin
