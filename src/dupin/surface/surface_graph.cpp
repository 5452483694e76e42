#include "dupin/surface/surface_graph.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/surface/curvature.h"
#include "dupin/surface/height_signal.h"

namespace dupin {
namespace {

// Squares of larger coordinates overflow and those of a smaller surface vanish.
void require_safe_squares(const Points& points) {
  constexpr double kLargest = 1e150;
  double size = 0.0;
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    if (std::abs(points.data()[i]) > kLargest)
      throw AnalysisError("E_RANGE", "a coordinate is beyond 1e150", "scale the points first");
    size = std::max(size, std::abs(points.data()[i] - points.data()[i % 3]));
  }
  if (size > 0.0 && size < 1.0 / kLargest)
    throw AnalysisError("E_RANGE", "the surface is smaller than 1e-150", "scale the points first");
}

}  // namespace

SurfaceGraph surface_graph(const Mesh& mesh, const std::vector<std::uint8_t>& is_guarded) {
  validate(mesh);
  if (!is_guarded.empty() && is_guarded.size() != static_cast<std::size_t>(mesh.points.rows())) {
    throw InvalidArgument("is_guarded has " + std::to_string(is_guarded.size()) +
                          " entries, the mesh has " + std::to_string(mesh.points.rows()) +
                          " vertices");
  }
  require_safe_squares(mesh.points);
  SurfaceGraph graph;
  graph.points = mesh.points;
  graph.triangles = mesh.triangles;
  graph.normals = vertex_normals(mesh);
  graph.topology = compute_topology(mesh.triangles, mesh.points.rows());
  graph.mean_edge = mean_edge_length(mesh.points, graph.topology.ring);
  graph.is_guarded = graph.topology.is_boundary;
  for (std::size_t v = 0; v < is_guarded.size(); ++v) {
    if (is_guarded[v] != 0) graph.is_guarded[v] = 1;
  }
  // Beside an edge with three faces or more the ring is no disc.
  const Adjacency& ring = graph.topology.ring;
  for (std::size_t k = 0; graph.topology.num_nonmanifold_edges > 0 && k < ring.neighbor.size();
       ++k) {
    if (graph.topology.edge_faces[k] > 2)
      graph.is_guarded[static_cast<std::size_t>(ring.neighbor[k])] = 1;
  }
  return graph;
}

SurfaceGraph surface_graph(const PointCloud& cloud, const CloudGraphOptions& options,
                           RunControl run) {
  require_safe_squares(cloud.points);
  CloudGraph built = build_cloud_graph(cloud, options, run);
  SurfaceGraph graph;
  graph.status = built.status;
  graph.points = cloud.points;
  graph.triangles.resize(0, 3);
  graph.normals = std::move(built.normals);
  graph.topology.ring = std::move(built.ring);
  if (graph.status != Status::cancelled)
    graph.mean_edge = mean_edge_length(cloud.points, graph.topology.ring);
  graph.is_guarded = std::move(built.is_boundary);
  graph.num_rescaled_normals = built.num_rescaled_normals;
  graph.num_estimated_normals = built.num_estimated_normals;
  graph.first_rescaled_normal = built.first_rescaled_normal;
  graph.first_estimated_normal = built.first_estimated_normal;
  return graph;
}

Eigen::VectorXd compute_signal(const SurfaceGraph& graph, Signal signal, int normal_smoothing,
                               RunControl run) {
  if (signal == Signal::height) {
    return height_signal(graph.points, graph.normals, graph.topology.ring, {normal_smoothing});
  }
  if (!graph.is_mesh()) {
    throw AnalysisError("E_NO_FACES", "Taubin's curvature needs faces, this is a point cloud",
                        "the signal 'height' works on points");
  }
  const CurvatureField field =
      estimate_curvature_taubin({graph.points, graph.triangles}, graph.topology, run);
  switch (signal) {
    case Signal::gauss:
      return field.gauss();
    case Signal::k1:
      return field.k1;
    case Signal::k2:
      return field.k2;
    default:
      return field.mean();
  }
}

}  // namespace dupin
