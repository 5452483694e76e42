#include "dupin/stats/distributions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Table 4.3 of the thesis, printed to three decimals.
TEST(ChiSquare, ReproducesTable43OfTheThesis) {
  const double levels[] = {.10, .05, .025, .01, .001};
  const double five[] = {9.236, 11.070, 12.833, 15.086, 20.515};
  const double sixty_five[] = {79.973, 84.821, 89.177, 94.422, 105.988};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(chi_square_quantile(5.0, levels[i]), five[i], 1e-3);
    EXPECT_NEAR(chi_square_quantile(65.0, levels[i]), sixty_five[i], 1e-3);
  }
}

// chi^2 with 2 degrees of freedom is exponential: P(X > x) = exp(-x / 2), to the far tail.
TEST(ChiSquare, WithTwoDegreesOfFreedomIsExponential) {
  for (const double x : {1e-12, 0.1, 1.0, 20.0, 300.0, 1300.0}) {
    EXPECT_NEAR(chi_square_survival(x, 2.0) / std::exp(-0.5 * x), 1.0, 1e-12);
  }
  for (const double q : {1e-300, 1e-20, 0.05, 0.5, 0.99})
    EXPECT_NEAR(chi_square_quantile(2.0, q) / (-2.0 * std::log(q)), 1.0, 1e-12);
}

// Survival of the quantile is the probability; the condition number of the tail is about x / 2.
TEST(ChiSquare, QuantileInvertsSurvival) {
  for (const double dof : {0.5, 1.0, 2.0, 5.0, 35.0, 65.0, 1e4, 1e6}) {
    for (const double q : {1e-12, 1e-3, 0.05, 0.5, 0.95, 0.999}) {
      const double x = chi_square_quantile(dof, q);
      EXPECT_NEAR(chi_square_survival(x, dof) / q, 1.0, 1e-10 + 1e-14 * x) << dof << " " << q;
    }
  }
}

TEST(ChiSquare, SurvivalIsDefinedOnTheWholeLine) {
  for (const double x : {5e-324, 1e-300, 1e-10})
    for (const double dof : {1e3, 1e6, 1e9}) EXPECT_EQ(chi_square_survival(x, dof), 1.0);
  EXPECT_EQ(chi_square_survival(-1.0, 5.0), 1.0);
  EXPECT_EQ(chi_square_survival(0.0, 5.0), 1.0);
  EXPECT_EQ(chi_square_survival(kInfinity, 5.0), 0.0);
  EXPECT_EQ(chi_square_survival(1e300, 5.0), 0.0);
}

// One squared N(m, 1): P(X <= x) = Phi(sqrt x - m) - Phi(-sqrt x - m).
TEST(NoncentralChiSquare, WithOneDegreeOfFreedomIsASquaredNormal) {
  for (const double m : {0.3, 1.0, 3.0}) {
    for (const double x : {0.2, 2.0, 9.0, 25.0}) {
      const double r = std::sqrt(x);
      EXPECT_NEAR(noncentral_chi_square_cdf(x, 1.0, m * m),
                  normal_survival(m - r) - normal_survival(m + r), 1e-13);
      EXPECT_NEAR(noncentral_chi_square_survival(x, 1.0, m * m),
                  normal_survival(r - m) + normal_survival(m + r), 1e-13);
    }
  }
}

// X is chi^2 with dof + 2 J degrees of freedom, J Poisson with mean half the noncentrality.
TEST(NoncentralChiSquare, IsAPoissonMixtureOfCentralOnes) {
  const double dof = 65.0;
  const double noncentrality = 20.0;
  for (const double x : {40.0, 84.821, 150.0}) {
    double weight = std::exp(-0.5 * noncentrality);
    double sum = 0.0;
    for (int j = 0; j < 80; ++j) {  // the rest weighs less than 1e-40
      sum += weight * chi_square_survival(x, dof + 2.0 * j);
      weight *= 0.5 * noncentrality / (j + 1.0);
    }
    EXPECT_NEAR(noncentral_chi_square_survival(x, dof, noncentrality) / sum, 1.0, 1e-11);
  }
}

TEST(NoncentralChiSquare, WithoutNoncentralityIsCentral) {
  EXPECT_NEAR(noncentral_chi_square_survival(11.07, 5.0, 0.0), chi_square_survival(11.07, 5.0),
              1e-15);
  EXPECT_NEAR(noncentral_chi_square_cdf(11.07, 5.0, 0.0) + chi_square_survival(11.07, 5.0), 1.0,
              1e-14);
  EXPECT_EQ(noncentral_chi_square_quantile(5.0, 0.0, 0.05), chi_square_quantile(5.0, 0.05));
}

