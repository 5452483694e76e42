#pragma once

#include <cstdint>

namespace dupin {

/// Ridges are convex (k1 largest along its own direction), valleys concave (-k2 likewise).
enum class CrestKind { ridge, valley };

/// Where a crest line crosses an edge: at (1 - weight) a + weight b, a < b.
struct EdgeCrossing {
  std::int32_t a = 0;
  std::int32_t b = 0;
  double weight = 0.0;
  std::int32_t face = 0;   ///< one that the line runs across from here
  double sharpness = 0.0;  ///< -<grad e, t> of that face [1/mu^3]
};

}  // namespace dupin
