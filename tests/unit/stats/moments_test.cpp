#include "dupin/stats/moments.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Four points of a square with side 2: variances 4/3, no covariance. An offset of 2^26 is exact in
// double, and its square would swallow the variances.
TEST(SampleMoments, DoNotLoseALargeOffset) {
  Eigen::MatrixXd sample(4, 2);
  sample << 1, 1, 1, -1, -1, 1, -1, -1;
  for (const double offset : {0.0, 67108864.0}) {
    const SampleMoments moments = sample_moments((sample.array() + offset).matrix());
    EXPECT_EQ((moments.mean.array() - offset).abs().maxCoeff(), 0.0);
    EXPECT_NEAR(moments.covariance(0, 0), 4.0 / 3.0, 1e-15);
    EXPECT_NEAR(moments.covariance(1, 1), 4.0 / 3.0, 1e-15);
    EXPECT_EQ(moments.covariance(0, 1), 0.0);
  }
}

// mean(A x) = A mean(x), cov(A x) = A cov(x) A^T.
TEST(SampleMoments, FollowLinearMaps) {
  Rng rng(2);
  Eigen::MatrixXd sample(40, 3);
  for (double& x : sample.reshaped()) x = rng.normal();
  Eigen::MatrixXd a(2, 3);
  a << 1, 2, -1, 0.5, 0, 4;
  const SampleMoments one = sample_moments(sample);
  const SampleMoments other = sample_moments(sample * a.transpose());
  EXPECT_LT((other.mean - a * one.mean).norm(), 1e-14);
  EXPECT_LT((other.covariance - a * one.covariance * a.transpose()).norm(), 1e-13);
  EXPECT_EQ(one.covariance, Eigen::MatrixXd(one.covariance.transpose()));
}

// c4 is sqrt(2/pi) for one degree of freedom, sqrt(pi)/2 for two, and 1 - 1/(4 dof) in the limit;
// the erratum of section 4.2.4 has .9754 for ten.
TEST(C4, HasItsClosedForms) {
  EXPECT_NEAR(c4(1.0), std::sqrt(2.0 / std::numbers::pi), 1e-14);
  EXPECT_NEAR(c4(2.0), 0.5 * std::sqrt(std::numbers::pi), 1e-14);
  EXPECT_NEAR(c4(10.0), 0.9754, 5e-5);
  EXPECT_NEAR(c4(1e9), 1.0 - 0.25e-9, 1e-12);
}

// 4000 estimates with ten degrees of freedom of sigma = 1: the mean of s tends to c4 = .9754, the
// pooled one to 1. Standard errors .0035 and .0035; four of each.
TEST(PooledStandardDeviation, HasNoBiasWhereTheMeanOfDeviationsHas) {
  Rng rng(6);
  Eigen::VectorXd variances(4000);
  for (double& v : variances) {
    v = 0.0;
    for (int i = 0; i < 10; ++i) v += std::pow(rng.normal(), 2) / 10.0;
  }
  const Eigen::VectorXd dofs = Eigen::VectorXd::Constant(4000, 10.0);
  EXPECT_NEAR(pooled_standard_deviation(variances, dofs), 1.0, 0.014);
  EXPECT_NEAR(variances.array().sqrt().mean(), c4(10.0), 0.014);
}

TEST(PooledStandardDeviation, WeighsByDegreesOfFreedom) {
  EXPECT_NEAR(pooled_standard_deviation(Eigen::Vector2d(1.0, 4.0), Eigen::Vector2d(1.0, 2.0)),
              std::sqrt(3.0), 1e-15);
  EXPECT_EQ(pooled_standard_deviation(Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, 2.0)), 0.0);
  EXPECT_NEAR(
      pooled_standard_deviation(Eigen::Vector2d(1e307, 1e307), Eigen::Vector2d(1e3, 1e300)) /
          std::sqrt(1e307),
      1.0, 1e-15);
}

// Two degrees of freedom: quantiles of chi^2 are -2 log q.
TEST(VarianceInterval, HasItsClosedFormForTwoDegreesOfFreedom) {
  const Interval interval = variance_interval(3.0, 2.0, 0.9);
  EXPECT_NEAR(interval.low, 3.0 / -std::log(0.05), 1e-13);
  EXPECT_NEAR(interval.high, 3.0 / -std::log(0.95), 1e-11);
  const Interval zero = variance_interval(0.0, 2.0, 0.9);
  EXPECT_EQ(zero.low, 0.0);
  EXPECT_EQ(zero.high, 0.0);
}

