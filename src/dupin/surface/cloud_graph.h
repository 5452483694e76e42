#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/topology.h"

namespace dupin {

/// Options of build_cloud_graph().
struct CloudGraphOptions {
  int neighbors = 8;  ///< ring of a point: it and its so many nearest are joined both ways, >= 3;
                      ///< of points as far as the last, up to eight more
  int normal_neighbors = 16;  ///< points in the plane fit of a normal, >= 3; the same holds
};

/// What a bare point cloud needs to be treated like a mesh: rings, normals, and where it ends.
struct CloudGraph {
  Status status = Status::ok;
  Adjacency ring;  ///< symmetric k-nearest graph, #V
  Points normals;  ///< #V by 3 unit vectors, one orientation per component
  std::vector<std::uint8_t>
      is_boundary;  ///< #V: its neighbours leave a gap of more than 120 degrees around it
  Eigen::Index num_rescaled_normals = 0;     ///< given with a length that was off by more than 1 %
  Eigen::Index num_estimated_normals = 0;    ///< given as zero or not finite, and estimated instead
  Eigen::Index first_rescaled_normal = -1;   ///< the first of those points; -1: none
  Eigen::Index first_estimated_normal = -1;  ///< the first of those points; -1: none
};

/// Symmetric k-nearest graph of `cloud`; normals as given, made of unit length, or, where none or
/// none of a length is given, from a plane fit (smallest principal
/// axis of the neighbourhood, weighted mean as centre) with signs carried along a minimum spanning
/// tree of 1 - |n_i . n_j| (Hoppe et al., "Surface reconstruction from unorganized points",
/// SIGGRAPH 1992), started outward at the point of each component that is farthest along +z.
/// @throws InvalidArgument if an option is out of range (at most 1000 neighbours), a coordinate is
/// not finite, there are normals but not one for each point
/// @throws AnalysisError E_RANGE if a coordinate is beyond 1e150; E_TOO_FEW_POINTS if there are not
/// more than `neighbors` points Cost: O(V k log V).
CloudGraph build_cloud_graph(const PointCloud& cloud, const CloudGraphOptions& options = {},
                             RunControl run = {});

}  // namespace dupin
