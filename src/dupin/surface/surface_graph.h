#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/topology.h"
#include "dupin/surface/cloud_graph.h"

namespace dupin {

/// What the scale space needs of a surface, whether it came as a mesh or as bare points.
struct SurfaceGraph {
  Status status = Status::ok;
  Points points;           ///< #V by 3 [mu]
  Points normals;          ///< #V by 3 unit vectors (zero where unknown)
  Triangles triangles;     ///< #F by 3; empty for a cloud
  MeshTopology topology;   ///< ring of a mesh or neighbour graph of a cloud; faces only for a mesh
  double mean_edge = 0.0;  ///< mean length of the edges of the ring [mu]
  std::vector<std::uint8_t> is_guarded;      ///< #V: no keypoint here (boundary, split)
  Eigen::Index num_rescaled_normals = 0;     ///< of a cloud, see CloudGraph
  Eigen::Index num_estimated_normals = 0;    ///< of a cloud, see CloudGraph
  Eigen::Index first_rescaled_normal = -1;   ///< of a cloud, see CloudGraph
  Eigen::Index first_estimated_normal = -1;  ///< of a cloud, see CloudGraph

  bool is_mesh() const { return triangles.rows() > 0; }
};

/// Graph of a triangle mesh. `is_guarded` (#V or empty) is added to the boundary.
/// @throws InvalidArgument as validate(mesh), or if is_guarded has another size; AnalysisError
/// E_RANGE if a coordinate is beyond 1e150 or the whole surface smaller than 1e-150: squares would
/// leave the range of a double. heal() makes every surface fit. Cost: O(V + F).
SurfaceGraph surface_graph(const Mesh& mesh, const std::vector<std::uint8_t>& is_guarded = {});

/// Graph of a point cloud, see build_cloud_graph(); E_RANGE as of a mesh.
SurfaceGraph surface_graph(const PointCloud& cloud, const CloudGraphOptions& options = {},
                           RunControl run = {});

/// Scalar signals that the library can compute on a surface.
enum class Signal {
  height,  ///< umbrella height with smoothed normals: the default (surface/height_signal.h)
  mean,    ///< H of Taubin's tensor: the thesis
  gauss,   ///< K
  k1,      ///< larger principal curvature
  k2       ///< smaller principal curvature
};

/// The signal at every vertex (#V): [1/mu], K in [1/mu^2]; sign as in surface/curvature.h.
/// @throws AnalysisError E_NO_FACES if anything but `height` is asked of a cloud
Eigen::VectorXd compute_signal(const SurfaceGraph& graph, Signal signal, int normal_smoothing = 6,
                               RunControl run = {});

}  // namespace dupin
