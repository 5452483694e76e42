#include "dupin/warp/planar_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInside = 1e-12;  // of the box diagonal: outside by rounding is inside
constexpr double kCorner = 1e-9;   // a weight that near to 1 means the corner itself

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

Vector2d corner(const PlanarMesh& mesh, Index f, Index k) {
  return mesh.points.row(mesh.triangles(f, k)).transpose();
}

Vector3d snapped(Vector3d weights) {
  weights = weights.cwiseMax(0.0);
  Index largest = 0;
  weights.maxCoeff(&largest);
  if (weights[largest] >= 1.0 - kCorner) return Vector3d::Unit(largest);
  return weights / weights.sum();
}

// The barycentric weights, scaled by twice the area.
Vector3d scaled_weights(const PlanarMesh& mesh, Index f, const Vector2d& point) {
  const Vector2d a = corner(mesh, f, 0) - point;
  const Vector2d b = corner(mesh, f, 1) - point;
  const Vector2d c = corner(mesh, f, 2) - point;
  return {cross(b, c), cross(c, a), cross(a, b)};
}

double longest_edge(const PlanarMesh& mesh, Index f) {
  double longest = 0.0;
  for (Index k = 0; k < 3; ++k)
    longest = std::max(longest, (corner(mesh, f, k) - corner(mesh, f, (k + 1) % 3)).norm());
  return longest;
}

}  // namespace

PlanarGraph make_planar_graph(const PlanarMesh& mesh) {
  PlanarGraph graph;
  const Index num_vertices = mesh.points.rows();
  const Index num_faces = mesh.triangles.rows();
  graph.topology = compute_topology(mesh.triangles, num_vertices);
  graph.components = find_components(graph.topology.ring);
  graph.face_begin.assign(static_cast<std::size_t>(num_vertices) + 1, 0);
  for (Index i = 0; i < 3 * num_faces; ++i)
    ++graph.face_begin[static_cast<std::size_t>(mesh.triangles.data()[i]) + 1];
  for (std::size_t v = 1; v < graph.face_begin.size(); ++v)
    graph.face_begin[v] += graph.face_begin[v - 1];
  graph.face.resize(static_cast<std::size_t>(3 * num_faces));
  std::vector<std::int32_t> next(graph.face_begin.begin(), graph.face_begin.end() - 1);
  for (Index f = 0; f < num_faces; ++f) {
    for (Index k = 0; k < 3; ++k) {
      std::int32_t& slot = next[static_cast<std::size_t>(mesh.triangles(f, k))];
      graph.face[static_cast<std::size_t>(slot++)] = static_cast<std::int32_t>(f);
    }
  }
  graph.across.setConstant(num_faces, 3, -1);
  for (Index f = 0; f < num_faces; ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = mesh.triangles(f, (k + 1) % 3);
      const std::int32_t b = mesh.triangles(f, (k + 2) % 3);
      int found = 0;
      const auto first = static_cast<std::size_t>(graph.face_begin[static_cast<std::size_t>(a)]);
      const auto last = static_cast<std::size_t>(graph.face_begin[static_cast<std::size_t>(a) + 1]);
      for (std::size_t i = first; i < last; ++i) {
        const std::int32_t g = graph.face[i];
        if (g == f || (mesh.triangles.row(g).array() != b).all()) continue;
        graph.across(f, k) = g;
        ++found;
      }
      if (found > 1) graph.across(f, k) = -1;
    }
  }
  return graph;
}

double mean_edge_length(const Points2& points, const Adjacency& ring) {
  double sum = 0.0;
  Index count = 0;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k) {
      if (*k < v) continue;
      sum += (points.row(*k) - points.row(v)).norm();
      ++count;
    }
  }
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

double box_diagonal(const Points2& points) {
  if (points.rows() == 0) return 0.0;
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

std::optional<MeshPoint> locate(const PlanarMesh& mesh, const Vector2d& point) {
  const double tolerance = kInside * box_diagonal(mesh.points);
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const Vector3d scaled = scaled_weights(mesh, f, point);
    const double sum = scaled.sum();
    if (sum <= 0.0 || scaled.minCoeff() < -tolerance * longest_edge(mesh, f)) continue;
    return MeshPoint{static_cast<std::int32_t>(f), snapped(scaled / sum)};
  }
  return std::nullopt;
}

MeshPoint closest_mesh_point(const PlanarMesh& mesh, const Vector2d& point) {
  if (const auto inside = locate(mesh, point)) return *inside;
  MeshPoint best;
  double best_distance = std::numeric_limits<double>::infinity();
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    if (signed_area(mesh, f) <= 0.0) continue;
    for (Index k = 0; k < 3; ++k) {
      const Vector2d a = corner(mesh, f, k);
      const Vector2d edge = corner(mesh, f, (k + 1) % 3) - a;
      const double t = std::clamp(edge.dot(point - a) / edge.squaredNorm(), 0.0, 1.0);
      const double distance = (a + t * edge - point).squaredNorm();
      if (distance >= best_distance) continue;
      best_distance = distance;
      Vector3d weights = Vector3d::Zero();
      weights[k] = 1.0 - t;
      weights[(k + 1) % 3] = t;
      best = {static_cast<std::int32_t>(f), snapped(weights)};
    }
  }
  if (best.triangle < 0) throw InvalidArgument("no triangle of the mesh has an area");
  return best;
}

Vector2d position(const Points2& points, const Triangles& triangles, const MeshPoint& where) {
  Vector2d sum = Vector2d::Zero();
  for (Index k = 0; k < 3; ++k) {
    if (where.weights[k] != 0.0)
      sum += where.weights[k] * points.row(triangles(where.triangle, k)).transpose();
  }
  return sum;
}

}  // namespace dupin
