#include "dupin/render/color_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "dupin/base/error.h"

namespace dupin {
namespace {

// D65 white and the cube-root curve of CIELAB with its linear toe.
const Eigen::Vector3d kWhite(0.95047, 1.0, 1.08883);
constexpr double kToe = 6.0 / 29.0;

double lab_curve(double t) {
  return t > kToe * kToe * kToe ? std::cbrt(t) : t / (3.0 * kToe * kToe) + 4.0 / 29.0;
}

double lab_curve_inverse(double t) {
  return t > kToe ? t * t * t : 3.0 * kToe * kToe * (t - 4.0 / 29.0);
}

Rgb sequential_color(double t) {
  // Hue turns from violet to yellow at constant rate; the chroma follows the waist of the sRGB
  // gamut at teal and stays inside it, so that no channel is clamped and L is exactly linear.
  const double chroma = t < 0.35 ? 26.0 + 16.0 * (1.0 - t / 0.35) * (1.0 - t / 0.35)
                                 : 26.0 + 62.0 * std::pow((t - 0.35) / 0.65, 1.8);
  const double hue = (312.0 - 212.0 * t) * std::numbers::pi / 180.0;
  return srgb_from_lab({16.0 + 76.0 * t, chroma * std::cos(hue), chroma * std::sin(hue)});
}

// From the polar form of CIELAB: magnitude, saturation angle, hue (Moreland, "Diverging color maps
// for scientific visualization", ISVC 2009).
Eigen::Vector3d lab_from_msh(const Eigen::Vector3d& msh) {
  return msh.x() * Eigen::Vector3d(std::cos(msh.y()), std::sin(msh.y()) * std::cos(msh.z()),
                                   std::sin(msh.y()) * std::sin(msh.z()));
}

// Hue to which a saturated end is turned on its way to a brighter white of magnitude `white`, so
// that the path does not pass through a tint of another hue (Moreland, AdjustHue).
double white_hue(const Eigen::Vector3d& end, double white) {
  if (end.x() >= white) return end.z();
  const double spin =
      end.y() * std::sqrt(white * white - end.x() * end.x()) / (end.x() * std::sin(end.y()));
  return end.z() > -std::numbers::pi / 3.0 ? end.z() + spin : end.z() - spin;
}

Rgb diverging_color(double t) {
  // Ends of equal CIELAB magnitude and saturation angle make the two arms equally long and equally
  // light; the middle is lighter than Moreland's 88 so that flat places read as plain surface.
  constexpr double kWhiteMagnitude = 90.0;
  const bool is_low = t < 0.5;
  const double strength = std::abs(2.0 * t - 1.0);  // 1 at the ends
  const Eigen::Vector3d end(80.0, 1.08, is_low ? -1.1 : 0.5);
  const double hue = white_hue(end, kWhiteMagnitude);
  return srgb_from_lab(lab_from_msh({kWhiteMagnitude + strength * (end.x() - kWhiteMagnitude),
                                     strength * end.y(), hue + strength * (end.z() - hue)}));
}

double quantile(std::vector<double>& sorted_partly, double fraction) {
  const double place = fraction * static_cast<double>(sorted_partly.size() - 1);
  const auto index = static_cast<std::ptrdiff_t>(place);
  const auto nth = sorted_partly.begin() + index;
  std::nth_element(sorted_partly.begin(), nth, sorted_partly.end());
  const double low = *nth;
  if (nth + 1 == sorted_partly.end()) return low;
  const double high = *std::min_element(nth + 1, sorted_partly.end());
  return low + (place - static_cast<double>(index)) * (high - low);
}

void require_finite(const Eigen::VectorXd& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw InvalidArgument("value " + std::to_string(i) + " is not finite");
    }
  }
}

}  // namespace

double linear_from_srgb(double channel) {
  return channel <= 0.04045 ? channel / 12.92 : std::pow((channel + 0.055) / 1.055, 2.4);
}

double srgb_from_linear(double energy) {
  return energy <= 0.0031308 ? 12.92 * energy : 1.055 * std::pow(energy, 1.0 / 2.4) - 0.055;
}

Eigen::Vector3d linear_from_srgb(const Rgb& color) {
  return {linear_from_srgb(color.x()), linear_from_srgb(color.y()), linear_from_srgb(color.z())};
}

Rgb srgb_from_linear(const Eigen::Vector3d& energy) {
  return {srgb_from_linear(energy.x()), srgb_from_linear(energy.y()), srgb_from_linear(energy.z())};
}

Eigen::Vector3d lab_from_srgb(const Rgb& color) {
  const Eigen::Vector3d e = linear_from_srgb(color);
  const double x = 0.4124564 * e.x() + 0.3575761 * e.y() + 0.1804375 * e.z();
  const double y = 0.2126729 * e.x() + 0.7151522 * e.y() + 0.0721750 * e.z();
  const double z = 0.0193339 * e.x() + 0.1191920 * e.y() + 0.9503041 * e.z();
  const double fx = lab_curve(x / kWhite.x());
  const double fy = lab_curve(y / kWhite.y());
  const double fz = lab_curve(z / kWhite.z());
  return {116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)};
}

Rgb srgb_from_lab(const Eigen::Vector3d& lab) {
  const double fy = (lab.x() + 16.0) / 116.0;
  const double x = kWhite.x() * lab_curve_inverse(fy + lab.y() / 500.0);
  const double y = kWhite.y() * lab_curve_inverse(fy);
  const double z = kWhite.z() * lab_curve_inverse(fy - lab.z() / 200.0);
  const Eigen::Vector3d energy(3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                               -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                               0.0556434 * x - 0.2040259 * y + 1.0572252 * z);
  return srgb_from_linear(energy.cwiseMax(0.0).cwiseMin(1.0));
}

Rgb map_color(ColorMap map, double t) {
  const double clamped = std::clamp(t, 0.0, 1.0);
  return map == ColorMap::sequential ? sequential_color(clamped) : diverging_color(clamped);
}

double ColorScale::position(double value) const {
  if (!(range.high > range.low)) return 0.5;
  // Halved before subtracting: the range may span all of double.
  const double width = 0.5 * range.high - 0.5 * range.low;
  return std::clamp((0.5 * value - 0.5 * range.low) / width, 0.0, 1.0);
}

ValueRange robust_range(const Eigen::VectorXd& values, double lower, double upper) {
  if (!(lower >= 0.0 && lower < upper && upper <= 1.0)) {
    throw InvalidArgument("percentiles must satisfy 0 <= lower < upper <= 1");
  }
  require_finite(values);
  if (values.size() == 0) return {};
  std::vector<double> work(values.data(), values.data() + values.size());
  const double low = quantile(work, lower);
  return {low, quantile(work, upper)};
}

ValueRange symmetric_range(const Eigen::VectorXd& values, double upper) {
  if (!(upper > 0.0 && upper <= 1.0)) throw InvalidArgument("the percentile must be in (0, 1]");
  require_finite(values);
  if (values.size() == 0) return {-1.0, 1.0};
  std::vector<double> work(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    work[static_cast<std::size_t>(i)] = std::abs(values[i]);
  }
  double bound = quantile(work, upper);
  // A signal that is zero nearly everywhere: its extremes are all there is to see.
  if (bound == 0.0) bound = *std::max_element(work.begin(), work.end());
  if (bound == 0.0) bound = 1.0;
  return {-bound, bound};
}

}  // namespace dupin
