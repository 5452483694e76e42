#include "dupin/warp/exact_predicates.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_int.hpp>

#include "dupin/base/random.h"

namespace dupin {
namespace {

using Big = boost::multiprecision::cpp_int;

int sign(const Big& value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

Big orientation_of(GridPoint a, GridPoint b, GridPoint c) {
  return (Big(b.x) - a.x) * (Big(c.y) - a.y) - (Big(b.y) - a.y) * (Big(c.x) - a.x);
}

// The 4 by 4 determinant of rows (x, y, x^2 + y^2, 1), expanded along the last column.
int in_circle_of(GridPoint a, GridPoint b, GridPoint c, GridPoint d) {
  const auto lift = [](GridPoint p) { return Big(Big(p.x) * p.x + Big(p.y) * p.y); };
  const auto det3 = [&](GridPoint p, GridPoint q, GridPoint r) {
    return Big(p.x) * (Big(q.y) * lift(r) - Big(r.y) * lift(q)) -
           Big(p.y) * (Big(q.x) * lift(r) - Big(r.x) * lift(q)) +
           lift(p) * (Big(q.x) * r.y - Big(r.x) * q.y);
  };
  return sign(det3(a, b, c) - det3(b, c, d) + det3(a, c, d) - det3(a, b, d));
}

GridPoint draw(Rng& rng, std::int32_t extent) {
  const auto coordinate = [&] {
    return static_cast<std::int32_t>(rng.below(2 * static_cast<std::uint64_t>(extent) + 1)) -
           extent;
  };
  const std::int32_t x = coordinate();
  return {x, coordinate()};
}

// The largest differences the mesher allows: +-3/4 of 2^30 on each axis. Nothing overflows.
constexpr std::int32_t kLargest = static_cast<std::int32_t>(kMaxGridExtent / 2);

TEST(ExactPredicates, AgreeWithUnlimitedIntegers) {
  Rng rng(1);
  for (const std::int32_t extent : {2, 40, 1 << 20, kLargest}) {
    for (int i = 0; i < 20000; ++i) {
      const GridPoint a = draw(rng, extent), b = draw(rng, extent), c = draw(rng, extent),
                      d = draw(rng, extent);
      const Big area = orientation_of(a, b, c);
      ASSERT_EQ(Big(orientation(a, b, c)), area);
      ASSERT_EQ(Big(dot(d, a, b)),
                (Big(a.x) - d.x) * (Big(b.x) - d.x) + (Big(a.y) - d.y) * (Big(b.y) - d.y));
      if (area <= 0) continue;
      ASSERT_EQ(in_circle(a, b, c, d), in_circle_of(a, b, c, d));
    }
  }
}

// Corners of a rectangle share a circle; one step off it is told from it at every size, where
// doubles alone cannot.
TEST(ExactPredicates, TellOneStepFromACircle) {
  for (const std::int32_t r : {1, 1000, (1 << 26) + 1, kLargest - 1}) {
    const GridPoint a{-r, -r}, b{r, -r}, c{r, r}, d{-r, r};
    EXPECT_EQ(in_circle(a, b, c, d), 0);
    EXPECT_EQ(in_circle(a, b, c, {d.x + 1, d.y}), 1);
    EXPECT_EQ(in_circle(a, b, c, {d.x - 1, d.y}), -1);
    EXPECT_EQ(in_circle(a, b, c, {d.x, d.y + 1}), -1);
  }
}

// A filter that never answers would be as right and slow, one that always answers wrong on ties:
// near a circle of large radius the doubles must hand over and the integers answer.
TEST(ExactPredicates, NearlyCocircularPointsAgreeWithUnlimitedIntegers) {
  Rng rng(2);
  int num_ties = 0;
  for (int i = 0; i < 20000; ++i) {
    // Pythagorean points (3, 4, 5), (5, 12, 13), (8, 15, 17) on one circle of radius 5 * 13 * 17 k.
    const auto k = static_cast<std::int32_t>(1 + rng.below(500000));
    const GridPoint on[] = {{663 * k, 884 * k},  {884 * k, 663 * k},   {425 * k, 1020 * k},
                            {-520 * k, 975 * k}, {-975 * k, -520 * k}, {520 * k, -975 * k}};
    GridPoint q[4];
    for (GridPoint& p : q) {
      p = on[rng.below(6)];
      p.x += static_cast<std::int32_t>(rng.below(3)) - 1;
    }
    if (orientation(q[0], q[1], q[2]) <= 0) continue;
    const int expected = in_circle_of(q[0], q[1], q[2], q[3]);
    num_ties += expected == 0 ? 1 : 0;
    ASSERT_EQ(in_circle(q[0], q[1], q[2], q[3]), expected);
  }
  EXPECT_GT(num_ties, 100);
}

}  // namespace
}  // namespace dupin