// The interval covers the true variance as often as it says; 3000 seeded experiments, and the count
// is judged by the exact binomial interval at five standard deviations.
TEST(VarianceInterval, CoversTheTruthAsOftenAsItSays) {
  Rng rng(12);
  int num_covered = 0;
  for (int i = 0; i < 3000; ++i) {
    double variance = 0.0;
    for (int k = 0; k < 6; ++k) variance += std::pow(2.0 * rng.normal(), 2) / 6.0;
    const Interval interval = variance_interval(variance, 6.0, 0.8);
    if (interval.low <= 4.0 && 4.0 <= interval.high) ++num_covered;
  }
  const Interval coverage = binomial_interval(num_covered, 3000, 1.0 - 6e-7);
  EXPECT_LT(coverage.low, 0.8);
  EXPECT_GT(coverage.high, 0.8);
}

// No success in n: the upper end solves (1 - p)^n = tail; symmetric for n successes.
TEST(BinomialInterval, HasItsClosedFormAtTheEnds) {
  const Interval none = binomial_interval(0, 20, 0.95);
  EXPECT_EQ(none.low, 0.0);
  EXPECT_NEAR(none.high, 1.0 - std::pow(0.025, 1.0 / 20.0), 1e-14);
  const Interval all = binomial_interval(20, 20, 0.95);
  EXPECT_NEAR(all.low, std::pow(0.025, 1.0 / 20.0), 1e-14);
  EXPECT_EQ(all.high, 1.0);
}

// The ends solve P(X >= k | low) = P(X <= k | high) = tail; the sums are written out.
TEST(BinomialInterval, EndsSolveTheBinomialTails) {
  const int n = 12;
  const int k = 4;
  const Interval interval = binomial_interval(k, n, 0.9);
  const auto mass = [&](int j, double p) {
    return std::exp(std::lgamma(n + 1.0) - std::lgamma(j + 1.0) - std::lgamma(n - j + 1.0)) *
           std::pow(p, j) * std::pow(1.0 - p, n - j);
  };
  double above = 0.0;
  double below = 0.0;
  for (int j = k; j <= n; ++j) above += mass(j, interval.low);
  for (int j = 0; j <= k; ++j) below += mass(j, interval.high);
  EXPECT_NEAR(above, 0.05, 1e-12);
  EXPECT_NEAR(below, 0.05, 1e-12);
}

TEST(Moments, RefuseWhatIsOutOfRange) {
  EXPECT_THROW(sample_moments(Eigen::MatrixXd::Zero(1, 2)), InvalidArgument);
  EXPECT_THROW(sample_moments(Eigen::MatrixXd::Zero(3, 0)), InvalidArgument);
  EXPECT_THROW(sample_moments(Eigen::MatrixXd::Constant(3, 1, kNaN)), InvalidArgument);
  EXPECT_THROW(sample_moments(Eigen::MatrixXd::Constant(3, 1, 1e200)), InvalidArgument);
  for (const double dof : {0.0, -1.0, 2e9, kNaN}) {
    EXPECT_THROW(c4(dof), InvalidArgument);
    EXPECT_THROW(variance_interval(1.0, dof, 0.9), InvalidArgument);
  }
  for (const double confidence : {0.0, 1.0, kNaN}) {
    EXPECT_THROW(variance_interval(1.0, 5.0, confidence), InvalidArgument);
    EXPECT_THROW(binomial_interval(1, 2, confidence), InvalidArgument);
  }
  for (const double variance : {-1.0, kNaN, kInfinity}) {
    EXPECT_THROW(variance_interval(variance, 5.0, 0.9), InvalidArgument);
    EXPECT_THROW(
        pooled_standard_deviation(Eigen::VectorXd::Constant(1, variance), Eigen::VectorXd::Ones(1)),
        InvalidArgument);
  }
  EXPECT_THROW(pooled_standard_deviation(Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)),
               InvalidArgument);
  EXPECT_THROW(pooled_standard_deviation(Eigen::VectorXd::Ones(2), Eigen::VectorXd::Ones(1)),
               InvalidArgument);
  EXPECT_THROW(pooled_standard_deviation(Eigen::VectorXd(), Eigen::VectorXd()), InvalidArgument);
  EXPECT_THROW(binomial_interval(-1, 2, 0.9), InvalidArgument);
  EXPECT_THROW(binomial_interval(3, 2, 0.9), InvalidArgument);
  EXPECT_THROW(binomial_interval(0, 0, 0.9), InvalidArgument);
}

}  // namespace
}  // namespace dupin
