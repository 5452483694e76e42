#include "dupin/mesh/subdivision.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/mesh/topology.h"

namespace dupin {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

void require_subdivisible(const Mesh& mesh, int times) {
  if (times < 0 || times > 12) {
    throw InvalidArgument("times: " + std::to_string(times) + " is outside 0 to 12");
  }
  validate(mesh);
  const double factor = std::pow(4.0, times);
  if (factor * static_cast<double>(mesh.triangles.rows()) >
      static_cast<double>(std::numeric_limits<int32_t>::max())) {
    throw InvalidArgument("times: more than 2147483647 triangles");
  }
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const int32_t a = mesh.triangles(f, 0);
    const int32_t b = mesh.triangles(f, 1);
    const int32_t c = mesh.triangles(f, 2);
    if (a == b || b == c || c == a) {
      throw InvalidArgument("triangles: face " + std::to_string(f) + " repeats a vertex");
    }
  }
}

// Numbers the edges of a topology by rising (lower, higher) end.
class EdgeNumbers {
 public:
  explicit EdgeNumbers(const MeshTopology& topology) : ring_(topology.ring) {
    first_.resize(static_cast<size_t>(ring_.num_vertices()));
    int32_t next = 0;
    for (Index v = 0; v < ring_.num_vertices(); ++v) {
      first_[static_cast<size_t>(v)] = next;
      next += static_cast<int32_t>(ring_.end(v) - upper(v));
    }
  }

  int32_t of(int32_t a, int32_t b) const {
    if (a > b) std::swap(a, b);
    const int32_t* slot = std::lower_bound(upper(a), ring_.end(a), b);
    return first_[static_cast<size_t>(a)] + static_cast<int32_t>(slot - upper(a));
  }

 private:
  const int32_t* upper(Index v) const {
    return std::upper_bound(ring_.begin(v), ring_.end(v), static_cast<int32_t>(v));
  }

  const Adjacency& ring_;
  std::vector<int32_t> first_;
};

Triangles quartered(const Triangles& triangles, int32_t num_vertices, const EdgeNumbers& edges) {
  Triangles result(4 * triangles.rows(), 3);
  for (Index f = 0; f < triangles.rows(); ++f) {
    const int32_t a = triangles(f, 0);
    const int32_t b = triangles(f, 1);
    const int32_t c = triangles(f, 2);
    const int32_t ab = num_vertices + edges.of(a, b);
    const int32_t bc = num_vertices + edges.of(b, c);
    const int32_t ca = num_vertices + edges.of(c, a);
    result.middleRows(4 * f, 4) << a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca;
  }
  return result;
}

double loop_beta(int32_t valence) {
  const double n = valence;
  const double c = 0.375 + 0.25 * std::cos(2.0 * std::numbers::pi / n);
  return (0.625 - c * c) / n;
}

void require_manifold(const MeshTopology& topology) {
  if (topology.num_nonmanifold_edges > 0) {
    throw InvalidArgument("mesh: an edge has more than two faces");
  }
}

// Sum of the neighbours that a vertex rule looks at, and how many there are: all of the ring
// inside, the two along the boundary on it.
struct Neighbors {
  Eigen::RowVector3d sum{0.0, 0.0, 0.0};
  int32_t count = 0;
};

Neighbors rule_neighbors(const Points& points, const MeshTopology& topology, Index v) {
  Neighbors result;
  const bool on_boundary = topology.is_boundary[static_cast<size_t>(v)] != 0;
  for (const int32_t* j = topology.ring.begin(v); j != topology.ring.end(v); ++j) {
    const auto slot = static_cast<size_t>(j - topology.ring.neighbor.data());
    if (on_boundary && topology.edge_faces[slot] != 1) continue;
    result.sum += points.row(*j);
    ++result.count;
  }
  if (on_boundary && result.count != 2) {
    throw InvalidArgument("mesh: vertex " + std::to_string(v) + " is on " +
                          std::to_string(result.count) + " boundary edges");
  }
  return result;
}

