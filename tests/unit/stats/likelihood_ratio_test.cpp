#include "dupin/stats/likelihood_ratio.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/stats/distributions.h"
#include "dupin/stats/kolmogorov.h"
#include "dupin/stats/moments.h"

namespace dupin {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::MatrixXd normal_matrix(Rng& rng, Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd m(rows, cols);
  for (double& x : m.reshaped()) x = rng.normal();
  return m;
}

// N(mean, factor factor^T), `factor` p by r: the covariance has rank r.
struct Normal {
  Eigen::VectorXd mean;
  Eigen::MatrixXd factor;

  Normal(Rng& rng, Eigen::Index p, Eigen::Index r)
      : mean(normal_matrix(rng, p, 1)), factor(normal_matrix(rng, p, r)) {
    factor.topRows(r).diagonal().array() += 4.0;  // far from singular
  }
  Eigen::MatrixXd covariance() const { return factor * factor.transpose(); }
  Eigen::MatrixXd draw(Rng& rng, Eigen::Index count) const {
    return (normal_matrix(rng, count, factor.cols()) * factor.transpose()).rowwise() +
           mean.transpose();
  }
};

double log_density(const Eigen::VectorXd& x, const Eigen::VectorXd& mean,
                   const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd d = x - mean;
  return -0.5 * (static_cast<double>(x.size()) * std::log(2.0 * std::numbers::pi) +
                 std::log(covariance.determinant()) + d.dot(covariance.inverse() * d));
}

Eigen::VectorXd statistics(Rng& rng, const Normal& normal, Eigen::Index count,
                           Eigen::Index repetitions) {
  Eigen::VectorXd t(repetitions);
  for (double& value : t) {
    value =
        likelihood_ratio_test(normal.draw(rng, count), normal.mean, normal.covariance()).statistic;
  }
  return t;
}

double p_value_of_chi_square(const Eigen::VectorXd& t, double dof) {
  return kolmogorov_p_value(
      kolmogorov_statistic(t, [&](double x) { return 1.0 - chi_square_survival(x, dof); }),
      t.size());
}

// T is twice the difference of the sums of log densities at the maximum (sample mean, covariance
// divided by M) and at the hypothesis. Erratum of Eq. 4.54: n = 50, p = 3.
TEST(LikelihoodRatio, IsTwiceTheDifferenceOfLogLikelihoods) {
  Rng rng(21);
  const Normal normal(rng, 3, 3);
  const Eigen::MatrixXd sample = normal.draw(rng, 50);
  const Eigen::VectorXd best_mean = sample_moments(sample).mean;
  const Eigen::MatrixXd best_covariance = sample_moments(sample).covariance * (49.0 / 50.0);
  double twice_gap = 0.0;
  for (Eigen::Index i = 0; i < 50; ++i) {
    const Eigen::VectorXd x = sample.row(i);
    twice_gap += 2.0 * (log_density(x, best_mean, best_covariance) -
                        log_density(x, normal.mean, normal.covariance()));
  }
  const LikelihoodRatio ratio = likelihood_ratio_test(sample, normal.mean, normal.covariance());
  EXPECT_NEAR(ratio.statistic, twice_gap, 1e-11);
  EXPECT_EQ(ratio.rank, 3);
  EXPECT_EQ(ratio.dof, 9.0);
  EXPECT_EQ(ratio.p_value, chi_square_survival(ratio.statistic, 9.0));
  EXPECT_EQ(ratio.outside_rms, 0.0);
}

// p = 1, draws 1 and 3 (five of each), N(0, 1): S = 1, d = 2, T = 10 (1 + 4 - 0 - 1) = 40.
TEST(LikelihoodRatio, OfOneVariableByHand) {
  Eigen::MatrixXd sample(10, 1);
  sample << 1, 1, 1, 1, 1, 3, 3, 3, 3, 3;
  EXPECT_NEAR(likelihood_ratio_test(sample, Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Ones(1, 1))
                  .statistic,
              40.0, 1e-13);
}

// Under the hypothesis T ~ chi^2 with K (K + 1) / 2 + K degrees of freedom: 5, 20, 65; full rank
// and rank 2 of 5. 500 draws each, M = 1000 (the bias of the mean is then under .3). A p-value
// below .001 would be a wrong number of degrees of freedom or a rare seed.
TEST(LikelihoodRatio, IsChiSquareUnderTheHypothesis) {
  Rng rng(22);
  const struct {
    Eigen::Index p, rank;
    double dof;
  } cases[] = {{2, 2, 5.0}, {5, 5, 20.0}, {10, 10, 65.0}, {5, 2, 5.0}};
  for (const auto& c : cases) {
    const Normal normal(rng, c.p, c.rank);
    const Eigen::VectorXd t = statistics(rng, normal, 1000, 500);
    EXPECT_GT(p_value_of_chi_square(t, c.dof), 1e-3) << c.p << " " << c.rank;
    // The test of the test: one degree of freedom in ten more is seen.
    EXPECT_LT(p_value_of_chi_square(t, 1.2 * c.dof), 1e-3) << c.p << " " << c.rank;
  }
}

// For small M the mean of T is above the degrees of freedom: M K log(M/2) - M sum_i psi((M - i)/2),
// i = 1 .. K, since trace and mean have expectation K together: 70.68 (M = 50) and 66.29 (200) for
// K = 10. Standard error of 2000 draws 11.6 / 45 = .26; four of them.
TEST(LikelihoodRatio, HasTheKnownBiasForSmallSamples) {
  Rng rng(23);
  const Normal normal(rng, 10, 10);
  EXPECT_NEAR(statistics(rng, normal, 50, 2000).mean(), 70.68, 1.05);
  EXPECT_NEAR(statistics(rng, normal, 200, 2000).mean(), 66.29, 1.05);
}

// At an umbilic H and K move together to first order: Sigma has rank 1, and the sample a tiny
// second component of second order. Inverted naively, T explodes; reduced it is chi^2 with 2.
TEST(LikelihoodRatio, IsReducedAtAnUmbilicWhereTheNaiveOneExplodes) {
  Rng rng(24);
  const Eigen::Vector2d direction(1.0, 2.0);  // dK = 2 dH on the unit sphere
  const Eigen::Matrix2d covariance = 0.01 * direction * direction.transpose();
  Eigen::VectorXd reduced(500);
  for (double& t : reduced) {
    Eigen::MatrixXd sample(400, 2);
    for (Eigen::Index i = 0; i < sample.rows(); ++i) {
      const double z = 0.1 * rng.normal();
      sample.row(i) << 1.0 + z, 1.0 + 2.0 * z + 1e-3 * (z * z - 0.01);
    }
    const Eigen::Vector2d mean(1.0, 1.0);
    const LikelihoodRatio ratio = likelihood_ratio_test(sample, mean, covariance);
    ASSERT_EQ(ratio.rank, 1);
    EXPECT_EQ(ratio.dof, 2.0);
    EXPECT_GT(ratio.outside_rms, 1e-6);
    EXPECT_LT(ratio.outside_rms, 1e-4);
    t = ratio.statistic;
    LikelihoodRatioOptions naive;
    naive.relative_epsilon = 0.0;
    const Eigen::Vector2d across(2.0, -1.0);
    const LikelihoodRatio exploded = likelihood_ratio_test(
        sample, mean, covariance + 1e-16 * across * across.transpose(), naive);
    EXPECT_EQ(exploded.rank, 2);
    EXPECT_GT(exploded.statistic, 1e6);
  }
  EXPECT_GT(p_value_of_chi_square(reduced, 2.0), 1e-3);
  EXPECT_LT(p_value_of_chi_square(reduced, 5.0), 1e-6);
}

// x -> A x + b, mean -> A mean + b, C -> A C A^T leaves T alone. Condition of A C A^T about 1e3.
TEST(LikelihoodRatio, DoesNotChangeUnderLinearMaps) {
  Rng rng(25);
  const Normal normal(rng, 4, 4);
  const Eigen::MatrixXd sample = normal.draw(rng, 60);
  const double t = likelihood_ratio_test(sample, normal.mean, normal.covariance()).statistic;
  const Normal map(rng, 4, 4);
  const Eigen::MatrixXd& a = map.factor;
  const Eigen::MatrixXd mapped = (sample * a.transpose()).rowwise() + map.mean.transpose();
  EXPECT_NEAR(likelihood_ratio_test(mapped, a * normal.mean + map.mean,
                                    a * normal.covariance() * a.transpose())
                  .statistic,
              t, 1e-9);
  for (const double unit : {1e-100, 1e-6, 1e100}) {
    EXPECT_NEAR(likelihood_ratio_test(unit * sample, unit * normal.mean,
                                      unit * (unit * normal.covariance()))
                    .statistic,
                t, 1e-10);
  }
}

// Rotating a sample of deficient rank within its space leaves T and rank alone.
TEST(LikelihoodRatio, OfDeficientRankDoesNotChangeUnderRotations) {
  Rng rng(26);
  const Normal normal(rng, 4, 2);
  const Eigen::MatrixXd sample = normal.draw(rng, 60);
  const Eigen::MatrixXd q =
      Eigen::HouseholderQR<Eigen::MatrixXd>(normal_matrix(rng, 4, 4)).householderQ();
  const LikelihoodRatio one = likelihood_ratio_test(sample, normal.mean, normal.covariance());
  const LikelihoodRatio other = likelihood_ratio_test(sample * q.transpose(), q * normal.mean,
                                                      q * normal.covariance() * q.transpose());
  EXPECT_EQ(one.rank, 2);
  EXPECT_EQ(other.rank, 2);
  EXPECT_NEAR(one.statistic, other.statistic, 1e-10);
  EXPECT_LT(one.outside_rms, 1e-14);
}

// A covariance 1.5 times too large or small, or a mean off by half a deviation, is rejected: the
// expected T is M (x - 1 - log x) p = 200 x .0721 x 3 = 43 over dof, or 200 / 4 = 50.
TEST(LikelihoodRatio, RejectsAWrongCovarianceAndAWrongMean) {
  Rng rng(27);
  const Normal normal(rng, 3, 3);
  int num_accepted = 0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::MatrixXd sample = normal.draw(rng, 200);
    const Eigen::MatrixXd c = normal.covariance();
    EXPECT_LT(likelihood_ratio_test(sample, normal.mean, 1.5 * c).p_value, 0.01);
    EXPECT_LT(likelihood_ratio_test(sample, normal.mean, c / 1.5).p_value, 0.01);
    const Eigen::VectorXd moved = normal.mean + 0.5 * normal.factor.col(0);
    EXPECT_LT(likelihood_ratio_test(sample, moved, c).p_value, 0.01);
    if (likelihood_ratio_test(sample, normal.mean, c).p_value > 0.05) ++num_accepted;
  }
  EXPECT_GT(num_accepted, 40);  // 47.5 expected, standard deviation 1.5
}

