#include "dupin/warp/contour_match.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"
#include "dupin/warp/pin_transfer.h"
#include "tests/support/garments.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using test::Garment;

Points2 garment(Garment kind, std::uint64_t seed) { return test::make_garment(kind, seed).outline; }

Points2 rolled(const Points2& loop, Index shift) {
  Points2 result(loop.rows(), 2);
  for (Index i = 0; i < loop.rows(); ++i) result.row(i) = loop.row((i + shift) % loop.rows());
  return result;
}

// Largest distance of a corner of `from` from where the match takes it and where it should go.
double largest_error(const Points2& from, const Points2& to, const ContourMatch& match,
                     const Points2& expected) {
  double arc = 0.0;
  double largest = 0.0;
  for (Index i = 0; i < from.rows(); ++i) {
    const RowVector2d place = point_at_arc(to, map_arc(match, arc));
    largest = std::max(largest, (place - expected.row(i)).norm());
    arc += (from.row((i + 1) % from.rows()) - from.row(i)).norm();
  }
  return largest;
}

// Itself, from another first corner, larger and elsewhere: every corner comes back. What is left is
// how a peak of curvature lies between samples, a share of the spacing of 5 px.
TEST(ContourMatch, AContourMatchesItself) {
  for (int kind = 0; kind < 3; ++kind) {
    const Points2 from = garment(static_cast<Garment>(kind), 4);
    const Points2 to = rolled(2.0 * from, 321).rowwise() + RowVector2d(1000, -50);
    const ContourMatch match = match_contours(from, to);
    const Points2 expected = (2.0 * from).rowwise() + RowVector2d(1000, -50);
    EXPECT_LT(largest_error(from, to, match, expected), 8.0) << kind;
    // A key point of little prominence may nearly as well be left out.
    EXPECT_GT(match.confidence, 0.7);
    EXPECT_FALSE(match.is_reversed);
  }
}

// The direction of a loop is no property of the shape.
TEST(ContourMatch, LoopsMayRunEitherWay) {
  const Points2 from = garment(Garment::t_shirt, 4);
  const Points2 reversed = from.colwise().reverse();
  for (const auto& [turn_from, turn_to] : {std::pair(true, false), {false, true}, {true, true}}) {
    const Points2& a = turn_from ? reversed : from;
    const Points2& b = turn_to ? reversed : from;
    const ContourMatch match = match_contours(a, b);
    EXPECT_EQ(match.is_reversed, turn_from != turn_to);
    EXPECT_LT(largest_error(a, b, match, a), 4.0);
  }
}

// Turned by a right angle: found without the prior.
TEST(ContourMatch, WithoutThePriorTheContourMayBeTurned) {
  const Points2 from = garment(Garment::trousers, 8);
  Eigen::Matrix2d turn;
  turn << 0, 1, -1, 0;
  const Points2 to = rolled(from * turn, 100);
  ContourMatchOptions options;
  options.upright = 0.0;
  const ContourMatch match = match_contours(from, to, options);
  EXPECT_LT(largest_error(from, to, match, from * turn), 4.0);
}

// A mirror image of a lopsided shape: matched as such when allowed.
TEST(ContourMatch, MirrorImagesAreFoundWhenAllowed) {
  Points2 flag(5, 2);
  flag << 0, 0, 300, 60, 40, 150, 40, 500, 0, 500;
  Points2 to = flag;
  to.col(0) *= -1.0;
  ContourMatchOptions options;
  options.allow_mirrored = true;
  options.upright = 5.0;
  const ContourMatch match = match_contours(flag, to, options);
  EXPECT_TRUE(match.is_mirrored);
  EXPECT_FALSE(match.is_reversed);  // the corners have the same order in both lists
  EXPECT_LT(largest_error(flag, to, match, to), 4.0);
  EXPECT_FALSE(match_contours(flag, flag, options).is_mirrored);
}

