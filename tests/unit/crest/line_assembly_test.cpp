#include "dupin/crest/line_assembly.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace dupin {
namespace {

using detail::Chain;

// Strong points at the given places, each on an edge of its own.
Chain chain_at(const std::vector<Eigen::RowVector3d>& places) {
  Chain chain;
  for (const Eigen::RowVector3d& place : places) {
    CrestPoint point;
    point.position = place;
    point.edge.a = static_cast<std::int32_t>(2 * chain.size());
    point.edge.b = point.edge.a + 1;
    point.strength = 1.0;
    point.radius = 1.0;
    point.sharpness = 1.0;
    point.anisotropy = 1.0;
    chain.push_back(point);
  }
  return chain;
}

std::vector<CrestLine> assembled(const std::vector<Chain>& chains, double min_length) {
  CrestOptions options;
  options.min_length = min_length;
  std::vector<CrestLine> lines;
  detail::assemble_lines(chains, CrestKind::ridge, 1.0, options, lines);
  return lines;
}

// A straight piece shorter than an edge: its ends lie near each other and face apart, as the two
// sides of a gap do, but it is no ring.
TEST(AssembleLines, AShortPieceDoesNotJoinItself) {
  const auto lines =
      assembled({chain_at({{0.0, 0, 0}, {0.2, 0, 0}, {0.4, 0, 0}, {0.6, 0, 0}})}, 0.0);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines.front().is_closed);
  EXPECT_EQ(lines.front().points.size(), 4U);
  EXPECT_NEAR(lines.front().length, 0.6, 1e-12);
}

// A circle but for a gap of two edges is a ring; with a gap of six it is not (max_gap is 4).
TEST(AssembleLines, ARingWithASmallGapIsClosed) {
  for (const double gap : {2.0, 6.0}) {
    const double radius = 20.0;
    const double whole = 2.0 * std::numbers::pi;
    const double end = whole - gap / radius;
    std::vector<Eigen::RowVector3d> places;
    for (int i = 0; i <= 100; ++i) {
      const double angle = end * i / 100.0;
      places.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
    }
    const auto lines = assembled({chain_at(places)}, 8.0);
    ASSERT_EQ(lines.size(), 1U);
    EXPECT_EQ(lines.front().is_closed, gap < 4.0) << gap;
  }
}

// Two pieces of one straight line are joined over a gap of three edges; two that lie side by side
// are not.
TEST(AssembleLines, JoinsWhatContinues) {
  const auto piece = [](double from, double y) {
    std::vector<Eigen::RowVector3d> places;
    for (int i = 0; i <= 20; ++i) places.emplace_back(from + 0.5 * i, y, 0.0);
    Chain chain = chain_at(places);
    for (CrestPoint& point : chain) {
      point.edge.a += static_cast<std::int32_t>(1000.0 * (from + 50.0 * y + 1.0));
      point.edge.b = point.edge.a + 1;
    }
    return chain;
  };
  const auto one = assembled({piece(0.0, 0.0), piece(13.0, 0.0)}, 8.0);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_NEAR(one.front().length, 23.0, 1e-12);
  EXPECT_EQ(assembled({piece(0.0, 0.0), piece(0.0, 2.0)}, 8.0).size(), 2U);
}

// Hysteresis: followed above `low`, kept if above `high` somewhere.
TEST(AssembleLines, KeepWhatIsStrongSomewhere) {
  std::vector<Eigen::RowVector3d> places;
  for (int i = 0; i <= 40; ++i) places.emplace_back(0.5 * i, 0.0, 0.0);
  Chain chain = chain_at(places);
  for (CrestPoint& point : chain) point.strength = 0.05;
  EXPECT_TRUE(assembled({chain}, 8.0).empty());
  chain[20].strength = 0.2;
  ASSERT_EQ(assembled({chain}, 8.0).size(), 1U);
  EXPECT_NEAR(assembled({chain}, 8.0).front().length, 20.0, 1e-12);
  for (std::size_t i = 30; i < chain.size(); ++i) chain[i].strength = 0.01;
  EXPECT_NEAR(assembled({chain}, 8.0).front().length, 14.5, 1e-12);
}

}  // namespace
}  // namespace dupin
