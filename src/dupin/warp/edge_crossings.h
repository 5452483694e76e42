#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "dupin/warp/hexagonal_lattice.h"

namespace dupin {

/// Pairs (smaller first, sorted) of segments that share a point, exact. Neighbours in a loop, for
/// which next[i] is the segment after i, share their corner; they count only if they overlap.
/// Cost: O(n) cells for segments of similar length, by buckets of their mean extent.
std::vector<std::pair<std::int32_t, std::int32_t>> find_edge_crossings(
    const std::vector<GridSegment>& segments, const std::vector<std::int32_t>& next);

}  // namespace dupin
