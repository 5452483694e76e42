#pragma once

// Private to this folder: the door through which Boost.Math is called.

#include <boost/math/policies/policy.hpp>
#include <cmath>
#include <exception>
#include <string>

#include "dupin/base/error.h"

namespace dupin::detail {

/// Without promotion to long double the results do not depend on what a platform means by it.
/// Errors are exceptions, which from_boost() turns into ours.
using BoostPolicy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

/// The value of `function`, which calls Boost.Math.
/// @throws Error E_RANGE if Boost throws or the value is not finite
template <class Function>
double from_boost(const char* what, const Function& function) {
  double value = 0.0;
  try {
    value = function();
  } catch (const std::exception&) {
    throw Error(Errc::numerical, "E_RANGE", std::string(what) + ": beyond a double");
  }
  if (!std::isfinite(value))
    throw Error(Errc::numerical, "E_RANGE", std::string(what) + ": beyond a double");
  return value;
}

/// @throws InvalidArgument unless low < value < high
inline void require_open(const char* name, double value, double low, double high) {
  // A comparison with a NaN is an invalid operation, which tests trap.
  if (!std::isfinite(value) || value <= low || value >= high) {
    throw InvalidArgument(std::string(name) + ": outside (" + std::to_string(low) + ", " +
                          std::to_string(high) + ")");
  }
}

}  // namespace dupin::detail