// The absolute rule of the thesis depends on units, the relative one does not.
TEST(LikelihoodRatio, ThesisOptionsDropByAbsoluteSize) {
  Rng rng(28);
  const Eigen::MatrixXd sample =
      normal_matrix(rng, 30, 2) * Eigen::Vector2d(1.0, 0.03).asDiagonal();
  const Eigen::Matrix2d c = Eigen::Vector2d(1.0, 9e-4).asDiagonal();
  const Eigen::Vector2d zero = Eigen::Vector2d::Zero();
  const LikelihoodRatioOptions thesis = thesis_likelihood_ratio_options();
  EXPECT_EQ(likelihood_ratio_test(sample, zero, c, thesis).rank, 1);
  EXPECT_EQ(likelihood_ratio_test(10.0 * sample, zero, 100.0 * c, thesis).rank, 2);
  EXPECT_EQ(likelihood_ratio_test(sample, zero, c).rank, 2);
  EXPECT_THROW(likelihood_ratio_test(1e-3 * sample, zero, 1e-6 * c, thesis), AnalysisError);
}

// A zero covariance is the point mass: only a sample of copies of the mean is possible.
TEST(LikelihoodRatio, OfAZeroCovarianceAcceptsOnlyTheMean) {
  const Eigen::Vector2d mean(0.1, 3.0);
  Eigen::MatrixXd sample = mean.transpose().replicate(10, 1);
  const LikelihoodRatio same = likelihood_ratio_test(sample, mean, Eigen::Matrix2d::Zero());
  EXPECT_EQ(same.statistic, 0.0);
  EXPECT_EQ(same.rank, 0);
  EXPECT_EQ(same.dof, 0.0);
  EXPECT_EQ(same.p_value, 1.0);
  sample(4, 1) += 1e-6;
  const LikelihoodRatio other = likelihood_ratio_test(sample, mean, Eigen::Matrix2d::Zero());
  EXPECT_EQ(other.statistic, kInfinity);
  EXPECT_EQ(other.p_value, 0.0);
  EXPECT_NEAR(other.outside_rms, 1e-6 / std::sqrt(10.0), 1e-15);
}

