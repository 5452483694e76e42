#pragma once

#include <cstddef>
#include <vector>

#include "dupin/warp/exact_predicates.h"

namespace dupin {

/// For each loop the numbers of the others that have its first corner inside, ascending; where
/// loops do not meet, those are the loops around it. Exact. Cost: O(corners log corners + the
/// corners near the height of a first corner, of the loops whose boxes hold it).
std::vector<std::vector<std::size_t>> loops_around(
    const std::vector<std::vector<GridPoint>>& loops);

}  // namespace dupin
