#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// The undirected edges of a triangle list and the half-edges on each. Half-edge 3 f + k runs from
/// corner k to corner k + 1 (mod 3) of triangle f.
struct EdgeTable {
  std::vector<std::int32_t> edge;       ///< 3 #F: edge of every half-edge
  std::vector<std::int32_t> offset;     ///< #E + 1: first half-edge of every edge in `half_edge`
  std::vector<std::int32_t> half_edge;  ///< 3 #F: grouped by edge, ascending in each

  Eigen::Index num_edges() const {
    return offset.empty() ? 0 : static_cast<Eigen::Index>(offset.size()) - 1;
  }
  std::int32_t num_faces(std::int32_t e) const {
    return offset[static_cast<std::size_t>(e) + 1] - offset[static_cast<std::size_t>(e)];
  }
  const std::int32_t* begin(std::int32_t e) const {
    return half_edge.data() + offset[static_cast<std::size_t>(e)];
  }
};

/// Edges by rising (lower, higher) end. The triangles must not repeat a vertex; indices in
/// [0, num_vertices). Cost: O(V + F log valence), any valence.
EdgeTable compute_edge_table(const Triangles& triangles, Eigen::Index num_vertices);

/// First and last vertex of half-edge `h`.
inline std::int32_t tail(const Triangles& triangles, std::int32_t h) {
  return triangles(h / 3, h % 3);
}
inline std::int32_t head(const Triangles& triangles, std::int32_t h) {
  return triangles(h / 3, (h % 3 + 1) % 3);
}

}  // namespace dupin
