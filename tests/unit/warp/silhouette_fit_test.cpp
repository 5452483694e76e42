#include "dupin/warp/silhouette_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "dupin/base/error.h"
#include "tests/support/garments.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

Points2 square(double x, double y, double side) {
  Points2 loop(4, 2);
  loop << x, y, x + side, y, x + side, y + side, x, y + side;
  return loop;
}

// Two squares of side 10, one moved by (5, 0), then by (5, 5); a hole is not covered.
TEST(Overlap, OfSquaresIsKnown) {
  const Overlap half = compute_overlap(square(0, 0, 10), square(5, 0, 10));
  EXPECT_NEAR(half.area_a, 100.0, 1e-9);
  EXPECT_NEAR(half.intersection, 50.0, 1e-9);
  EXPECT_NEAR(half.iou, 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(compute_overlap(square(0, 0, 10), square(5, 5, 10)).iou, 1.0 / 7.0, 1e-3);
  EXPECT_EQ(compute_overlap(square(0, 0, 10), square(20, 0, 10)).iou, 0.0);
  Points2 hole = square(2, 2, 6);
  hole = hole.colwise().reverse().eval();
  const Outline frame{{square(0, 0, 10), hole}, {0, 0}};
  const Overlap framed = compute_overlap(frame, Outline{{square(0, 0, 10)}, {0}});
  EXPECT_NEAR(framed.iou, 0.64, 1e-3);
}

// Circles of radius r, centres d apart: 2 r^2 acos(d / 2r) - d / 2 sqrt(4 r^2 - d^2). Polygons of
// 2000 corners are smaller by a share of 2e-6; the rule over y errs by (step / r)^(3/2) at the
// poles.
TEST(Overlap, OfCirclesIsThatOfTheirLens) {
  const auto circle = [](double x) {
    Points2 loop(2000, 2);
    for (Index i = 0; i < 2000; ++i) {
      const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / 2000.0;
      loop.row(i) << x + std::cos(angle), std::sin(angle);
    }
    return loop;
  };
  const double lens = 2.0 * std::acos(0.5) - 0.5 * std::sqrt(3.0);
  const double expected = lens / (2.0 * std::numbers::pi - lens);
  EXPECT_NEAR(compute_overlap(circle(0.0), circle(1.0)).iou, expected, 3e-5);
  EXPECT_NEAR(compute_overlap(circle(1.0), circle(0.0)).iou, expected, 3e-5);
  EXPECT_EQ(compute_overlap(circle(0.0), circle(2.5)).iou, 0.0);
  EXPECT_EQ(compute_overlap(circle(0.0), circle(0.0)).iou, 1.0);
}

TEST(SilhouetteFit, ItselfNeedsNoMove) {
  const Points2 dress = test::make_garment(test::Garment::dress, 3).outline;
  const SilhouetteFit fit = fit_silhouette(dress, dress);
  EXPECT_GT(fit.fitted.iou, 0.9999);
  for (const WarpPin& pin : fit.pins) EXPECT_LT((pin.target - pin.source).norm(), 1e-6);
}

// One garment on the silhouette of another of its kind: the overlap is that asked for, targets lie
// on the silhouette, pins rise along the contour.
TEST(SilhouetteFit, ReachesTheSilhouette) {
  for (int kind = 0; kind < 3; ++kind) {
    const Points2 source = test::make_garment(static_cast<test::Garment>(kind), 21).outline;
    const Points2 target = test::make_garment(static_cast<test::Garment>(kind), 22).outline;
    const SilhouetteFit fit = fit_silhouette(source, target);
    EXPECT_LT(fit.before.iou, 0.95);
    EXPECT_GT(fit.fitted.iou, 0.985);
    ASSERT_EQ(static_cast<std::size_t>(fit.arcs.size()), fit.pins.size());
    for (Index k = 0; k < fit.arcs.size(); ++k) {
      const WarpPin& pin = fit.pins[static_cast<std::size_t>(k)];
      EXPECT_EQ(pin.kind, PinKind::exterior);
      if (k > 0) {
        EXPECT_GT(fit.arcs(k), fit.arcs(k - 1));
      }
    }
  }
}

// A rectangle of which one side bulges in its upper half: the bulge is 8 px longer than the line it
// leaves, and arc length would slide the lower half by up to 4 px. It stays, within 1 px.
TEST(SilhouetteFit, WhatIsOnTheSilhouetteDoesNotSlideAlongIt) {
  const auto outline = [](double bulge) {
    std::vector<RowVector2d> corners;
    for (double y = 400.0; y > 0.0; y -= 2.0) {
      const double t = (y - 40.0) / 160.0;
      const double out =
          t > 0.0 && t < 1.0 ? bulge * std::pow(std::sin(std::numbers::pi * t), 2) : 0.0;
      corners.emplace_back(-out, y);
    }
    corners.emplace_back(0.0, 0.0);
    corners.emplace_back(200.0, 0.0);
    corners.emplace_back(200.0, 400.0);
    Points2 loop(static_cast<Index>(corners.size()), 2);
    for (Index i = 0; i < loop.rows(); ++i) loop.row(i) = corners[static_cast<std::size_t>(i)];
    return loop;
  };
  const Points2 straight = outline(0.0);
  const Points2 target = outline(24.0);
  SilhouetteFitOptions options;
  options.tolerance = 0.001;
  const SilhouetteFit fit = fit_silhouette(straight, target, options);
  EXPECT_GT(fit.fitted.iou, 0.995);
  const Points2 moved = move_loop(straight, fit.arcs, fit.pins);
  double most = 0.0;
  for (Index i = 0; i < straight.rows(); ++i) {
    if (straight(i, 0) == 0.0 && straight(i, 1) > 220.0 && straight(i, 1) < 390.0)
      most = std::max(most, (moved.row(i) - straight.row(i)).norm());
  }
  EXPECT_LT(most, 1.0);
}

TEST(SilhouetteFit, MorePinsComeCloser) {
  const Points2 source = test::make_garment(test::Garment::t_shirt, 21).outline;
  const Points2 target = test::make_garment(test::Garment::t_shirt, 22).outline;
  SilhouetteFitOptions coarse;
  coarse.tolerance = 0.05;
  SilhouetteFitOptions fine;
  fine.tolerance = 0.002;
  const SilhouetteFit few = fit_silhouette(source, target, coarse);
  const SilhouetteFit many = fit_silhouette(source, target, fine);
  EXPECT_LT(few.pins.size(), many.pins.size());
  EXPECT_LT(few.fitted.iou, many.fitted.iou);
}

TEST(SilhouetteFit, OptionsOutOfRangeAreRefused) {
  const Points2 dress = test::make_garment(test::Garment::dress, 3).outline;
  SilhouetteFitOptions options;
  options.tolerance = 0.0;
  EXPECT_THROW(fit_silhouette(dress, dress, options), InvalidArgument);
  options = {};
  options.max_pins = 3;
  EXPECT_THROW(fit_silhouette(dress, dress, options), InvalidArgument);
  EXPECT_THROW(compute_overlap(dress, dress, 15), InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(fit_silhouette(dress, dress, {}, run).status, Status::cancelled);
}

}  // namespace
}  // namespace dupin
