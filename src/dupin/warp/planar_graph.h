#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "dupin/mesh/topology.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// What the triangle list of a planar mesh says about neighbours. It depends on the triangles
/// alone, so that it stays right when the vertices move.
struct PlanarGraph {
  MeshTopology topology;  ///< rings, faces on every edge
  Components components;  ///< isolated vertices are components of their own
  Triangles across;       ///< #F by 3: triangle over the edge opposite corner k, or -1
                          ///< at the border and where more than two meet
  std::vector<std::int32_t> face_begin;  ///< #V + 1
  std::vector<std::int32_t> face;        ///< triangles around v: face[face_begin[v]] .. ascending
};

/// @throws InvalidArgument if an index is out of range. Cost: O(V + F valence).
PlanarGraph make_planar_graph(const PlanarMesh& mesh);

/// Mean length of the distinct edges [px]; 0 when there is none. Cost: O(E).
double mean_edge_length(const Points2& points, const Adjacency& ring);

/// Length of the diagonal of the box around the points [px]; 0 for none.
double box_diagonal(const Points2& points);

/// A point of a mesh that moves with its triangle.
struct MeshPoint {
  std::int32_t triangle = -1;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric, >= 0, sum 1; a corner that
                                                      ///< is the point has exactly 1
};

/// Where `point` lies in `mesh`: the first triangle that holds it, to rounding of the box
/// diagonal; empty outside and in holes. Triangles without area hold nothing. Cost: O(F).
std::optional<MeshPoint> locate(const PlanarMesh& mesh, const Eigen::Vector2d& point);

/// The place of the mesh next to `point`, the point itself if it lies inside.
/// @throws InvalidArgument if no triangle has an area. Cost: O(F).
MeshPoint closest_mesh_point(const PlanarMesh& mesh, const Eigen::Vector2d& point);

/// Place of `where` when the corners of its triangle are at `points` (#V by 2).
Eigen::Vector2d position(const Points2& points, const Triangles& triangles, const MeshPoint& where);

}  // namespace dupin