TEST(NoncentralChiSquare, QuantileInvertsSurvival) {
  for (const double dof : {2.0, 65.0}) {
    for (const double noncentrality : {0.01, 5.0, 300.0}) {
      for (const double q : {1e-6, 0.05, 0.5, 0.99}) {
        const double x = noncentral_chi_square_quantile(dof, noncentrality, q);
        EXPECT_NEAR(noncentral_chi_square_survival(x, dof, noncentrality) / q, 1.0, 1e-9);
      }
    }
  }
}

TEST(NoncentralChiSquare, HasLimitsZeroAndOne) {
  EXPECT_EQ(noncentral_chi_square_cdf(-1.0, 3.0, 2.0), 0.0);
  EXPECT_EQ(noncentral_chi_square_cdf(kInfinity, 3.0, 2.0), 1.0);
  EXPECT_EQ(noncentral_chi_square_survival(0.0, 3.0, 2.0), 1.0);
  EXPECT_EQ(noncentral_chi_square_survival(kInfinity, 3.0, 2.0), 0.0);
}

// The square of N(0, 1) is chi^2 with one degree of freedom, and 2 P(Z > z) = erfc(z / sqrt 2).
TEST(Normal, AgreesWithChiSquareAndErfc) {
  EXPECT_NEAR(normal_quantile(0.025), 1.959963984540054, 1e-14);
  EXPECT_NEAR(normal_quantile(0.975), -1.959963984540054, 1e-14);
  for (const double q : {1e-15, 0.01, 0.3}) {
    const double z = normal_quantile(0.5 * q);
    EXPECT_NEAR(z * z / chi_square_quantile(1.0, q), 1.0, 1e-11);
  }
  for (const double z : {-8.0, -1.0, 0.0, 2.5, 30.0})
    EXPECT_NEAR(normal_survival(z) / (0.5 * std::erfc(z / std::numbers::sqrt2)), 1.0, 1e-12);
  EXPECT_EQ(normal_survival(kInfinity), 0.0);
  EXPECT_EQ(normal_survival(-kInfinity), 1.0);
}

// One degree of freedom is Cauchy, two have x = (1 - 2q) / sqrt(2 q (1 - q)), many are normal.
TEST(StudentT, HasItsClosedForms) {
  for (const double q : {1e-6, 0.025, 0.3, 0.7}) {
    EXPECT_NEAR(student_t_quantile(1.0, q) * std::tan(std::numbers::pi * q), 1.0, 1e-11);
    EXPECT_NEAR(student_t_quantile(2.0, q) * std::sqrt(2.0 * q * (1.0 - q)) / (1.0 - 2.0 * q), 1.0,
                1e-12);
    EXPECT_NEAR(student_t_quantile(1e9, q), normal_quantile(q), 1e-6);
  }
  EXPECT_EQ(student_t_quantile(7.0, 0.5), 0.0);
}

// Far out exp(-exp(-z)) is 1 - exp(-z), which a difference from one would lose.
TEST(Gumbel, SurvivalKeepsItsDigitsFarOut) {
  const Gumbel g{2.0, 0.5};
  for (const double z : {40.0, 300.0})
    EXPECT_NEAR(gumbel_survival(2.0 + 0.5 * z, g) / std::exp(-z), 1.0, 1e-12);
  EXPECT_NEAR(gumbel_survival(2.0, g), 1.0 - std::exp(-1.0), 1e-15);
  EXPECT_EQ(gumbel_survival(-1e300, g), 1.0);
  EXPECT_EQ(gumbel_survival(kInfinity, g), 0.0);
}

// Inverse sampling; the standard errors of the moments are 1.17 scale / sqrt(n) (location) and
// 1.05 scale / sqrt(n) (scale). Five of them, n = 20000.
TEST(Gumbel, FitRecoversPlantedParameters) {
  Rng rng(11);
  Eigen::VectorXd sample(20000);
  for (double& x : sample) x = 3.0 - 2.0 * std::log(-std::log(1.0 - rng.uniform()));
  const Gumbel fitted = fit_gumbel(sample);
  const double error = 5.0 * 1.2 * 2.0 / std::sqrt(20000.0);
  EXPECT_NEAR(fitted.location, 3.0, error);
  EXPECT_NEAR(fitted.scale, 2.0, error);
}

