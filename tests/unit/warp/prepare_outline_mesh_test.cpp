#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/edge_crossings.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/triangulate_outline.h"
#include "tests/support/outline_families.h"

namespace dupin {
namespace {

using Eigen::Index;

OutlineOptions options_of(double spacing, double tolerance) {
  return {.spacing_px = spacing, .tolerance_px = tolerance, .corner_angle_deg = 30.0};
}

double distance(const Eigen::RowVector2d& p, const Points2& loop) {
  double least = HUGE_VAL;
  for (Index i = 0; i < loop.rows(); ++i) {
    const Eigen::RowVector2d a = loop.row(i), d = loop.row((i + 1) % loop.rows()) - a;
    const double t = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - a - t * d).norm());
  }
  return least;
}

std::vector<double> edge_lengths(const Points2& loop) {
  std::vector<double> result;
  for (Index i = 0; i < loop.rows(); ++i)
    result.push_back((loop.row((i + 1) % loop.rows()) - loop.row(i)).norm());
  return result;
}

std::string refusal(const Outline& raw) {
  try {
    prepare_outline(raw);
  } catch (const Error& error) {
    return error.code() + " " + error.what();
  }
  return "none";
}

// A square keeps its corners exactly; each side of 180 px becomes ten edges of .9 * 20 px.
TEST(PrepareOutline, SamplesASquareEvenlyAndKeepsItsCorners) {
  const PreparedOutline made = prepare_outline(
      test::single({{10, 10}, {190, 10}, {190, 190}, {10, 190}}), options_of(20.0, 0.5));
  ASSERT_EQ(made.outline.loops[0].rows(), 40);
  for (const double length : edge_lengths(made.outline.loops[0]))
    EXPECT_NEAR(length, 18.0, 2.0 / 256.0);  // each end is rounded by half a step
  for (const double x : {10.0, 190.0})
    for (const double y : {10.0, 190.0})
      EXPECT_EQ(distance(Eigen::RowVector2d(x, y), made.outline.loops[0]), 0.0);
  EXPECT_TRUE(made.warnings.empty());
}

// The staircase of a slanted edge of pixels is within half a pixel of a line: it becomes one.
TEST(PrepareOutline, StraightensTheStairsOfPixels) {
  const int size = 120;
  std::vector<char> mask(size * size, 0);
  for (int i = 0; i < size * size; ++i) {
    const double x = i % size + 0.5, y = i / size + 0.5;
    mask[static_cast<std::size_t>(i)] = y > 10 && y < 100 && x > 10 && x < 60 + 0.37 * y ? 1 : 0;
  }
  const Outline raw = test::mask_outline(mask, size, size);
  const PreparedOutline made = prepare_outline(raw, options_of(12.0, 0.75));
  EXPECT_LT(made.outline.loops[0].rows(), 50);  // perimeter about 360 px, edges of 10.8 px
  EXPECT_GT(raw.loops[0].rows(), 300);
}

// No raw corner is farther than twice the tolerance and a step from the result, on all families.
TEST(PrepareOutline, StaysWithinTwiceTheTolerance) {
  for (int family = 0; family < test::kNumFamilies; ++family) {
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      Rng rng(77 * seed + static_cast<std::uint64_t>(family));
      const Outline raw = test::random_outline(family, rng);
      const PreparedOutline made = prepare_outline(raw, options_of(20.0, 0.5));
      ASSERT_EQ(made.outline.loops.size(), raw.loops.size());
      const double pull = made.warnings.contains("W_OUTLINE_PULLED") ? 0.36 : 0.0;
      for (std::size_t l = 0; l < raw.loops.size(); ++l)
        for (Index i = 0; i < raw.loops[l].rows(); ++i)
          ASSERT_LE(distance(raw.loops[l].row(i), made.outline.loops[l]), 1.0 + pull + 2.0 / 256.0)
              << family << " " << seed;
    }
  }
}

