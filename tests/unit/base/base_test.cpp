#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dupin/base/decimal.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/base/run_control.h"
#include "dupin/base/warning.h"

namespace dupin {
namespace {

using Eigen::Index;

TEST(RunControl, ADefaultHandleIsInert) {
  const RunControl run;
  run.cancel();
  run.report(0.5);
  EXPECT_FALSE(run.cancelled());
  EXPECT_EQ(run.progress(), 0.0);
}

TEST(RunControl, CopiesShareStateAndProgressNeverFalls) {
  const RunControl run = RunControl::create();
  const RunControl copy = run;
  copy.report(0.5);
  copy.report(0.2);
  EXPECT_EQ(run.progress(), 0.5);
  copy.cancel();
  EXPECT_TRUE(run.cancelled());
}

TEST(RunControl, AStageFillsItsPartOfTheRange) {
  const RunControl run = RunControl::create();
  const RunControl half = run.stage(0.5, 1.0).stage(0.0, 0.5);
  half.report(1.0);
  EXPECT_EQ(run.progress(), 0.75);
}

// The result must not depend on the number of threads: 0.1 is not a binary fraction, so any change
// of the order of summation changes the last bits of this sum.
TEST(Parallel, SumsHaveTheSameBitsForEveryThreadCount) {
  std::vector<double> sums;
  for (const int threads : {1, 2, 3, 8}) {
    set_thread_count(threads);
    sums.push_back(parallel_sum(0, 100'003, 1000, [](Index first, Index last) {
      double sum = 0.0;
      for (Index i = first; i < last; ++i) sum += 0.1 * std::sin(static_cast<double>(i));
      return sum;
    }));
  }
  set_thread_count(0);
  for (const double sum : sums) EXPECT_EQ(sum, sums.front());
  EXPECT_NE(sums.front(), 0.0);
}

TEST(Parallel, EveryIndexIsVisitedOnce) {
  for (const int threads : {1, 4}) {
    set_thread_count(threads);
    std::vector<int> visits(1017, 0);
    parallel_for(0, 1017, 10, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) ++visits[static_cast<std::size_t>(i)];
    });
    for (const int count : visits) EXPECT_EQ(count, 1);
  }
  set_thread_count(0);
}

TEST(Parallel, RefusesANegativeThreadCount) { EXPECT_THROW(set_thread_count(-1), InvalidArgument); }

// Moments of n draws: mean within 5 / sqrt(n), variance within 5 sqrt(2 / n) (five standard
// errors).
TEST(Rng, NormalDeviatesHaveZeroMeanAndUnitVariance) {
  Rng rng(7);
  constexpr int kDraws = 100'000;
  double sum = 0.0;
  double squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_LT(std::abs(sum / kDraws), 5.0 / std::sqrt(kDraws));
  EXPECT_LT(std::abs(squares / kDraws - 1.0), 5.0 * std::sqrt(2.0 / kDraws));
}

TEST(Rng, SeedsGiveDifferentStreamsAndTheSameSeedTheSame) {
  Rng a(1);
  Rng b(1);
  Rng c(2);
  const auto first = a.next();
  EXPECT_EQ(first, b.next());
  EXPECT_NE(first, c.next());
}

TEST(Escaped, LeavesUtf8AndHidesTerminalControl) {
  EXPECT_EQ(escaped("caf\xC3\xA9"), "caf\xC3\xA9");
  EXPECT_EQ(escaped("a\x1B[2Jb\n"), "a\\x1b[2Jb\\x0a");
  EXPECT_EQ(escaped("\xFF\xC3"), "\\xff\\xc3");
  EXPECT_EQ(escaped("\xC2\x9B"), "\\xc2\\x9b");  // C1 CSI
  EXPECT_EQ(escaped("abcdef", 3), "abc...");
}

TEST(Error, DiagnosticNamesPlaceAndCode) {
  const IoError at_line(Errc::malformed, "E_SYNTAX", "word", {"a.obj", 7, -1});
  EXPECT_EQ(at_line.diagnostic(), "a.obj:7: E_SYNTAX: word");
  const IoError at_byte(Errc::malformed, "E_TRUNCATED", "cut", {"b\n.ply", 0, 500});
  EXPECT_EQ(at_byte.diagnostic(), "b\\x0a.ply@0x1f4: E_TRUNCATED: cut");
}

TEST(Decimal, ParsesWhatStandsThereAndMovesOn) {
  const std::string text = "-12.5,30";
  const char* at = text.data();
  const char* end = at + text.size();
  double value = 0.0;
  ASSERT_TRUE(parse_decimal(at, end, value));
  EXPECT_EQ(value, -12.5);
  EXPECT_EQ(*at, ',');
  EXPECT_FALSE(parse_decimal(at, end, value));
  EXPECT_EQ(fixed_decimal(2.0 / 3.0, 3), "0.667");
  EXPECT_EQ(fixed_decimal(-1e20, 0), "-100000000000000000000");
}

TEST(WarningList, CountsOneEntryACode) {
  WarningList list;
  list.add("W_A", "face 3", "message", 2);
  list.add("W_A", "face 9", "message");
  list.add("W_B", "face 1", "none", 0);
  ASSERT_EQ(list.all().size(), 1U);
  EXPECT_EQ(list.all().front().count, 3);
  EXPECT_EQ(list.all().front().first, "face 3");
}

// Draws of neighbouring seeds are independent: none of the first 1000 numbers of 100 streams occurs
// twice (by chance once in 10^9 runs). A start that is linear in the seed shifts one stream by a
// place a seed.
TEST(Rng, NeighbouringSeedsShareNoNumbers) {
  std::vector<std::uint64_t> all;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    for (int i = 0; i < 1000; ++i) all.push_back(rng.next());
  }
  std::sort(all.begin(), all.end());
  EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
}

}  // namespace
}  // namespace dupin
