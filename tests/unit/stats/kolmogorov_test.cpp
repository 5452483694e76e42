#include "dupin/stats/kolmogorov.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double uniform_cdf(double x) { return std::min(1.0, std::max(0.0, x)); }

Eigen::VectorXd uniform_sample(Rng& rng, Eigen::Index count) {
  Eigen::VectorXd sample(count);
  for (double& x : sample) x = rng.uniform();
  return sample;
}

// P(D >= k / n) for two samples of n, exactly: paths that leave a strip, by reflection (Gnedenko
// and Korolyuk 1951): 2 sum_j (-1)^(j-1) C(2n, n - jk) / C(2n, n).
double exact_two_sample(int n, int k) {
  double sum = 0.0;
  for (int j = 1; j * k <= n; ++j) {
    const double logarithm =
        2.0 * std::lgamma(n + 1.0) - std::lgamma(n - j * k + 1.0) - std::lgamma(n + j * k + 1.0);
    sum += (j % 2 == 1 ? 2.0 : -2.0) * std::exp(logarithm);
  }
  return sum;
}

// The gap is taken on both sides of every jump.
TEST(KolmogorovStatistic, IsTheLargestGapOnEitherSideOfAJump) {
  EXPECT_NEAR(kolmogorov_statistic(Eigen::Vector3d(0.9, 0.3, 0.5), uniform_cdf), 0.3, 1e-15);
  EXPECT_NEAR(kolmogorov_statistic(Eigen::Vector2d(0.1, 0.2), uniform_cdf), 0.8, 1e-15);
  EXPECT_NEAR(kolmogorov_statistic(Eigen::Vector2d(0.8, 0.9), uniform_cdf), 0.8, 1e-15);
  // Midpoints of n equal cells reach the least possible D.
  const Eigen::VectorXd even = Eigen::VectorXd::LinSpaced(10, 0.05, 0.95);
  EXPECT_NEAR(kolmogorov_statistic(even, uniform_cdf), 0.05, 1e-15);
}

// D does not change under a growing map of values and distribution.
TEST(KolmogorovStatistic, IsFreeOfTheDistribution) {
  Rng rng(4);
  const Eigen::VectorXd sample = uniform_sample(rng, 50);
  const Eigen::VectorXd waits = -(1.0 - sample.array()).log();
  EXPECT_NEAR(kolmogorov_statistic(sample, uniform_cdf),
              kolmogorov_statistic(waits, [](double x) { return -std::expm1(-x); }), 1e-15);
}

TEST(KolmogorovStatistic, OfTwoSamplesCountsEqualValuesAtOnce) {
  const Eigen::Vector4d a(1.0, 2.0, 2.0, 3.0);
  EXPECT_EQ(kolmogorov_statistic(a, a), 0.0);
  EXPECT_EQ(kolmogorov_statistic(Eigen::Vector2d(1.0, 2.0), Eigen::Vector2d(3.0, 4.0)), 1.0);
  EXPECT_EQ(kolmogorov_statistic(Eigen::Vector2d(3.0, 4.0), Eigen::Vector2d(2.0, 1.0)), 1.0);
  EXPECT_EQ(kolmogorov_statistic(a, Eigen::Vector2d(2.0, 5.0)), 0.5);
}

// The two series, of which one is used on either side of 1, are one function: their alternating sum
// and its theta transform agree. Known: P(x > 1.3581) = .05, P(x > .8276) = .5.
TEST(KolmogorovSurvival, IsTheLimitFromBothSeries) {
  for (double x = 0.6; x < 1.6; x += 0.05) {
    double sum = 0.0;
    for (int k = 1; k < 40; ++k) sum += (k % 2 == 1 ? 2.0 : -2.0) * std::exp(-2.0 * k * k * x * x);
    EXPECT_NEAR(kolmogorov_survival(x), sum, 2e-15) << x;
  }
  EXPECT_NEAR(kolmogorov_survival(1.3581), 0.05, 1e-6);
  EXPECT_NEAR(kolmogorov_survival(0.82757), 0.5, 1e-5);
  EXPECT_EQ(kolmogorov_survival(-1.0), 1.0);
  EXPECT_EQ(kolmogorov_survival(100.0), 0.0);
  EXPECT_LE(kolmogorov_survival(0.16), 1.0);
  EXPECT_THROW(kolmogorov_survival(kNaN), InvalidArgument);
}

// Section 4.3.1 with L = 100: .19 is the value of two samples; of one sample it is .134.
TEST(KolmogorovCriticalValue, IsThatOfOneHundredExperiments) {
  EXPECT_NEAR(kolmogorov_critical_value(0.05, 100), 0.1340, 1e-4);
  EXPECT_NEAR(kolmogorov_critical_value(0.05, 100, 100), 0.1921, 1e-4);
}

