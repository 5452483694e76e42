// Do the error bars of patches hold, and is the noise of a surface found? Three tables in Markdown:
//
// 1. coverage of nominal 95 % intervals of curvature, normal and height, over the size of the
// noise;
// 2. estimated noise over the truth on a torus and a bumpy sphere, 40,000 points, 4,000 samples;
// 3. the example of the thesis (4.2.4): 75,000 vertices, sigma 2.862e-3, 1000 samples of 20 points.
//
// mls_statistics [--draws 4000] [--seeds 20]
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mls/noise_level.h"
#include "tests/support/patch_coverage.h"

namespace {

using dupin::Mesh;
using dupin::NoiseLevel;

void print_coverage(int draws) {
  std::printf(
      "\nCoverage of nominal 95 %% intervals, %d draws, 100 points, Gaussian weights; sigma over "
      "the "
      "radius of the patch\n\n| sigma / rho | H | K | normal | height |\n|---|---|---|---|---|\n",
      draws);
  for (const double sigma : {0.01, 0.05, 0.10, 0.15, 0.20, 0.30}) {
    const dupin::test::Coverage c = dupin::test::coverage_of(sigma, draws, {});
    const auto share = [&](int hits) { return static_cast<double>(hits) / c.draws; };
    std::printf("| %.2f | %.3f | %.3f | %.3f | %.3f |\n", sigma, share(c.mean), share(c.gauss),
                share(c.normal), share(c.coefficient));
    std::fflush(stdout);
  }
}

struct Ratios {
  double mean = 0.0;       // of the estimates over the truth
  double deviation = 0.0;  // of one estimate
  double claimed = 0.0;    // mean standard error that the function reports
};

Ratios ratios_of(const Mesh& mesh, double percent, Eigen::Index samples, int seeds) {
  Ratios out;
  double squares = 0.0;
  for (int seed = 0; seed < seeds; ++seed) {
    const auto s = static_cast<std::uint64_t>(seed);
    const dupin::NoisyMesh noisy = dupin::add_noise(mesh, {.percent = percent, .seed = s});
    const NoiseLevel level =
        dupin::estimate_noise(noisy.mesh.points, {.num_samples = samples, .seed = s});
    const double ratio = level.sigma / noisy.sigma;
    out.mean += ratio / seeds;
    out.claimed += level.sigma_standard_error / noisy.sigma / seeds;
    squares += ratio * ratio / seeds;
  }
  out.deviation =
      std::sqrt(std::max(0.0, squares - out.mean * out.mean) * seeds / std::max(1, seeds - 1));
  return out;
}

void print_noise(int seeds) {
  std::printf(
      "\nEstimated noise over the truth, 40,000 points, 4,000 samples, %d seeds: mean, deviation "
      "of "
      "one estimate, standard error it claims\n\n| noise [%% of the mean edge] | torus | sd | "
      "claimed | bumpy sphere | sd | claimed |\n|---|---|---|---|---|---|---|\n",
      seeds);
  const std::vector<Mesh> surfaces = {dupin::make_torus(1.0, 0.4, 40'000).mesh,
                                      dupin::make_bumpy_sphere(1.0, 40'000).surface.mesh};
  for (const double percent : {10.0, 20.0, 50.0, 80.0, 100.0}) {
    std::printf("| %.0f ", percent);
    for (const Mesh& mesh : surfaces) {
      const Ratios r = ratios_of(mesh, percent, 4'000, seeds);
      std::printf("| %.4f | %.4f | %.4f ", r.mean, r.deviation, r.claimed);
      std::fflush(stdout);
    }
    std::printf("|\n");
  }
}

void print_example(int seeds) {
  constexpr double kSigma = 2.862e-3;
  const Mesh mesh = dupin::make_bumpy_sphere(1.0, 75'000).surface.mesh;
  const double whole = dupin::add_noise(mesh, {.percent = 100.0}).sigma;
  const Ratios r = ratios_of(mesh, 100.0 * kSigma / whole, 1'000, seeds);
  std::printf(
      "\nThe example of 4.2.4: sigma 2.862e-3 along the normals, 1000 samples of 20 points\n\n| "
      "surface | vertices | estimate | error [%%] | sd of one estimate [%%] | claimed [%%] |\n"
      "|---|---|---|---|---|---|\n| thesis, Fig. 4.5 | 75K | 2.877e-3 | +0.5 | | |\n| bumpy "
      "sphere, "
      "%d seeds | %d | %.3fe-3 | %+.2f | %.2f | %.2f |\n",
      seeds, static_cast<int>(mesh.points.rows()), 1e3 * kSigma * r.mean, 100.0 * (r.mean - 1.0),
      100.0 * r.deviation, 100.0 * r.claimed);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Error bars of patches and the noise of a surface against the truth");
  int draws = 4000;
  int seeds = 20;
  app.add_option("--draws", draws, "Draws of a row of the first table")
      ->check(CLI::Range(100, 10'000'000))
      ->capture_default_str();
  app.add_option("--seeds", seeds, "Seeds of the others")
      ->check(CLI::Range(2, 10'000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  print_coverage(draws);
  print_noise(seeds);
  print_example(seeds);
  return 0;
}
