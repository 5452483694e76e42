#pragma once

#include <cstdint>
#include <vector>

#include "dupin/mesh/edge_table.h"
#include "dupin/mesh/mesh.h"

namespace dupin {

/// Which triangles to turn so that neighbours agree.
struct Orientation {
  std::vector<std::uint8_t> flip;  ///< #F: turn this triangle
  std::int32_t conflict = -1;      ///< a triangle that closes a one-sided loop; -1: orientable
};

/// One orientation for each edge-connected component, by flood fill over the edges with exactly two
/// faces: that of the triangles with the larger sum of `votes` (#F, >= 0); on a tie that of the
/// component's first triangle. A consistent component is never turned. Cost: O(F).
Orientation orient_components(const Triangles& triangles, const EdgeTable& edges,
                              const std::vector<std::uint8_t>& votes);

}  // namespace dupin