// a + b X has location a + b location and scale b scale.
TEST(Gumbel, FitFollowsUnits) {
  const Eigen::VectorXd sample = Eigen::VectorXd::LinSpaced(9, 0.0, 2.0).array().square();
  const Gumbel one = fit_gumbel(sample);
  for (const double unit : {1e-200, 1e3, 1e200}) {
    const Gumbel other = fit_gumbel((unit * (sample.array() + 7.0)).matrix());
    EXPECT_NEAR(other.location / unit, one.location + 7.0, 1e-13);
    EXPECT_NEAR(other.scale / unit, one.scale, 1e-13);
  }
}

TEST(Distributions, RefuseWhatIsOutOfRange) {
  for (const double dof : {0.0, -1.0, 2e9, kNaN, kInfinity}) {
    EXPECT_THROW(chi_square_quantile(dof, 0.5), InvalidArgument);
    EXPECT_THROW(chi_square_survival(1.0, dof), InvalidArgument);
    EXPECT_THROW(student_t_quantile(dof, 0.5), InvalidArgument);
    EXPECT_THROW(noncentral_chi_square_cdf(1.0, dof, 1.0), InvalidArgument);
    EXPECT_THROW(noncentral_chi_square_survival(1.0, dof, 1.0), InvalidArgument);
    EXPECT_THROW(noncentral_chi_square_quantile(dof, 1.0, 0.5), InvalidArgument);
  }
  for (const double q : {0.0, 1.0, -0.1, 1.1, kNaN}) {
    EXPECT_THROW(chi_square_quantile(5.0, q), InvalidArgument);
    EXPECT_THROW(normal_quantile(q), InvalidArgument);
    EXPECT_THROW(student_t_quantile(5.0, q), InvalidArgument);
    EXPECT_THROW(noncentral_chi_square_quantile(5.0, 1.0, q), InvalidArgument);
  }
  for (const double noncentrality : {-1.0, 2e6, kNaN})
    EXPECT_THROW(noncentral_chi_square_cdf(1.0, 5.0, noncentrality), InvalidArgument);
  EXPECT_THROW(chi_square_survival(kNaN, 5.0), InvalidArgument);
  EXPECT_THROW(normal_survival(kNaN), InvalidArgument);
  EXPECT_THROW(noncentral_chi_square_cdf(kNaN, 5.0, 1.0), InvalidArgument);
  EXPECT_THROW(gumbel_survival(kNaN, {}), InvalidArgument);
  EXPECT_THROW(gumbel_survival(0.0, {0.0, 0.0}), InvalidArgument);
  EXPECT_THROW(gumbel_survival(0.0, {kInfinity, 1.0}), InvalidArgument);
  EXPECT_THROW(fit_gumbel(Eigen::VectorXd::Zero(1)), InvalidArgument);
  EXPECT_THROW(fit_gumbel(Eigen::VectorXd::Ones(5)), InvalidArgument);
  EXPECT_THROW(fit_gumbel(Eigen::Vector3d(1.0, kNaN, 2.0)), InvalidArgument);
}

// At the corners of the legal ranges: a finite value or an error of ours, never one of Boost.
TEST(Distributions, CornersGiveAValueOrAnErrorOfOurs) {
  const std::vector<double> dofs = {1e-300, 1e-3, 1.0, 1e6};
  const std::vector<double> probabilities = {1e-300, 1e-16, 0.5, 1.0 - 1e-16};
  const std::vector<double> values = {1e-300, 1.0, 1e6, 1e300};
  const std::vector<double> noncentralities = {1e-300, 1.0, 1e6};
  int num_values = 0;
  int num_errors = 0;
  const auto tally = [&](const auto& function) {
    try {
      EXPECT_TRUE(std::isfinite(function()));
      ++num_values;
    } catch (const Error&) {
      ++num_errors;
    }
  };
  for (const double dof : dofs) {
    for (const double q : probabilities) {
      tally([&] { return chi_square_quantile(dof, q); });
      tally([&] { return student_t_quantile(dof, q); });
      tally([&] { return normal_quantile(q); });
      for (const double noncentrality : noncentralities)
        tally([&] { return noncentral_chi_square_quantile(dof, noncentrality, q); });
    }
    for (const double x : values) {
      tally([&] { return chi_square_survival(x, dof); });
      tally([&] { return normal_survival(x); });
      for (const double noncentrality : noncentralities) {
        tally([&] { return noncentral_chi_square_cdf(x, dof, noncentrality); });
        tally([&] { return noncentral_chi_square_survival(x, dof, noncentrality); });
      }
    }
  }
  // Student's quantile is beyond a double for dof <= 1e-3, but for the median.
  EXPECT_EQ(num_errors, 6);
  EXPECT_EQ(num_values, 4 * (4 * 6 + 4 * 8) - 6);
}

}  // namespace
}  // namespace dupin
