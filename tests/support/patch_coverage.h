#pragma once

#include <cmath>
#include <cstdint>

#include "dupin/base/random.h"
#include "dupin/mls/mls_patch.h"
#include "dupin/mls/propagation.h"

namespace dupin::test {

// A sheet with two different curvatures, the first point at its middle.
inline Points sheet(Eigen::Index count, double radius, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double r = i == 0 ? 0.0 : radius * std::sqrt(rng.uniform());
    const double angle = rng.uniform(0.0, 2.0 * M_PI);
    const double x = r * std::cos(angle);
    const double y = r * std::sin(angle);
    points.row(i) << x, y, -0.5 * x * x - 0.2 * y * y + 0.1 * x * y;
  }
  return points;
}

inline Points with_noise(const Points& points, double sigma, Rng& rng, bool only_heights) {
  Points noisy = points;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    for (Eigen::Index c = only_heights ? 2 : 0; c < 3; ++c) noisy(i, c) += sigma * rng.normal();
  }
  return noisy;
}

struct Coverage {
  int mean = 0;
  int gauss = 0;
  int normal = 0;
  int coefficient = 0;
  int draws = 0;
};

// How often nominal 95 % intervals hold the values of the same fit without noise. The whole fit is
// repeated: neighbours, frame, shift; the deviation is estimated from each draw.
inline Coverage coverage_of(double sigma, int draws, const MlsOptions& options) {
  const Points clean = sheet(100, 1.0, 4);
  const MlsPatch truth = fit_mls_patch(clean.row(0), clean, options, Eigen::RowVector3d::UnitZ());
  const PatchCurvature exact = patch_curvature(truth.beta);
  const auto in_world = [](const MlsPatch& patch,
                           const Eigen::RowVector3d& v) -> Eigen::RowVector3d {
    return v[0] * patch.u1 + v[1] * patch.u2 + v[2] * patch.n;
  };
  const Eigen::RowVector3d true_normal = in_world(truth, exact.normal);
  Rng rng(5);
  Coverage coverage;
  for (int draw = 0; draw < draws; ++draw) {
    const Points noisy = with_noise(clean, sigma, rng, true);
    // About the true foot point, so that what is estimated stays the same quantity.
    const MlsPatch patch = fit_mls_patch(clean.row(0), noisy, options, Eigen::RowVector3d::UnitZ());
    const PatchMatrix covariance = patch.variance * patch.unit_covariance;
    const Eigen::Matrix2d kh = curvature_covariance(patch.beta, covariance);
    const PatchCurvature found = patch_curvature(patch.beta);
    constexpr double kTwoSided = 1.987;  // Student's t with 90 degrees of freedom
    coverage.mean += std::abs(found.mean - exact.mean) < kTwoSided * std::sqrt(kh(1, 1));
    coverage.gauss += std::abs(found.gauss - exact.gauss) < kTwoSided * std::sqrt(kh(0, 0));
    coverage.coefficient += std::abs(patch.projected()[2] - truth.projected()[2]) <
                            kTwoSided * std::sqrt(covariance(9, 9));
    const Eigen::Matrix3d local = patch_normal_covariance(patch.beta, covariance);
    // One component of the normal, along x of the patch.
    const double change = (in_world(patch, found.normal) - true_normal).dot(patch.u1);
    coverage.normal += std::abs(change) < kTwoSided * std::sqrt(local(0, 0));
    ++coverage.draws;
  }
  return coverage;
}

}  // namespace dupin::test