// A sample on a line has no covariance of full rank: the likelihood at its maximum is unbounded.
TEST(LikelihoodRatio, OfACollapsedSampleIsInfiniteOrHuge) {
  Eigen::MatrixXd sample(20, 2);
  sample.col(0) = Eigen::VectorXd::LinSpaced(20, -1.0, 1.0);
  sample.col(1).setZero();
  const LikelihoodRatio flat =
      likelihood_ratio_test(sample, Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity());
  EXPECT_EQ(flat.statistic, kInfinity);
  EXPECT_EQ(flat.p_value, 0.0);
  const LikelihoodRatio far =
      likelihood_ratio_test(Eigen::MatrixXd::Constant(20, 1, 1e150), Eigen::VectorXd::Zero(1),
                            Eigen::MatrixXd::Constant(1, 1, 1e-300));
  EXPECT_EQ(far.p_value, 0.0);
}

TEST(LikelihoodRatio, RefusesFewerThanFiveDrawsForEachDimension) {
  Rng rng(29);
  const Normal full(rng, 3, 3);
  const Normal flat(rng, 3, 1);
  EXPECT_NO_THROW(likelihood_ratio_test(full.draw(rng, 15), full.mean, full.covariance()));
  EXPECT_NO_THROW(likelihood_ratio_test(flat.draw(rng, 5), flat.mean, flat.covariance()));
  try {
    likelihood_ratio_test(full.draw(rng, 14), full.mean, full.covariance());
    FAIL() << "14 draws of rank 3 were accepted";
  } catch (const AnalysisError& error) {
    EXPECT_EQ(error.code(), "E_TOO_FEW_SAMPLES");
    EXPECT_EQ(error.errc(), Errc::impossible);
  }
  EXPECT_THROW(likelihood_ratio_test(Eigen::MatrixXd(0, 2), Eigen::Vector2d::Zero(),
                                     Eigen::Matrix2d::Zero()),
               AnalysisError);
}

