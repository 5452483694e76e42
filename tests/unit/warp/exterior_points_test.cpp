#include "dupin/warp/exterior_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/warp/contour_curvature.h"
#include "tests/support/garments.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr double kPi = std::numbers::pi;

// Corners alternately at two radii.
Points2 star(int num_tips, double outer, double inner) {
  Points2 loop(2 * num_tips, 2);
  for (int i = 0; i < 2 * num_tips; ++i) {
    const double angle = kPi * i / num_tips;
    const double radius = i % 2 == 0 ? outer : inner;
    loop.row(i) << radius * std::cos(angle), radius * std::sin(angle);
  }
  return loop;
}

Points2 gear(int num_teeth) {
  Points2 loop(4 * num_teeth, 2);
  for (int i = 0; i < 4 * num_teeth; ++i) {
    const double angle = 2.0 * kPi * (i / 2 + 0.5 * (i % 2)) / (2.0 * num_teeth) * 1.0;
    const double radius = i / 2 % 2 == 0 ? 100.0 : 75.0;
    loop.row(i) << radius * std::cos(angle), radius * std::sin(angle);
  }
  return loop;
}

double distance_to(const Points2& loop, const Eigen::RowVector2d& place) {
  return (loop.rowwise() - place).rowwise().norm().minCoeff();
}

std::size_t count_of(const Points2& loop, double detail) {
  ExteriorPointOptions options;
  options.detail = detail;
  return find_exterior_points(loop, options).points.size();
}

// Every corner once, nothing else; half the spacing of the samples is the least that can be asked.
TEST(ExteriorPoints, AreTheCornersOfPolygons) {
  Points2 square(4, 2);
  square << 0, 0, 100, 0, 100, 100, 0, 100;
  const std::pair<Points2, double> cases[] = {
      {square, 60.0}, {star(5, 100.0, 45.0), 60.0}, {gear(6), 240.0}};
  for (const auto& [loop, detail] : cases) {
    ExteriorPointOptions options;
    options.detail = detail;
    const ExteriorPoints found = find_exterior_points(loop, options);
    ASSERT_EQ(found.points.size(), static_cast<std::size_t>(loop.rows()));
    for (const ExteriorPoint& point : found.points) {
      EXPECT_LT(distance_to(loop, point.position), 0.5 * found.sigma_px);
      EXPECT_GT(point.prominence, 0.3);
      EXPECT_LT((point_at_arc(loop, point.arc) - point.position).norm(), 1e-9 * found.length);
    }
  }
}

// The inner corners of a star are concave.
TEST(ExteriorPoints, CurvatureTellsConvexFromConcave) {
  const ExteriorPoints found = find_exterior_points(star(5, 100.0, 45.0));
  for (const ExteriorPoint& point : found.points)
    EXPECT_EQ(point.curvature > 0.0, point.position.norm() > 70.0);
}

TEST(ExteriorPoints, ACircleHasNone) {
  Rng rng(1);
  Points2 circle(700, 2);
  for (Index i = 0; i < 700; ++i) {
    const double angle = 2.0 * kPi * static_cast<double>(i) / 700.0;
    circle.row(i) << 100.0 * std::cos(angle), 100.0 * std::sin(angle);
  }
  EXPECT_TRUE(find_exterior_points(circle).points.empty());
  for (Index i = 0; i < circle.size(); ++i) circle.data()[i] += rng.normal();
  EXPECT_TRUE(find_exterior_points(circle).points.empty());
}

TEST(ExteriorPoints, BecomeFewerWithSigma) {
  for (int kind = 0; kind < 3; ++kind) {
    test::GarmentOptions made;
    made.noise_px = 0.0;
    const Points2 loop = test::make_garment(static_cast<test::Garment>(kind), 3, made).outline;
    std::size_t before = 1000;
    for (const double detail : {200.0, 100.0, 50.0, 25.0, 12.5}) {
      const std::size_t now = count_of(loop, detail);
      EXPECT_LE(now, before) << "kind " << kind << ", detail " << detail;
      before = now;
    }
    EXPECT_LT(before, count_of(loop, 100.0));
  }
}

// Another first corner, the other direction, another place, size and turn: the same places. Samples
// start elsewhere on the loop, so that the place of a peak may differ by a share of the spacing.
TEST(ExteriorPoints, AreThoseOfTheShapeAndNotOfItsDescription) {
  for (int kind = 0; kind < 3; ++kind) {
    test::GarmentOptions made;
    made.noise_px = 0.0;
    const Points2 loop = test::make_garment(static_cast<test::Garment>(kind), 11, made).outline;
    const ExteriorPoints expected = find_exterior_points(loop);
    Points2 other(loop.rows(), 2);
    for (Index i = 0; i < loop.rows(); ++i) other.row(i) = loop.row((2000 - i) % loop.rows());
    Eigen::Matrix2d turn;
    turn << std::cos(2.0), -std::sin(2.0), std::sin(2.0), std::cos(2.0);
    const Points2 moved = (0.01 * other * turn).rowwise() + Eigen::RowVector2d(500, -300);
    const ExteriorPoints found = find_exterior_points(moved);
    ASSERT_EQ(found.points.size(), expected.points.size());
    for (const ExteriorPoint& point : found.points) {
      const Eigen::RowVector2d back =
          100.0 * (point.position - Eigen::RowVector2d(500, -300)) * turn.transpose();
      double nearest = 1e300;
      for (const ExteriorPoint& each : expected.points)
        nearest = std::min(nearest, (each.position - back).norm());
      EXPECT_LT(nearest, 0.3 * expected.sigma_px);
    }
  }
}

// Independent noise of 2 px comes out within 10 % on a smooth contour, and corners do not count.
TEST(ExteriorPoints, NoiseOfTheContourIsMeasured) {
  Rng rng(9);
  Points2 samples = resample_loop(star(5, 300.0, 150.0), 512).points;
  EXPECT_LT(estimate_contour_noise(samples), 1e-9);
  for (Index i = 0; i < samples.size(); ++i) samples.data()[i] += 2.0 * rng.normal();
  EXPECT_NEAR(estimate_contour_noise(samples), 2.0, 0.2);
}

TEST(ExteriorPoints, OptionsOutOfRangeAreRefused) {
  const Points2 loop = star(5, 100.0, 45.0);
  const auto refused = [&](auto change) {
    ExteriorPointOptions options;
    change(options);
    try {
      find_exterior_points(loop, options);
    } catch (const InvalidArgument&) {
      return true;
    }
    return false;
  };
  EXPECT_TRUE(refused([](ExteriorPointOptions& o) { o.detail = 6.0; }));
  EXPECT_TRUE(refused([](ExteriorPointOptions& o) { o.detail = 513.0; }));
  EXPECT_TRUE(refused([](ExteriorPointOptions& o) { o.prominence = -1.0; }));
  EXPECT_TRUE(refused([](ExteriorPointOptions& o) { o.separation = std::nan(""); }));
  EXPECT_TRUE(refused([](ExteriorPointOptions& o) { o.num_samples = 63; }));
  EXPECT_FALSE(refused([](ExteriorPointOptions& o) { o.separation = 1e9; }));
}

}  // namespace
}  // namespace dupin
