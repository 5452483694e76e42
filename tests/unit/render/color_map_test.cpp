#include "dupin/render/color_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/render/scene.h"

namespace dupin {
namespace {

double lightness(ColorMap map, double t) { return lab_from_srgb(map_color(map, t)).x(); }

// The map is built in CIELAB with L = 16 + 76 t and stays inside sRGB, so nothing is clamped and L
// comes back to rounding.
TEST(ColorMap, SequentialLightnessIsLinear) {
  for (int i = 0; i <= 200; ++i) {
    const double t = i / 200.0;
    EXPECT_NEAR(lightness(ColorMap::sequential, t), 16.0 + 76.0 * t, 1e-3) << t;
  }
}

// Colour difference of CIE 1994: L, chroma and hue, the last two weighed down where chroma is high.
double difference(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double ca = std::hypot(a.y(), a.z());
  const double cb = std::hypot(b.y(), b.z());
  const double hue = std::sqrt(std::max(
      0.0, std::pow(a.y() - b.y(), 2) + std::pow(a.z() - b.z(), 2) - (ca - cb) * (ca - cb)));
  return std::hypot(a.x() - b.x(), (ca - cb) / (1.0 + 0.045 * ca), hue / (1.0 + 0.015 * ca));
}

// Equal steps of t are comparable steps to the eye: no band, no flat part. Of a step of 1/200, the
// lightness alone makes 0.38; hue and chroma may at most double and a bit what is left.
TEST(ColorMap, SequentialStepsAreEvenToTheEye) {
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d a = lab_from_srgb(map_color(ColorMap::sequential, i / 200.0));
    const Eigen::Vector3d b = lab_from_srgb(map_color(ColorMap::sequential, (i + 1) / 200.0));
    EXPECT_GT(difference(a, b), 0.379) << i;
    EXPECT_LT(difference(a, b), 0.90) << i;
  }
}

// The arms mirror each other in Msh magnitude and angle, hence in L, up to what clamping to sRGB
// takes from the blue arm (below 1.5 of 100).
TEST(ColorMap, DivergingIsSymmetricInLightnessAndPeaksInTheMiddle) {
  const double middle = lightness(ColorMap::diverging, 0.5);
  EXPECT_NEAR(middle, 90.0, 0.01);
  double previous = middle;
  for (int i = 1; i <= 100; ++i) {
    const double low = lightness(ColorMap::diverging, 0.5 - 0.005 * i);
    const double high = lightness(ColorMap::diverging, 0.5 + 0.005 * i);
    EXPECT_NEAR(low, high, 1.5) << i;
    EXPECT_LT(high, previous) << i;
    previous = high;
  }
  const Eigen::Vector3d neutral = lab_from_srgb(map_color(ColorMap::diverging, 0.5));
  EXPECT_LT(std::hypot(neutral.y(), neutral.z()), 0.1);
  EXPECT_GT(map_color(ColorMap::diverging, 0.0).z(), map_color(ColorMap::diverging, 0.0).x());
  EXPECT_GT(map_color(ColorMap::diverging, 1.0).x(), map_color(ColorMap::diverging, 1.0).z());
}

TEST(ColorMap, LabAndSrgbAreInverse) {
  for (const Rgb& color :
       {Rgb(0, 0, 0), Rgb(1, 1, 1), Rgb(0.2, 0.5, 0.9), Rgb(0.01, 0.002, 0.03)}) {
    EXPECT_LT((srgb_from_lab(lab_from_srgb(color)) - color).norm(), 1e-5);
  }
}

TEST(ColorScale, ClampsOutsideTheRangeAndTakesTheMiddleOfAnEmptyOne) {
  const ColorScale scale{ColorMap::sequential, {-2.0, 6.0}};
  EXPECT_EQ(scale.position(-5.0), 0.0);
  EXPECT_EQ(scale.position(0.0), 0.25);
  EXPECT_EQ(scale.position(9.0), 1.0);
  EXPECT_EQ((ColorScale{ColorMap::sequential, {3.0, 3.0}}.position(3.0)), 0.5);
  const double huge = std::numeric_limits<double>::max();
  EXPECT_EQ((ColorScale{ColorMap::sequential, {-huge, huge}}.position(0.0)), 0.5);
}

// Order statistics of 0..100 are the numbers themselves.
TEST(Range, PercentilesAreOrderStatistics) {
  Eigen::VectorXd values(101);
  for (int i = 0; i <= 100; ++i) values[i] = (37 * i) % 101;
  const ValueRange range = robust_range(values, 0.02, 0.985);
  EXPECT_DOUBLE_EQ(range.low, 2.0);
  EXPECT_DOUBLE_EQ(range.high, 98.5);
  values[5] = -1e9;
  EXPECT_DOUBLE_EQ(symmetric_range(values, 0.5).high, -symmetric_range(values, 0.5).low);
  EXPECT_LT(symmetric_range(values, 0.9).high, 101.0);
}

TEST(Range, ASpikeInZerosIsStillSeen) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(1000);
  EXPECT_EQ(symmetric_range(values).high, 1.0);
  values[3] = -4.0;
  EXPECT_EQ(symmetric_range(values).high, 4.0);
}

TEST(Range, RefusesNaN) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(3);
  values[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(robust_range(values), InvalidArgument);
  EXPECT_THROW(symmetric_range(values), InvalidArgument);
}

// Places without a value are told from all values: the grey is 15 units of CIELAB away from every
// colour of both maps, six times what is just seen side by side.
TEST(ColorMap, HasNoColorNearTheGreyOfNoValue) {
  const Eigen::Vector3d grey = lab_from_srgb(kNoValueColor);
  for (const ColorMap map : {ColorMap::sequential, ColorMap::diverging}) {
    for (int i = 0; i <= 1000; ++i) {
      EXPECT_GT((lab_from_srgb(map_color(map, i / 1000.0)) - grey).norm(), 15.0) << i;
    }
  }
}

}  // namespace
}  // namespace dupin
