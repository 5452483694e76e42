#pragma once

#include <cstdint>
#include <vector>

#include "dupin/warp/exact_predicates.h"

namespace dupin {

/// An order of insertion after Amenta, Choi and Rote (2003): rounds that double in size, drawn by a
/// fixed hash of the index, and along Hilbert's curve within each. Neighbours in it are near each
/// other, so that walks are short, and no arrangement of the input makes flips many.
std::vector<std::int32_t> spatial_order(const std::vector<GridPoint>& points, GridPoint low,
                                        GridPoint high);

}  // namespace dupin
