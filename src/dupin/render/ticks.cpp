#include "dupin/render/ticks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dupin/base/decimal.h"
#include "dupin/base/error.h"

namespace dupin {
namespace {

const char* const kMinus = "\u2212";

// 10^n rounded once: pow may be off by a unit in the last place.
double ten_to(int exponent) {
  const std::string text = "1e" + std::to_string(exponent);
  double value = 0.0;
  const char* at = text.data();
  parse_decimal(at, at + text.size(), value);
  return value;
}

std::string fixed(double value, int decimals) {
  const std::string digits = fixed_decimal(std::abs(value), decimals);
  const bool is_zero = digits.find_first_not_of("0.") == std::string::npos;
  return value < 0.0 && !is_zero ? kMinus + digits : digits;
}

std::string without_trailing_zeros(std::string digits) {
  if (digits.find('.') == std::string::npos) return digits;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return digits;
}

int exponent_of(double value) { return static_cast<int>(std::floor(std::log10(value))); }

}  // namespace

double round_down_125(double value) {
  const int exponent = exponent_of(value);
  // The logarithm may round up at a power of ten; one decade lower is tried last.
  for (const int e : {exponent + 1, exponent, exponent - 1}) {
    for (const double lead : {5.0, 2.0, 1.0}) {
      if (lead * ten_to(e) <= value) return lead * ten_to(e);
    }
  }
  return value;
}

std::string power_of_ten(int exponent) {
  static const std::array<const char*, 10> kDigits = {"⁰", "¹", "²", "³", "⁴",
                                                      "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = exponent < 0 ? "10⁻" : "10";
  for (const char digit : std::to_string(std::abs(exponent))) {
    text += kDigits[static_cast<std::size_t>(digit - '0')];
  }
  return text;
}

std::string format_number(double value, int digits) {
  if (value == 0.0) return "0";
  if (!std::isfinite(value)) return "?";
  int exponent = exponent_of(std::abs(value));
  if (exponent >= -4 && exponent < 6) {
    return without_trailing_zeros(fixed(value, std::clamp(digits - 1 - exponent, 0, 12)));
  }
  std::string lead =
      without_trailing_zeros(fixed(value / ten_to(exponent), std::max(0, digits - 1)));
  if (lead == "10") {
    lead = "1";
    ++exponent;
  }
  return lead + "×" + power_of_ten(exponent);
}

Ticks make_ticks(double low, double high, int target) {
  if (!std::isfinite(low) || !std::isfinite(high)) {
    throw InvalidArgument("the ends of an axis must be finite");
  }
  if (low > high || target < 1) {
    throw InvalidArgument("an axis needs low <= high and at least one tick");
  }
  Ticks ticks;
  const double width = high / 2.0 - low / 2.0;  // halves: the interval may span all of double
  const double largest = std::max(std::abs(low), std::abs(high));
  // Below the resolution of its ends an interval holds no distinct round numbers.
  if (!(width > largest * 1e-12)) {
    ticks.values = {low};
    ticks.labels = {format_number(low)};
    return ticks;
  }
  double step = round_down_125(2.0 * (width / target));
  const auto count = [&] { return std::floor(high / step) - std::ceil(low / step) + 1.0; };
  // The next rounder steps while there are clearly too many ticks.
  while (count() > target + 1.0) step = round_down_125(2.5 * step);
  const double first = std::ceil(low / step - 1e-9);
  const double last = std::floor(high / step + 1e-9);
  const int exponent = exponent_of(largest);
  const bool is_plain = exponent >= -2 && exponent < 5;
  const double unit = is_plain ? 1.0 : ten_to(exponent);
  if (!is_plain) ticks.factor = "×" + power_of_ten(exponent);
  const int decimals =
      std::clamp(-static_cast<int>(std::floor(std::log10(step / unit) + 1e-9)), 0, 12);
  for (double k = first; k <= last; k += 1.0) {
    ticks.values.push_back(std::clamp(k * step, low, high));
    ticks.labels.push_back(fixed(k * step / unit, decimals));
  }
  return ticks;
}

}  // namespace dupin
