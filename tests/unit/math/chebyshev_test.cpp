#include "dupin/math/chebyshev.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::VectorXd;

// exp(-t s) on [0, s_max]: the series must agree with the function everywhere, not only at its
// nodes.
TEST(Chebyshev, ReproducesAnExponentialToRounding) {
  const auto functions = [](double s) { return VectorXd::Constant(1, std::exp(-20.0 * s)); };
  const Eigen::MatrixXd c = chebyshev_coefficients(functions, 1.5);
  for (int i = 0; i <= 1000; ++i) {
    const double s = 1.5 * i / 1000.0;
    EXPECT_NEAR(evaluate_chebyshev(c, 0, c.rows(), s, 1.5), std::exp(-20.0 * s), 1e-14);
  }
}

// The tail sum bounds the error of the truncated series; and it is not far above it, or the bound
// would be idle.
TEST(Chebyshev, TheTailSumBoundsTheTruncationError) {
  const auto functions = [](double s) {
    VectorXd f(2);
    f << 1.0 / (1.0 + 50.0 * s), 1.0 / ((1.0 + 400.0 * s) * (1.0 + 300.0 * s));
    return f;
  };
  const Eigen::MatrixXd c = chebyshev_coefficients(functions, 2.0);
  const Eigen::VectorXi length = truncation_lengths(c, VectorXd::Constant(2, 1e-6));
  for (Eigen::Index l = 0; l < 2; ++l) {
    EXPECT_LT(length[l], c.rows());
    const double tail = c.col(l).tail(c.rows() - length[l]).cwiseAbs().sum();
    EXPECT_LE(tail, 1e-6);
    double worst = 0.0;
    for (int i = 0; i <= 4000; ++i) {
      const double s = 2.0 * i / 4000.0;
      worst =
          std::max(worst, std::abs(evaluate_chebyshev(c, l, length[l], s, 2.0) - functions(s)[l]));
    }
    EXPECT_LE(worst, tail + 1e-14);
    EXPECT_GE(worst, 0.1 * tail);  // at s = 0 all terms have one sign
  }
}

// Three functions (an odd number: they are transformed in pairs) whose series are known: T_5, T_0 +
// T_1 and T_30.
TEST(Chebyshev, FindsThePolynomialsThemselves) {
  const auto functions = [](double s) {
    const double angle = std::acos(1.0 - 2.0 * s);
    VectorXd f(3);
    f << std::cos(5.0 * angle), 1.0 + std::cos(angle), std::cos(30.0 * angle);
    return f;
  };
  const Eigen::MatrixXd c = chebyshev_coefficients(functions, 1.0);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(c.rows(), 3);
  expected(5, 0) = expected(0, 1) = expected(1, 1) = expected(30, 2) = 1.0;
  EXPECT_LE((c - expected).cwiseAbs().maxCoeff(), 1e-14);
}

// 70 functions that need all 16,384 nodes and more: the sums by definition took 12 s.
TEST(Chebyshev, GivesUpSoonOnAWideSpectrum) {
  const auto functions = [](double s) { return VectorXd::Constant(70, 1.0 / (1.0 + 1e9 * s)); };
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(chebyshev_coefficients(functions, 1.0), Error);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(4));
}

TEST(Chebyshev, IsEmptyWhenCancelled) {
  const RunControl run = RunControl::create();
  run.cancel();
  const auto functions = [](double s) { return VectorXd::Constant(1, std::exp(-s)); };
  EXPECT_EQ(chebyshev_coefficients(functions, 1.0, 1 << 14, run).size(), 0);
}

TEST(Chebyshev, AConstantNeedsOneTerm) {
  const Eigen::MatrixXd c =
      chebyshev_coefficients([](double) { return VectorXd::Constant(1, 3.0); }, 1.0);
  EXPECT_EQ(truncation_lengths(c, VectorXd::Constant(1, 1e-12))[0], 1);
  EXPECT_NEAR(c(0, 0), 3.0, 1e-14);
}

// A kink has coefficients that fall like 1/k^2: no tail bound can be given, so none is.
TEST(Chebyshev, RefusesAFunctionItCannotResolve) {
  const auto kink = [](double s) { return VectorXd::Constant(1, std::abs(s - 0.4)); };
  try {
    chebyshev_coefficients(kink, 1.0, 512);
    FAIL() << "a kink has no short series";
  } catch (const Error& error) {
    // Not the caller's fault: the spectrum comes from the data.
    EXPECT_EQ(error.errc(), Errc::numerical);
    EXPECT_EQ(error.code(), "E_NOT_CONVERGED");
  }
}

}  // namespace
}  // namespace dupin