Mesh loop_once(const Mesh& mesh) {
  const auto num_vertices = static_cast<int32_t>(mesh.points.rows());
  const MeshTopology topology = compute_topology(mesh.triangles, num_vertices);
  require_manifold(topology);
  const EdgeNumbers edges(topology);
  Mesh result;
  result.points.resize(num_vertices + topology.num_edges, 3);
  for (Index v = 0; v < num_vertices; ++v) {
    const Neighbors near = rule_neighbors(mesh.points, topology, v);
    const bool on_boundary = topology.is_boundary[static_cast<size_t>(v)] != 0;
    const double beta = near.count == 0 ? 0.0 : on_boundary ? 0.125 : loop_beta(near.count);
    result.points.row(v) = (1.0 - near.count * beta) * mesh.points.row(v) + beta * near.sum;
  }
  // Far corners are gathered per edge; edges come in the order of EdgeNumbers.
  Points far_sum = Points::Zero(topology.num_edges, 3);
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const int32_t edge = edges.of(mesh.triangles(f, k), mesh.triangles(f, (k + 1) % 3));
      far_sum.row(edge) += mesh.points.row(mesh.triangles(f, (k + 2) % 3));
    }
  }
  Index edge = 0;
  for (int32_t v = 0; v < num_vertices; ++v) {
    for (const int32_t* j = topology.ring.begin(v); j != topology.ring.end(v); ++j) {
      if (*j < v) continue;
      const auto slot = static_cast<size_t>(j - topology.ring.neighbor.data());
      const Eigen::RowVector3d ends = mesh.points.row(v) + mesh.points.row(*j);
      if (topology.edge_faces[slot] == 2) {
        result.points.row(num_vertices + edge) = 0.375 * ends + 0.125 * far_sum.row(edge);
      } else {
        result.points.row(num_vertices + edge) = 0.5 * ends;
      }
      ++edge;
    }
  }
  result.triangles = quartered(mesh.triangles, num_vertices, edges);
  return result;
}

Mesh midpoint_once(const Mesh& mesh) {
  const auto num_vertices = static_cast<int32_t>(mesh.points.rows());
  const MeshTopology topology = compute_topology(mesh.triangles, num_vertices);
  Mesh result;
  result.points.resize(num_vertices + topology.num_edges, 3);
  result.points.topRows(num_vertices) = mesh.points;
  Index next = num_vertices;
  for (int32_t v = 0; v < num_vertices; ++v) {
    for (const int32_t* j = topology.ring.begin(v); j != topology.ring.end(v); ++j) {
      if (*j > v) result.points.row(next++) = 0.5 * mesh.points.row(v) + 0.5 * mesh.points.row(*j);
    }
  }
  result.triangles = quartered(mesh.triangles, num_vertices, EdgeNumbers(topology));
  return result;
}

}  // namespace

Mesh midpoint_subdivide(const Mesh& mesh, int times) {
  require_subdivisible(mesh, times);
  Mesh result = mesh;
  for (int i = 0; i < times; ++i) result = midpoint_once(result);
  return result;
}

Mesh loop_subdivide(const Mesh& mesh, int times) {
  require_subdivisible(mesh, times);
  Mesh result = mesh;
  for (int i = 0; i < times; ++i) result = loop_once(result);
  return result;
}

Points loop_limit_points(const Mesh& mesh) {
  require_subdivisible(mesh, 0);
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  require_manifold(topology);
  Points limit = mesh.points;
  for (Index v = 0; v < limit.rows(); ++v) {
    const Neighbors near = rule_neighbors(mesh.points, topology, v);
    if (near.count == 0) continue;
    const bool on_boundary = topology.is_boundary[static_cast<size_t>(v)] != 0;
    const double omega = on_boundary ? 0.25 : 8.0 / 3.0 * loop_beta(near.count);
    limit.row(v) = (mesh.points.row(v) + omega * near.sum) / (1.0 + near.count * omega);
  }
  return limit;
}

}  // namespace dupin
