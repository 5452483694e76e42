#pragma once

#include <string>
#include <vector>

namespace dupin {

/// Round numbers along an axis and how to write them.
struct Ticks {
  std::vector<double> values;       ///< ascending, inside the interval; steps of 1, 2 or 5 x 10^n
  std::vector<std::string> labels;  ///< one a value, UTF-8 with a true minus sign
  std::string factor;               ///< "" or what all labels are to be multiplied by: "×10⁻³"
};

/// About `target` ticks of [low, high]. An empty interval gets one tick.
/// @throws InvalidArgument if an end is not finite, low > high or target < 1
Ticks make_ticks(double low, double high, int target = 5);

/// Largest of 1, 2, 5 x 10^n that is <= value; value > 0 and finite.
double round_down_125(double value);

/// `value` with `digits` significant digits, without trailing zeros, with a true minus sign and,
/// outside [1e-4, 1e6), a superscript power of ten: "−1.5", "2×10⁻⁷".
std::string format_number(double value, int digits = 3);

/// "10⁻³": ten to `exponent` with superscript digits.
std::string power_of_ten(int exponent);

}  // namespace dupin