// Results are simple, also where simplification alone would let loops meet; the repair is needed.
TEST(PrepareOutline, RepairsLoopsThatMeetAfterSimplification) {
  int num_repaired = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Rng rng(seed);
    const Outline raw = test::random_mask(rng);
    const PreparedOutline made = prepare_outline(raw, options_of(20.0, 3.0));
    num_repaired += made.warnings.contains("W_OUTLINE_REPAIRED") ? 1 : 0;
    EXPECT_NO_THROW(triangulate_outline(made.outline)) << seed;
  }
  EXPECT_GT(num_repaired, 3);
}

// Two pixels that touch at a corner are two squares a little apart.
TEST(PrepareOutline, PullsTouchingPixelsApart) {
  const PreparedOutline made =
      prepare_outline(test::mask_outline({1, 0, 0, 1}, 2, 2), options_of(20.0, 0.1));
  EXPECT_TRUE(made.warnings.contains("W_OUTLINE_PULLED"));
  ASSERT_EQ(made.outline.loops.size(), 2u);
  const TriangulatedOutline mesh = triangulate_outline(made.outline);
  EXPECT_GE(mesh.mesh.triangles.rows(), 4);
}

// Corners listed twice and spikes of no width are no reason to refuse.
TEST(PrepareOutline, DropsRepeatedCornersAndSpikes) {
  const PreparedOutline made =
      prepare_outline(test::single({{0, 0}, {0, 0}, {50, 0}, {80, 0}, {50, 0}, {50, 50}, {0, 50}}),
                      options_of(200.0, 0.0));
  EXPECT_EQ(made.outline.loops[0].rows(), 4);
  EXPECT_EQ(exact_area(made.outline), std::int64_t{2} * 50 * 50 * 65536);
}

TEST(PrepareOutline, DropsLoopsWithoutAreaWithTheirHoles) {
  Outline raw = test::single({{0, 0}, {50, 0}, {50, 50}, {0, 50}});
  raw.loops.push_back(test::loop_of({{60, 0}, {70, 0}, {80, 0}}));
  raw.component.push_back(1);
  const PreparedOutline made = prepare_outline(raw, options_of(20.0, 0.5));
  EXPECT_EQ(made.outline.loops.size(), 1u);
  EXPECT_TRUE(made.warnings.contains("W_OUTLINE_DROPPED"));
  EXPECT_EQ(refusal(test::single({{60, 0}, {70, 0}, {80, 0}})).substr(0, 13), "E_EMPTY_SHAPE");
}

// The largest picture that is read, and a pixel more.
TEST(PrepareOutline, TakesTheLargestExtent) {
  const double side = 32768.0;
  const Outline raw = test::single({{0, 0}, {side, 0}, {side, 100}, {0, 100}});
  EXPECT_EQ(signed_area(prepare_outline(raw, options_of(8000.0, 0.5)).outline), side * 100.0);
  const Outline wider = test::single({{0, 0}, {side + 1.0, 0}, {side + 1.0, 100}, {0, 100}});
  EXPECT_EQ(refusal(wider).substr(0, 11), "E_TOO_LARGE");
}

// Where the loop starts does not matter.
TEST(PrepareOutline, DoesNotDependOnTheFirstCorner) {
  Rng rng(3);
  const std::vector<test::Corner> star = test::random_star(rng, 100, 100, 90, 41);
  std::vector<test::Corner> turned = star;
  std::rotate(turned.begin(), turned.begin() + 17, turned.end());
  const PreparedOutline a = prepare_outline(test::single(star), options_of(15.0, 0.5));
  const PreparedOutline b = prepare_outline(test::single(turned), options_of(15.0, 0.5));
  EXPECT_EQ(exact_area(a.outline), exact_area(b.outline));
  EXPECT_EQ(a.outline.loops[0].rows(), b.outline.loops[0].rows());
}

TEST(PrepareOutline, RefusesOutlinesThatCrossThemselvesAndSaysWhere) {
  const std::string bow_tie = refusal(test::single({{0, 0}, {100, 100}, {100, 0}, {0, 120}}));
  EXPECT_EQ(bow_tie.substr(0, 17), "E_OUTLINE_CROSSED");
  EXPECT_NE(bow_tie.find("loop 0, edge 0"), std::string::npos) << bow_tie;
  EXPECT_NE(bow_tie.find("loop 0, edge 2"), std::string::npos) << bow_tie;
  Outline crossing = test::single({{0, 0}, {100, 0}, {100, 100}, {0, 100}});
  crossing.loops.push_back(test::loop_of({{50, 50}, {150, 60}, {50, 70}}));
  crossing.component.push_back(1);
  EXPECT_NE(refusal(crossing).find("loop 1"), std::string::npos);
}

