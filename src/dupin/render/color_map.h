#pragma once

#include <Eigen/Core>

namespace dupin {

/// A colour as people write it: sRGB red, green, blue, each in [0, 1].
using Rgb = Eigen::Vector3d;

/// One channel of sRGB to light energy and back (IEC 61966-2-1). Blending, filtering and shading
/// are right only on energies.
double linear_from_srgb(double channel);
double srgb_from_linear(double energy);
Eigen::Vector3d linear_from_srgb(const Rgb& color);
Rgb srgb_from_linear(const Eigen::Vector3d& energy);

/// CIELAB (L in [0, 100], a, b) under D65 of an sRGB colour, and back. Out of gamut: clamped.
Eigen::Vector3d lab_from_srgb(const Rgb& color);
Rgb srgb_from_lab(const Eigen::Vector3d& lab);

enum class ColorMap {
  sequential,  ///< dark violet to yellow; CIELAB lightness rises linearly from 16 to 92
  diverging    ///< blue, near white, red; both arms fall in lightness alike (Moreland 2009)
};

/// Colour of t in [0, 1] (clamped). diverging: 0.5 is the neutral middle.
Rgb map_color(ColorMap map, double t);

/// A closed interval of values.
struct ValueRange {
  double low = 0.0;
  double high = 1.0;
};

/// How values become colours: `low` and what is below get the first colour of the map.
struct ColorScale {
  ColorMap map = ColorMap::sequential;
  ValueRange range;

  /// Position of `value` in the map, in [0, 1]; 0.5 when the range is empty.
  double position(double value) const;
  Rgb color(double value) const { return map_color(map, position(value)); }
};

/// Range that leaves out the fractions `lower` and 1 - `upper` of the values at its ends, so that
/// a few outliers do not wash out a picture. Linear interpolation between order statistics.
/// @throws InvalidArgument if a value is not finite or not 0 <= lower < upper <= 1
/// Cost: O(V). No values: [0, 1].
ValueRange robust_range(const Eigen::VectorXd& values, double lower = 0.02, double upper = 0.98);

/// [-m, m] with m the `upper` percentile of |values|: a range for diverging maps. All zero: [-1,
/// 1].
/// @throws InvalidArgument as robust_range()
ValueRange symmetric_range(const Eigen::VectorXd& values, double upper = 0.98);

}  // namespace dupin