// Exact .05 values of small samples (Massey 1951): .563 (n = 5), .409 (10), .294 (20).
TEST(KolmogorovCriticalValue, IsWithinOnePercentFromFiveValuesOn) {
  EXPECT_NEAR(kolmogorov_critical_value(0.05, 5), 0.563, 0.0056);
  EXPECT_NEAR(kolmogorov_critical_value(0.05, 10), 0.409, 0.0041);
  EXPECT_NEAR(kolmogorov_critical_value(0.05, 20), 0.294, 0.0029);
  EXPECT_LE(kolmogorov_critical_value(1e-12, 5), 1.0);
}

TEST(KolmogorovCriticalValue, InvertsThePValue) {
  for (const double significance : {1e-12, 1e-4, 0.05, 0.5, 0.99}) {
    EXPECT_NEAR(kolmogorov_p_value(kolmogorov_critical_value(significance, 1000), 1000),
                significance, 1e-11 * significance + 1e-14);
    EXPECT_NEAR(kolmogorov_p_value(kolmogorov_critical_value(significance, 800, 1000), 800, 1000),
                significance, 1e-11 * significance + 1e-14);
  }
}

// Two samples of 100: D moves in steps of .01. What the limit calls .05 rejects with the exact
// probability .0364 (from .20 on); one step less would be .0539.
TEST(KolmogorovCriticalValue, OfTwoSamplesDoesNotRejectTooOften) {
  for (const int n : {10, 30, 100, 300}) {
    const double critical = kolmogorov_critical_value(0.05, n, n);
    const int first_rejected = static_cast<int>(std::floor(critical * n)) + 1;
    EXPECT_LE(exact_two_sample(n, first_rejected), 0.05) << n;
  }
  EXPECT_NEAR(exact_two_sample(100, 20), 0.0364, 5e-5);
  EXPECT_NEAR(exact_two_sample(100, 19), 0.0539, 5e-5);
}

// Under the null hypothesis p-values are uniform: 2000 seeded samples of 20. The count under .05 is
// binomial(2000, .05), standard deviation 9.7; four of them and the 1 % of the form.
TEST(KolmogorovPValue, IsUniformUnderTheNullHypothesis) {
  Rng rng(8);
  int num_rejected = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::VectorXd sample = uniform_sample(rng, 20);
    if (kolmogorov_p_value(kolmogorov_statistic(sample, uniform_cdf), 20) < 0.05) ++num_rejected;
  }
  EXPECT_NEAR(num_rejected, 100, 40);
}

// 200 values with density 2x are told from uniform ones: D tends to 1/4, far over .095.
TEST(KolmogorovPValue, RejectsAnotherDistribution) {
  Rng rng(9);
  const Eigen::VectorXd sample = uniform_sample(rng, 200).array().sqrt();
  EXPECT_LT(kolmogorov_p_value(kolmogorov_statistic(sample, uniform_cdf), 200), 1e-6);
  const Eigen::VectorXd other = uniform_sample(rng, 200);
  EXPECT_LT(kolmogorov_p_value(kolmogorov_statistic(sample, other), 200, 200), 1e-3);
}

TEST(Kolmogorov, RefusesWhatIsOutOfRange) {
  EXPECT_THROW(kolmogorov_statistic(Eigen::VectorXd(), uniform_cdf), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(Eigen::Vector2d(0.1, kNaN), uniform_cdf), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(Eigen::VectorXd(), Eigen::Vector2d(1.0, 2.0)), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(Eigen::Vector2d(1.0, kNaN), Eigen::Vector2d(1.0, 2.0)),
               InvalidArgument);
  const Eigen::Vector2d ascending(0.1, 0.2);
  EXPECT_THROW(kolmogorov_statistic(ascending, [](double) { return kNaN; }), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(ascending, [](double) { return 1.5; }), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(ascending, [](double) { return -0.5; }), InvalidArgument);
  EXPECT_THROW(kolmogorov_statistic(ascending, [](double x) { return 1.0 - x; }), InvalidArgument);
  EXPECT_THROW(kolmogorov_p_value(-0.1, 10), InvalidArgument);
  EXPECT_THROW(kolmogorov_p_value(1.1, 10), InvalidArgument);
  EXPECT_THROW(kolmogorov_p_value(kNaN, 10, 10), InvalidArgument);
  EXPECT_THROW(kolmogorov_p_value(0.1, 4), InvalidArgument);
  EXPECT_THROW(kolmogorov_p_value(0.1, 4, 10), InvalidArgument);
  for (const double significance : {0.0, 1e-13, 1.0, kNaN}) {
    EXPECT_THROW(kolmogorov_critical_value(significance, 10), InvalidArgument);
    EXPECT_THROW(kolmogorov_critical_value(significance, 10, 10), InvalidArgument);
  }
}

}  // namespace
}  // namespace dupin
