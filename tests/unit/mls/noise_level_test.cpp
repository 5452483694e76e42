#include "dupin/mls/noise_level.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "dupin/base/error.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

// Within 3 % of the truth at 10 to 100 % of the mean edge, on a torus and a bumpy sphere (B11).
TEST(EstimateNoise, IsWithinThreePercentOfTheTruth) {
  const Mesh surfaces[] = {make_torus(1.0, 0.4, 40'000).mesh,
                           make_bumpy_sphere(1.0, 40'000).surface.mesh};
  for (const Mesh& mesh : surfaces) {
    for (const double percent : {10.0, 20.0, 50.0, 80.0, 100.0}) {
      const NoisyMesh noisy = add_noise(mesh, {.percent = percent, .seed = 5});
      const NoiseLevel level = estimate_noise(noisy.mesh.points, {.num_samples = 4'000});
      std::printf("%g %% ratio %.4f +- %.4f\n", percent, level.sigma / noisy.sigma,
                  level.sigma_standard_error / noisy.sigma);
      EXPECT_NEAR(level.sigma / noisy.sigma, 1.0, 0.03) << percent;
    }
  }
}

}  // namespace
}  // namespace dupin
