#include "dupin/crest/crest_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/noise.h"
#include "tests/support/crest_surfaces.h"

namespace dupin {
namespace {

constexpr double kPercent = 10.0;

struct Fixture {
  test::CrestSurface surface = test::crest_gaussian_ridge(2500);
  SurfaceGraph graph = surface_graph(surface.mesh);
  CrestOptions options = {};
  CrestSet set = {};
  double sigma = 0.0;

  Fixture() {
    sigma = kPercent / 100.0 * graph.mean_edge;
    options.noise_sigma = sigma;
    set = find_crest_lines(graph, options);
  }
};

const CrestLine* ridge_of(const CrestSet& set) {
  for (const CrestLine& line : set.lines) {
    if (line.kind == CrestKind::ridge) return &line;
  }
  return nullptr;
}

// The mean strength of the ridge over noisy copies of the surface, found anew on each, deviates as
// the replicas say. 24 copies know a deviation to 1 / sqrt(46) = 15 %, 12 replicas to 20 %: three
// standard errors are 75 %.
TEST(CrestNoise, PredictsTheSpreadOfStrengths) {
  const Fixture at;
  ASSERT_EQ(at.set.lines.size(), 3U);
  const CrestUncertainties found =
      estimate_crest_uncertainty(at.graph, at.set, at.options, {.sigma = at.sigma});
  ASSERT_EQ(found.lines.size(), at.set.lines.size());
  double predicted = 0.0;
  for (std::size_t i = 0; i < found.lines.size(); ++i) {
    if (at.set.lines[i].kind == CrestKind::ridge) predicted = found.lines[i].strength_sd;
  }
  constexpr int kCopies = 24;
  double sum = 0.0;
  double squares = 0.0;
  for (int copy = 0; copy < kCopies; ++copy) {
    const NoisyMesh noisy =
        add_noise(at.surface.mesh, {.percent = kPercent,
                                    .model = NoiseModel::isotropic,
                                    .seed = 200 + static_cast<std::uint64_t>(copy)});
    const CrestSet set = find_crest_lines(surface_graph(noisy.mesh), at.options);
    const CrestLine* ridge = ridge_of(set);
    ASSERT_NE(ridge, nullptr);
    sum += ridge->strength;
    squares += ridge->strength * ridge->strength;
  }
  const double mean = sum / kCopies;
  const double sd = std::sqrt((squares - kCopies * mean * mean) / (kCopies - 1));
  EXPECT_GT(sd, predicted / 1.75);
  EXPECT_LT(sd, predicted * 1.75);
}

// To first order error bars are proportional to the noise; a quarter of a tenth of an edge moves
// little of second order.
TEST(CrestNoise, IsProportionalToTheNoise) {
  const Fixture at;
  const auto once = estimate_crest_uncertainty(at.graph, at.set, at.options,
                                               {.sigma = at.sigma, .num_replicas = 4});
  const auto half = estimate_crest_uncertainty(at.graph, at.set, at.options,
                                               {.sigma = 0.5 * at.sigma, .num_replicas = 4});
  for (std::size_t i = 0; i < once.lines.size(); ++i) {
    EXPECT_NEAR(half.lines[i].strength_sd, 0.5 * once.lines[i].strength_sd,
                0.05 * once.lines[i].strength_sd);
    EXPECT_NEAR(half.lines[i].position_sd, 0.5 * once.lines[i].position_sd,
                0.1 * once.lines[i].position_sd);
    EXPECT_GT(half.lines[i].snr, 1.7 * once.lines[i].snr);
    EXPECT_GT(once.lines[i].position_sd, 0.0);
    EXPECT_LT(once.lines[i].position_sd, at.graph.mean_edge);
    EXPECT_EQ(once.lines[i].point_sd.size(), at.set.lines[i].points.size());
  }
}

TEST(CrestNoise, IsTheSameForAnyNumberOfThreads) {
  const Fixture at;
  const int before = thread_count();
  set_thread_count(1);
  const auto a = estimate_crest_uncertainty(at.graph, at.set, at.options,
                                            {.sigma = at.sigma, .num_replicas = 4});
  set_thread_count(3);
  const auto b = estimate_crest_uncertainty(at.graph, at.set, at.options,
                                            {.sigma = at.sigma, .num_replicas = 4});
  set_thread_count(before);
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_EQ(a.lines[i].strength_sd, b.lines[i].strength_sd);
    EXPECT_EQ(a.lines[i].snr, b.lines[i].snr);
  }
}

TEST(CrestNoise, StopsWhenCancelledAndRefusesNonsense) {
  const Fixture at;
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(
      estimate_crest_uncertainty(at.graph, at.set, at.options, {.sigma = at.sigma}, run).status,
      Status::cancelled);
  EXPECT_THROW(estimate_crest_uncertainty(at.graph, at.set, at.options, {.sigma = 0.0}),
               InvalidArgument);
  EXPECT_THROW(estimate_crest_uncertainty(at.graph, at.set, at.options,
                                          {.sigma = at.sigma, .num_replicas = 3}),
               InvalidArgument);
  EXPECT_THROW(estimate_crest_uncertainty(surface_graph(make_sphere(1.0, 500).mesh), at.set,
                                          at.options, {.sigma = at.sigma}),
               InvalidArgument);
}

}  // namespace
}  // namespace dupin
