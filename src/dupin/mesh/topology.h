#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// Neighbours of every vertex in compressed rows: those of v are
/// neighbor[offset[v]] .. neighbor[offset[v + 1] - 1], ascending, without repetition, without v.
struct Adjacency {
  std::vector<std::int32_t> offset;    ///< #V + 1
  std::vector<std::int32_t> neighbor;  ///< sum of the valences

  Eigen::Index num_vertices() const {
    return offset.empty() ? 0 : static_cast<Eigen::Index>(offset.size()) - 1;
  }
  std::int32_t valence(Eigen::Index v) const {
    return offset[static_cast<std::size_t>(v) + 1] - offset[static_cast<std::size_t>(v)];
  }
  const std::int32_t* begin(Eigen::Index v) const {
    return neighbor.data() + offset[static_cast<std::size_t>(v)];
  }
  const std::int32_t* end(Eigen::Index v) const {
    return neighbor.data() + offset[static_cast<std::size_t>(v) + 1];
  }
};

/// What a triangle list says about its edges. A value: compute it once and pass it on.
struct MeshTopology {
  Adjacency ring;                          ///< 1-ring of every vertex, by edges
  std::vector<std::int32_t> edge_faces;    ///< aligned with ring.neighbor: faces on that edge
  std::vector<std::int32_t> vertex_faces;  ///< #V: triangles around each vertex
  std::vector<std::uint8_t> is_boundary;   ///< #V: on an edge with one face
  Eigen::Index num_edges = 0;
  Eigen::Index num_boundary_edges = 0;     ///< edges with one face
  Eigen::Index num_nonmanifold_edges = 0;  ///< edges with more than two faces
};

/// So many triangles can be indexed: each has six directed edges, counted in int32.
/// @throws Error(Errc::over_limit) E_TOO_LARGE above 357,913,941
void require_indexable(Eigen::Index num_faces);

/// Topology of `triangles` (#F by 3) over `num_vertices` vertices. Repeated indices in a triangle
/// make no edge. Cost: O(V + F log valence), any valence.
/// @throws InvalidArgument if an index is out of range; Error as require_indexable()
MeshTopology compute_topology(const Triangles& triangles, Eigen::Index num_vertices);

/// Component of every vertex over `ring`, numbered by smallest member from 0; isolated vertices are
/// components of their own. Cost: O(V + E).
struct Components {
  Eigen::Index count = 0;
  std::vector<std::int32_t> label;  ///< #V
};
Components find_components(const Adjacency& ring);

/// Mean length of the distinct edges [mu]; 0 when there is none. Cost: O(E).
double mean_edge_length(const Points& points, const Adjacency& ring);

}  // namespace dupin