TEST(LikelihoodRatio, RefusesWhatIsNoSampleMeanOrCovariance) {
  Rng rng(30);
  const Eigen::MatrixXd sample = normal_matrix(rng, 20, 2);
  const Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  const Eigen::Matrix2d identity = Eigen::Matrix2d::Identity();
  EXPECT_THROW(likelihood_ratio_test(sample, Eigen::Vector3d::Zero(), identity), InvalidArgument);
  EXPECT_THROW(likelihood_ratio_test(sample, mean, Eigen::MatrixXd::Identity(2, 3)),
               InvalidArgument);
  EXPECT_THROW(
      likelihood_ratio_test(Eigen::MatrixXd(20, 0), Eigen::VectorXd(), Eigen::MatrixXd(0, 0)),
      InvalidArgument);
  for (const double bad : {kNaN, kInfinity, 1e200}) {
    Eigen::MatrixXd wrong = sample;
    wrong(3, 1) = bad;
    EXPECT_THROW(likelihood_ratio_test(wrong, mean, identity), InvalidArgument);
    EXPECT_THROW(likelihood_ratio_test(sample, Eigen::Vector2d(bad, 0.0), identity),
                 InvalidArgument);
  }
  Eigen::Matrix2d wrong = identity;
  wrong(0, 1) = kNaN;
  EXPECT_THROW(likelihood_ratio_test(sample, mean, wrong), InvalidArgument);
  wrong(0, 1) = 0.1;
  EXPECT_THROW(likelihood_ratio_test(sample, mean, wrong), InvalidArgument);
  wrong << 1.0, 2.0, 2.0, 1.0;
  EXPECT_THROW(likelihood_ratio_test(sample, mean, wrong), InvalidArgument);
  EXPECT_THROW(likelihood_ratio_test(sample, mean, -identity), InvalidArgument);
  for (const double epsilon : {-1.0, 1.0, kNaN}) {
    LikelihoodRatioOptions options;
    options.relative_epsilon = epsilon;
    EXPECT_THROW(likelihood_ratio_test(sample, mean, identity, options), InvalidArgument);
  }
  for (const double epsilon : {-1.0, kInfinity, kNaN}) {
    LikelihoodRatioOptions options;
    options.absolute_epsilon = epsilon;
    EXPECT_THROW(likelihood_ratio_test(sample, mean, identity, options), InvalidArgument);
  }
}

}  // namespace
}  // namespace dupin
