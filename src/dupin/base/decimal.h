#pragma once

#include <string>

namespace dupin {

/// Decimal text without the locale, also where the standard library has no floating-point
/// <charconv> (libc++ 14 of emscripten). The readers in io/ use std::from_chars itself.

/// Parses a number at the start of [at, end) and moves `at` behind it. False if there is none or it
/// is not finite.
bool parse_decimal(const char*& at, const char* end, double& value);

/// `value` with so many decimals, correctly rounded, "." as the point.
std::string fixed_decimal(double value, int decimals);

}  // namespace dupin
