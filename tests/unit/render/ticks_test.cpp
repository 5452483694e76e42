#include "dupin/render/ticks.h"

#include <gtest/gtest.h>

#include <limits>

#include "dupin/base/error.h"

namespace dupin {
namespace {

TEST(Ticks, AreRoundNumbersInsideTheInterval) {
  const Ticks ticks = make_ticks(-0.35, 1.02, 5);
  EXPECT_EQ(ticks.labels, (std::vector<std::string>{"0.0", "0.5", "1.0"}));
  EXPECT_TRUE(ticks.factor.empty());
  EXPECT_EQ(make_ticks(-2.0, 2.0, 5).labels,
            (std::vector<std::string>{"\u22122", "\u22121", "0", "1", "2"}));
}

TEST(Ticks, SmallAndLargeValuesShareOneFactor) {
  const Ticks small = make_ticks(0.0, 4e-5, 5);
  EXPECT_EQ(small.factor, "×10⁻⁵");
  EXPECT_EQ(small.labels, (std::vector<std::string>{"0", "1", "2", "3", "4"}));
  EXPECT_EQ(make_ticks(0.0, 4e30, 5).factor, "×10³⁰");
}

// For any scale: between 2 and target + 1 ticks, ascending, inside.
TEST(Ticks, AreFewAndAscendingAtEveryScale) {
  for (const double scale : {1e-300, 3.3e-7, 1.0, 7.9, 1e15, 1e300}) {
    for (const double low : {-1.0, 0.0, 0.73}) {
      const Ticks ticks = make_ticks(low * scale, 1.13 * scale, 5);
      ASSERT_GE(ticks.values.size(), 2U) << scale << " " << low;
      ASSERT_LE(ticks.values.size(), 6U) << scale << " " << low;
      ASSERT_EQ(ticks.values.size(), ticks.labels.size());
      for (std::size_t i = 0; i < ticks.values.size(); ++i) {
        EXPECT_GE(ticks.values[i], low * scale);
        EXPECT_LE(ticks.values[i], 1.13 * scale);
        if (i > 0) {
          EXPECT_GT(ticks.values[i], ticks.values[i - 1]);
          EXPECT_NE(ticks.labels[i], ticks.labels[i - 1]);
        }
      }
    }
  }
}

TEST(Ticks, AnEmptyIntervalHasOneAndBadEndsAreRefused) {
  EXPECT_EQ(make_ticks(2.5, 2.5).labels, (std::vector<std::string>{"2.5"}));
  EXPECT_EQ(make_ticks(0.0, 0.0).values.size(), 1U);
  EXPECT_THROW(make_ticks(1.0, 0.0), InvalidArgument);
  EXPECT_THROW(make_ticks(0.0, std::numeric_limits<double>::infinity()), InvalidArgument);
}

TEST(Ticks, RoundDownNeverExceeds) {
  EXPECT_EQ(round_down_125(1.0), 1.0);
  EXPECT_EQ(round_down_125(0.0049), 0.002);
  EXPECT_EQ(round_down_125(5e7), 5e7);
  for (double v = 1e-20; v < 1e20; v *= 1.37) {
    EXPECT_LE(round_down_125(v), v);
    EXPECT_GT(round_down_125(v), v / 2.51);
  }
}

TEST(FormatNumber, IsShortAndUsesTheTrueMinus) {
  EXPECT_EQ(format_number(0.0), "0");
  EXPECT_EQ(format_number(-1.5), "\u22121.5");
  EXPECT_EQ(format_number(1234.6), "1235");
  EXPECT_EQ(format_number(2e-7), "2×10⁻⁷");
  EXPECT_EQ(format_number(9.9999e9), "1×10¹⁰");
}

}  // namespace
}  // namespace dupin
