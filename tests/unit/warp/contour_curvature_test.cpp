#include "dupin/warp/contour_curvature.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr double kPi = std::numbers::pi;

Points2 ellipse(double a, double b, Index count) {
  Points2 loop(count, 2);
  for (Index i = 0; i < count; ++i) {
    const double t = 2.0 * kPi * static_cast<double>(i) / static_cast<double>(count);
    loop.row(i) << a * std::cos(t), b * std::sin(t);
  }
  return loop;
}

// A unit tangent is exact on a circle; one more derivative of a Gaussian damps the first harmonic
// by exp(-(2 pi sigma / I)^2 / 2). E-40: r = 3, I = 500, sigma = 6 gives .3324. The sum over
// integers differs from the integral by less than exp(-2 pi^2 sigma^2); the polygon is shorter than
// the circle by (pi / I)^2 / 6 = 7e-6.
TEST(ContourCurvature, OfACircleIsTheInverseRadiusTimesTheKnownAttenuation) {
  for (const double sigma : {2.0, 6.0, 25.0, 60.0}) {
    const Index count = 500;
    const ResampledLoop samples = resample_loop(ellipse(3.0, 3.0, count), count);
    const ContourCurvature found =
        compute_contour_curvature(samples.points, samples.spacing, sigma);
    const double phase = 2.0 * kPi * sigma / static_cast<double>(count);
    const double expected = std::exp(-0.5 * phase * phase) / 3.0;
    EXPECT_NEAR(found.curvature.minCoeff(), expected, 2e-5 * expected) << sigma;
    EXPECT_NEAR(found.curvature.maxCoeff(), expected, 2e-5 * expected) << sigma;
  }
}

// kappa = a b / (a^2 sin^2 + b^2 cos^2)^(3/2); the error is of the order sigma^2. At the tips the
// curvature is .75, sigma .13: (sigma kappa)^2 is 1 %, and curvature falls off as fast.
TEST(ContourCurvature, ConvergesToThatOfAnEllipse) {
  const double a = 3.0;
  const double b = 2.0;
  const Index count = 1200;
  const ResampledLoop samples = resample_loop(ellipse(a, b, 20000), count);
  double errors[2] = {0.0, 0.0};
  for (int k = 0; k < 2; ++k) {
    const ContourCurvature found =
        compute_contour_curvature(samples.points, samples.spacing, k == 0 ? 20.0 : 10.0);
    for (Index i = 0; i < count; ++i) {
      const double x = samples.points(i, 0) / a;
      const double y = samples.points(i, 1) / b;
      const double kappa = a * b / std::pow(a * a * y * y + b * b * x * x, 1.5);
      errors[k] = std::max(errors[k], std::abs(found.curvature(i) - kappa) / kappa);
    }
  }
  EXPECT_LT(errors[1], 0.03);
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2.0, 0.25);
}

// E-40: without equal steps the largest and least curvature of a circle differ by a factor of 6.
TEST(ContourCurvature, DoesNotSeeHowThePolylineWasSampled) {
  Points2 uneven(400, 2);
  for (Index i = 0; i < 400; ++i) {
    const double t = static_cast<double>(i) / 400.0;
    const double angle = 2.0 * kPi * (t + 0.13 * std::sin(2.0 * kPi * t));
    uneven.row(i) << std::cos(angle), std::sin(angle);
  }
  const ResampledLoop samples = resample_loop(uneven, 400);
  const ContourCurvature found = compute_contour_curvature(samples.points, samples.spacing, 10.0);
  EXPECT_LT(found.curvature.maxCoeff() / found.curvature.minCoeff(), 1.01);
}

// Convex on an outer loop is positive, on its inside negative; the other way round the sign
// changes.
TEST(ContourCurvature, IsSigned) {
  Points2 notched(6, 2);
  notched << 0, 0, 10, 0, 10, 10, 5, 4, 0, 10, 0, 5;
  ASSERT_GT(signed_area(notched), 0.0);
  const ResampledLoop samples = resample_loop(notched, 256);
  const ContourCurvature found = compute_contour_curvature(samples.points, samples.spacing, 3.0);
  Index notch = 0;
  (samples.points.rowwise() - Eigen::RowVector2d(5, 4)).rowwise().norm().minCoeff(&notch);
  EXPECT_LT(found.curvature(notch), -0.3);
  EXPECT_GT(found.curvature(0), 0.3);
  const Points2 reversed = samples.points.colwise().reverse();
  const ContourCurvature back = compute_contour_curvature(reversed, samples.spacing, 3.0);
  for (Index i = 0; i < 256; ++i) EXPECT_NEAR(back.curvature(255 - i), -found.curvature(i), 1e-9);
}

