#pragma once

#include <cstdint>
#include <vector>

#include "dupin/warp/exact_predicates.h"

namespace dupin {

/// A straight piece of an outline, the inside where orientation() is positive.
struct GridSegment {
  GridPoint from, to;
};

/// Points of a hexagonal lattice of spacing `spacing` that lie inside the outline, at least
/// `clearance` from every segment and `pin_clearance` from every pin [mesh steps]. Row by row, from
/// the smallest y. Cost: O(rows crossed by segments + points), not their product.
std::vector<GridPoint> hexagonal_lattice(const std::vector<GridSegment>& outline,
                                         const std::vector<GridPoint>& pins, double spacing,
                                         double clearance, double pin_clearance);

}  // namespace dupin