// The map goes once round and never back.
TEST(ContourMatch, TheMapIsMonotone) {
  const Points2 from = garment(Garment::t_shirt, 1);
  const Points2 to = garment(Garment::dress, 2);  // of another kind: any match, but a monotone one
  const ContourMatch match = match_contours(from, to);
  double turned = 0.0;
  double before = map_arc(match, 0.0);
  for (int k = 1; k <= 5000; ++k) {
    const double now = map_arc(match, match.length_from * k / 5000.0);
    double step = now - before;
    step -= match.length_to * std::floor(step / match.length_to);
    turned += step;
    before = now;
  }
  EXPECT_NEAR(turned, match.length_to, 1e-6 * match.length_to);
}

// A square that may be turned has four alignments as good as each other: none is surer than a half.
TEST(ContourMatch, AmbiguityLowersTheConfidence) {
  Points2 square(4, 2);
  square << 0, 0, 400, 0, 400, 400, 0, 400;
  ContourMatchOptions options;
  options.upright = 0.0;
  EXPECT_LT(match_contours(square, square, options).confidence, 0.5);
  EXPECT_GT(match_contours(square, square).confidence, 0.9);
}

TEST(ContourMatch, RoundContoursAndBadOptionsAreRefused) {
  Points2 circle(400, 2);
  for (Index i = 0; i < 400; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / 400.0;
    circle.row(i) << std::cos(angle), std::sin(angle);
  }
  EXPECT_THROW(match_contours(circle, circle), AnalysisError);
  const Points2 shirt = garment(Garment::t_shirt, 4);
  ContourMatchOptions options;
  options.upright = -1.0;
  EXPECT_THROW(match_contours(shirt, shirt, options), InvalidArgument);
  options.upright = 1.0;
  options.detail = 20.0;
  EXPECT_THROW(match_contours(shirt, shirt, options), InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(match_contours(shirt, shirt, {}, run).status, Status::cancelled);
}

// Mean value coordinates reproduce affine maps, inside and on the contour; the contours themselves
// are compared along arc length, so that the map must keep its ratios: a similarity.
TEST(PinTransfer, CarriesPlacesAlongASimilarity) {
  const test::SyntheticGarment shirt = test::make_garment(Garment::t_shirt, 4);
  Eigen::Matrix2d map;
  map << 1.5, 0.2, -0.2, 1.5;
  const Points2 to = (rolled(shirt.outline, 77) * map).rowwise() + RowVector2d(10, 20);
  const ContourMatch match = match_contours(shirt.outline, to);
  const TransferredPlaces carried = transfer_places(shirt.outline, shirt.marks, to, match);
  const Points2 expected = (shirt.marks * map).rowwise() + RowVector2d(10, 20);
  for (Index i = 0; i < expected.rows(); ++i) {
    EXPECT_LT((carried.places.row(i) - expected.row(i)).norm(), 6.0)
        << shirt.names[static_cast<std::size_t>(i)];
    EXPECT_GE(carried.confidence(i), 0.0);
    EXPECT_LE(carried.confidence(i), 1.0);
  }
}

TEST(PinTransfer, KeepsWhatBelongsToThePin) {
  const Points2 from = garment(Garment::t_shirt, 4);
  const Points2 to = 2.0 * from;
  const ContourMatch match = match_contours(from, to);
  WarpPin pin;
  pin.name = "chest";
  pin.source << 0, 200;
  pin.target << 10, 230;
  pin.rotation_deg = 20.0;
  pin.depth = 3.0;
  pin.radius = 5.0;
  const WarpPin relative = transfer_pins(from, {pin}, to, match).pins[0];
  EXPECT_LT((relative.source - 2.0 * pin.source).norm(), 4.0);
  EXPECT_LT((relative.target - relative.source - RowVector2d(20, 60)).norm(), 1e-6);
  EXPECT_NEAR(relative.radius, 10.0, 1e-9);
  EXPECT_EQ(relative.name, "chest");
  EXPECT_EQ(relative.rotation_deg, 20.0);
  EXPECT_EQ(relative.depth, 3.0);
  const WarpPin absolute = transfer_pins(from, {pin}, to, match, TargetRule::absolute).pins[0];
  EXPECT_EQ(absolute.target, pin.target);
  EXPECT_THROW(transfer_pins(to, {pin}, to, match), InvalidArgument);
}

}  // namespace
}  // namespace dupin
