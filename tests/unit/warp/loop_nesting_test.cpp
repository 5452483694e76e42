#include "dupin/warp/loop_nesting.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dupin/base/random.h"

namespace dupin {
namespace {

using Loop = std::vector<GridPoint>;

// The number of edges that a ray from p along x crosses is odd.
bool holds(const Loop& loop, GridPoint p) {
  bool is_inside = false;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const GridPoint a = loop[i];
    const GridPoint b = loop[(i + 1) % loop.size()];
    if ((a.y <= p.y) != (b.y <= p.y) && (orientation(a, b, p) > 0) == (b.y > a.y))
      is_inside = !is_inside;
  }
  return is_inside;
}

std::vector<std::vector<std::size_t>> by_all_pairs(const std::vector<Loop>& loops) {
  std::vector<std::vector<std::size_t>> around(loops.size());
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (std::size_t m = 0; m < loops.size(); ++m) {
      if (m != l && holds(loops[m], loops[l].front())) around[l].push_back(m);
    }
  }
  return around;
}

// Stars of all sizes and places, negative ones too, that overlap: spikes cross many rows.
TEST(LoopNesting, IsThatOfAllPairs) {
  Rng rng(11);
  for (int round = 0; round < 20; ++round) {
    std::vector<Loop> loops(60);
    for (Loop& loop : loops) {
      const double x = 4000.0 * (rng.uniform() - 0.5);
      const double y = 4000.0 * (rng.uniform() - 0.5);
      const double radius = std::pow(10.0, 0.5 + 3.0 * rng.uniform());
      const int corners = 3 + static_cast<int>(40.0 * rng.uniform());
      for (int i = 0; i < corners; ++i) {
        const double reach = radius * (0.2 + 0.8 * rng.uniform());
        const double angle = 6.283 * i / corners;
        loop.push_back({static_cast<std::int32_t>(std::lround(x + reach * std::cos(angle))),
                        static_cast<std::int32_t>(std::lround(y + reach * std::sin(angle)))});
      }
    }
    EXPECT_EQ(loops_around(loops), by_all_pairs(loops));
  }
}

// Rings inside rings: ring k is inside all larger ones.
TEST(LoopNesting, CountsRingsAroundRings) {
  std::vector<Loop> loops;
  for (std::int32_t r = 1; r <= 50; ++r) loops.push_back({{-r, -r}, {r, -r}, {r, r}, {-r, r}});
  const auto around = loops_around(loops);
  for (std::size_t l = 0; l < loops.size(); ++l) {
    ASSERT_EQ(around[l].size(), loops.size() - 1 - l);
    EXPECT_TRUE(std::is_sorted(around[l].begin(), around[l].end()));
  }
}

// A comb of teeth around many small loops: what all pairs of corners would take hours for.
TEST(LoopNesting, OfManyLoopsInOneTakesNoTime) {
  constexpr std::int32_t kTeeth = 20000;
  std::vector<Loop> loops(1);
  for (std::int32_t i = 0; i < kTeeth; ++i) {
    loops[0].push_back({8 * i, 0});
    loops[0].push_back({8 * i + 6, 0});
    loops[0].push_back({8 * i + 6, -40});
    loops[0].push_back({8 * i + 7, -40});
  }
  loops[0].push_back({8 * kTeeth, 100});
  loops[0].push_back({0, 100});
  for (std::int32_t i = 0; i < kTeeth; ++i)
    loops.push_back({{8 * i + 2, 50}, {8 * i + 2, 53}, {8 * i + 5, 53}, {8 * i + 5, 50}});
  const auto around = loops_around(loops);
  for (std::size_t l = 1; l < loops.size(); ++l)
    ASSERT_EQ(around[l], (std::vector<std::size_t>{0})) << l;
}

}  // namespace
}  // namespace dupin
