#include "dupin/scalespace/level_schedule.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"

namespace dupin {
namespace {

// Thesis section 5.1.2 and Fig. 5.2, 5.3: with erratum E-20 (omega in [0, 2]) the fit gives t_5
// = 2.974, t_10 = 7.470, t_15 = 13.678, t_20 = 21.699, t_35 = 57.006.
TEST(LevelScales, ReproduceTheScalesOfTheThesis) {
  const Eigen::VectorXd t = level_scales({.num_levels = 36}, ScaleMeasure::thesis);
  EXPECT_EQ(t[0], 0.0);
  EXPECT_NEAR(t[5], 2.974, 5e-4);
  EXPECT_NEAR(t[10], 7.470, 1e-3);  // 7.4695 with 4096 midpoints
  EXPECT_NEAR(t[15], 13.678, 5e-4);
  EXPECT_NEAR(t[20], 21.699, 5e-4);
  EXPECT_NEAR(t[35], 57.006, 5e-4);
}

// tau_l = (delta^l - 1) / (delta - 1) for lambda0 = 1: 186.69 at level 20; and l lambda0 when delta
// = 1.
TEST(LevelScales, ExactScaleIsTheSumOfTheSteps) {
  const Eigen::VectorXd tau = level_scales({}, ScaleMeasure::exact);
  EXPECT_NEAR(tau[20], (std::pow(1.2, 20) - 1.0) / 0.2, 1e-9);
  EXPECT_NEAR(tau[20], 186.69, 5e-3);
  const Eigen::VectorXd even =
      level_scales({.num_levels = 10, .lambda0 = 0.5, .delta = 1.0}, ScaleMeasure::exact);
  EXPECT_NEAR(even[9], 4.5, 1e-12);
}

// Erratum E-23: Eq. 5.25 halved gives 5.12, 21.3, 61.5, 161.6 at levels 5, 10, 15, 20.
TEST(LevelScales, VarianceScaleIsThatOfErratum23) {
  const Eigen::VectorXd t = level_scales({}, ScaleMeasure::variance);
  EXPECT_EQ(t[1], 0.0);
  EXPECT_NEAR(t[5], 5.12, 0.02);
  EXPECT_NEAR(t[10], 21.3, 0.1);
  EXPECT_NEAR(t[15], 61.5, 0.2);
  EXPECT_NEAR(t[20], 161.6, 0.5);
}

// Errata table of E-20: omega in [0, sqrt 2] gives 33.7 at level 20.
TEST(LevelScales, SpectralRangeGivesALargerScale) {
  EXPECT_NEAR(level_scales({}, ScaleMeasure::spectral)[20], 33.7, 0.05);
}

// Fig. 5.6: four times the vertices shift the curves by d levels with 4 tau_l =
// tau_{l+d}: 5.6, 6.5, 6.9, 7.3, 7.5 at l = 5, 8, 10, 15, 20 (E-25); the thesis says "approximately
// 7".
TEST(LevelScales, FourTimesTheVerticesShiftByAboutSevenLevels) {
  const auto shift = [](int l) {
    const double tau = (std::pow(1.2, l) - 1.0) / 0.2;
    return std::log(4.0 * tau * 0.2 + 1.0) / std::log(1.2) - l;
  };
  const Eigen::VectorXd tau = level_scales({}, ScaleMeasure::exact);
  const int levels[] = {5, 8, 10, 15, 20};
  const double expected[] = {5.6, 6.5, 6.9, 7.3, 7.5};
  for (int i = 0; i < 5; ++i) {
    const double d = shift(levels[i]);
    EXPECT_NEAR(d, expected[i], 0.06);
    const auto below = static_cast<Eigen::Index>(std::floor(levels[i] + d));
    EXPECT_LE(tau[below], 4.0 * tau[levels[i]] * (1.0 + 1e-12));
    EXPECT_GE(tau[below + 1], 4.0 * tau[levels[i]]);
  }
}

TEST(LevelSchedule, RefusesWhatHasNoStack) {
  EXPECT_THROW(validate(LevelSchedule{.num_levels = 1}), InvalidArgument);
  EXPECT_THROW(validate(LevelSchedule{.lambda0 = 0.0}), InvalidArgument);
  EXPECT_THROW(validate(LevelSchedule{.lambda0 = std::nan("")}), InvalidArgument);
  EXPECT_THROW(validate(LevelSchedule{.delta = 0.9}), InvalidArgument);
  EXPECT_THROW(validate(LevelSchedule{.num_levels = 1000, .delta = 2.0}), InvalidArgument);
  EXPECT_NO_THROW(validate(LevelSchedule{}));
}

}  // namespace
}  // namespace dupin