// Noise larger than the spacing turns raw differences round, which the sign of Eq. 7.36 would
// follow: the curvature would then reach that of a hairpin, about 1 / (sigma spacing). Here it
// stays within 5 standard deviations of the noise's, .46 (noise / spacing^2) (sqrt(2) sigma)^-2.5.
TEST(ContourCurvature, NoiseDoesNotTurnTangentsRound) {
  Rng rng(5);
  const Index count = 512;
  Points2 noisy = ellipse(100.0, 100.0, count);
  const double spacing = 2.0 * kPi * 100.0 / static_cast<double>(count);
  const double noise = 2.0 * spacing;
  for (Index i = 0; i < noisy.size(); ++i) noisy.data()[i] += noise * rng.normal();
  const double sigma = 12.0;
  const ContourCurvature found = compute_contour_curvature(noisy, spacing, sigma);
  const double deviation =
      0.46 * noise / (spacing * spacing) * std::pow(std::sqrt(2.0) * sigma, -2.5);
  EXPECT_LT((found.curvature.array() - 0.01).abs().maxCoeff(), 5.0 * deviation);
}

// A there-and-back line has no tangent at its ends: they take that of the sample before.
TEST(ContourCurvature, CuspsCarryTheTangent) {
  Points2 hairpin(64, 2);
  for (Index i = 0; i < 64; ++i) hairpin.row(i) << std::abs(static_cast<double>(i) - 32.0), 0.0;
  const ContourCurvature found = compute_contour_curvature(hairpin, 1.0, 2.0);
  EXPECT_GE(found.num_cusps, 1);
  for (Index i = 0; i < 64; ++i) {
    EXPECT_TRUE(std::isfinite(found.curvature(i)));
    EXPECT_NEAR(found.tangents.row(i).norm(), 1.0, 1e-12);
  }
}

TEST(ResampledLoop, StepsAreEqualAndStartAtTheFirstCorner) {
  Points2 square(4, 2);
  square << 0, 0, 8, 0, 8, 8, 0, 8;
  const ResampledLoop samples = resample_loop(square, 64);
  EXPECT_EQ(samples.length, 32.0);
  EXPECT_EQ(samples.spacing, 0.5);
  EXPECT_EQ(samples.points.row(0), Eigen::RowVector2d(0, 0));
  EXPECT_EQ(samples.points.row(17), Eigen::RowVector2d(8, 0.5));
  for (Index i = 0; i < 64; ++i) EXPECT_NEAR(samples.arcs(i), 0.5 * static_cast<double>(i), 1e-12);
  EXPECT_EQ(point_at_arc(square, -1.0), Eigen::RowVector2d(0, 1));
  EXPECT_EQ(point_at_arc(square, 33.0), Eigen::RowVector2d(1, 0));
}

// Noise on the upper half only: along the raw polyline it takes most of the samples, along the
// smoothed one each half has its own half, to a tenth.
TEST(ResampledLoop, NoiseDoesNotDrawTheSamples) {
  Rng rng(7);
  Points2 noisy = ellipse(100.0, 100.0, 1000);
  for (Index i = 0; i < 500; ++i) noisy.row(i) *= 1.0 + 0.01 * rng.normal();
  const auto upper = [](const ResampledLoop& samples) {
    return (samples.points.col(1).array() > 0.0).count();
  };
  EXPECT_GT(upper(resample_loop(noisy, 512)), 300);
  EXPECT_NEAR(static_cast<double>(upper(resample_loop_smoothly(noisy, 512, 5.0))), 256.0, 26.0);
}

TEST(ContourCurvature, BadInputIsRefused) {
  const Points2 circle = ellipse(1.0, 1.0, 60);
  EXPECT_THROW(compute_contour_curvature(circle, 0.1, 0.9), InvalidArgument);
  EXPECT_THROW(compute_contour_curvature(circle, 0.1, 10.0), InvalidArgument);
  EXPECT_NO_THROW(compute_contour_curvature(circle, 0.1, 9.9));
  EXPECT_THROW(compute_contour_curvature(circle, 0.0, 2.0), InvalidArgument);
  EXPECT_THROW(resample_loop(circle, 7), InvalidArgument);
  EXPECT_THROW(resample_loop(circle.topRows(2), 64), InvalidArgument);
  EXPECT_THROW(resample_loop(Points2::Zero(5, 2), 64), InvalidArgument);
  Points2 broken = circle;
  broken(3, 1) = std::nan("");
  EXPECT_THROW(resample_loop(broken, 64), InvalidArgument);
}

}  // namespace
}  // namespace dupin