TEST(PrepareOutline, RefusesBadArguments) {
  const Outline good = test::single({{0, 0}, {50, 0}, {50, 50}, {0, 50}});
  EXPECT_THROW(prepare_outline(good, options_of(0.0, 0.5)), InvalidArgument);
  EXPECT_THROW(prepare_outline(good, options_of(20.0, -1.0)), InvalidArgument);
  EXPECT_THROW(prepare_outline(good, options_of(std::numeric_limits<double>::quiet_NaN(), 0.5)),
               InvalidArgument);
  EXPECT_THROW(prepare_outline(
                   test::single({{0, 0}, {std::numeric_limits<double>::quiet_NaN(), 0}, {50, 50}})),
               InvalidArgument);
  EXPECT_EQ(refusal(test::single({{0, 0}, {40000, 0}, {50, 50}})).substr(0, 11), "E_TOO_LARGE");
}

TEST(PrepareOutline, CancelledGivesNothing) {
  const RunControl run = RunControl::create();
  run.cancel();
  const Outline good = test::single({{0, 0}, {50, 0}, {50, 50}, {0, 50}});
  const PreparedOutline made = prepare_outline(good, options_of(20.0, 0.5), run);
  EXPECT_EQ(made.status, Status::cancelled);
  EXPECT_TRUE(made.outline.loops.empty());
}

// All pairs against all, on random segments with many shared places.
TEST(EdgeCrossings, AgreeWithAllPairs) {
  Rng rng(8);
  for (int round = 0; round < 60; ++round) {
    const int extent = round % 3 == 0 ? 6 : 400;
    std::vector<GridSegment> segments;
    std::vector<std::int32_t> next;
    const auto draw = [&] {
      const auto c = [&] {
        return static_cast<std::int32_t>(rng.below(static_cast<std::uint64_t>(extent)));
      };
      const std::int32_t x = c();
      return GridPoint{x, c()};
    };
    for (std::int32_t i = 0; i < 40; ++i) {
      GridPoint a = draw(), b = draw();
      if (a == b) b.x += 1;
      segments.push_back({a, b});
      next.push_back(-1);
    }
    const auto on = [](GridPoint p, const GridSegment& s) {
      return orientation(s.from, s.to, p) == 0 && p.x >= std::min(s.from.x, s.to.x) &&
             p.x <= std::max(s.from.x, s.to.x) && p.y >= std::min(s.from.y, s.to.y) &&
             p.y <= std::max(s.from.y, s.to.y);
    };
    std::vector<std::pair<std::int32_t, std::int32_t>> expected;
    for (std::int32_t i = 0; i < 40; ++i) {
      for (std::int32_t j = i + 1; j < 40; ++j) {
        const GridSegment &s = segments[static_cast<std::size_t>(i)],
                          &t = segments[static_cast<std::size_t>(j)];
        const bool splits_t =
            (orientation(s.from, s.to, t.from) > 0) != (orientation(s.from, s.to, t.to) > 0);
        const bool splits_s =
            (orientation(t.from, t.to, s.from) > 0) != (orientation(t.from, t.to, s.to) > 0);
        const bool touches = on(s.from, t) || on(s.to, t) || on(t.from, s) || on(t.to, s);
        const bool proper = splits_s && splits_t && orientation(s.from, s.to, t.from) != 0 &&
                            orientation(s.from, s.to, t.to) != 0 &&
                            orientation(t.from, t.to, s.from) != 0 &&
                            orientation(t.from, t.to, s.to) != 0;
        if (touches || proper) expected.emplace_back(i, j);
      }
    }
    ASSERT_EQ(find_edge_crossings(segments, next), expected) << round;
  }
}

}  // namespace
}  // namespace dupin
