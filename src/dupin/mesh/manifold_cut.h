#pragma once

#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// For every vertex the smallest vertex at exactly the same place (itself when alone). Coordinates
/// must be finite; -0 equals 0. Cost: O(V log V) whatever the coordinates.
std::vector<std::int32_t> find_coincident(const Points& points);

/// A triangle list with new vertices so that the faces around each form one disc or half-disc.
struct ManifoldCut {
  Triangles triangles;               ///< #F by 3 over the new vertices
  std::vector<std::int32_t> source;  ///< new vertex -> smallest of the given ones it stands for
  std::vector<std::int32_t> first;   ///< given vertex -> its first new vertex, or -1 (no face)
  std::vector<std::uint8_t> is_cut;  ///< new vertex: at a place where the surface was cut
  std::int64_t num_merged = 0;       ///< given vertices that went into another one
  std::int32_t first_merged = -1;
  std::int64_t num_bad_edges = 0;     ///< edges with more than two faces
  std::int32_t first_bad_face = -1;   ///< a face on the first of them
  std::int64_t num_bad_vertices = 0;  ///< several fans of faces, and not on a bad edge
  std::int32_t first_bad_vertex = -1;
  Eigen::Index num_edges = 0;     ///< after merging, before cutting
  Eigen::Index num_vertices = 0;  ///< with faces, after merging, before cutting
};

/// Merges and cuts. `place` names the place of each vertex (find_coincident(), or each itself for
/// no merging); triangles must have three different places each.
///
/// Merging goes by edges: where exactly two faces meet at an edge in space but not in the list,
/// their ends are merged. So a soup of triangles closes up, while sheets that only touch or cross
/// stay apart. Then an edge with more than two faces is cut, and the corners around each vertex
/// that remain connected across edges with exactly two faces share one new vertex. Applied to its
/// own result it changes nothing. New vertices are in the order of `source`, then of their first
/// corner. Cost: O(V + F log valence).
ManifoldCut cut_to_manifold(const Triangles& triangles, const std::vector<std::int32_t>& place);

}  // namespace dupin
