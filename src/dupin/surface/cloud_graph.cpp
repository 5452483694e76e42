#include "dupin/surface/cloud_graph.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <queue>
#include <string>
#include <tuple>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"
#include "dupin/spatial/nearest.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

// Union of "j is near i" and "i is near j", coincident points included; rows sorted, without
// repetition.
Adjacency symmetric_graph(const NeighborTable& table, int neighbors) {
  const Index num_points = table.index.rows();
  std::vector<std::vector<int32_t>> rows(static_cast<size_t>(num_points));
  for (Index v = 0; v < num_points; ++v) {
    int taken = 0;
    for (Index j = 0; j < table.index.cols() && taken < neighbors; ++j) {
      const int32_t other = table.index(v, j);
      if (other == v) continue;
      rows[static_cast<size_t>(v)].push_back(other);
      rows[static_cast<size_t>(other)].push_back(static_cast<int32_t>(v));
      ++taken;
    }
  }
  Adjacency ring;
  ring.offset.push_back(0);
  for (std::vector<int32_t>& row : rows) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    ring.neighbor.insert(ring.neighbor.end(), row.begin(), row.end());
    ring.offset.push_back(static_cast<int32_t>(ring.neighbor.size()));
    std::vector<int32_t>().swap(row);
  }
  return ring;
}

Points plane_normals(const Points& points, const NeighborTable& table, const RunControl& run) {
  Points normals(points.rows(), 3);
  parallel_for(0, points.rows(), 1024, [&](Index first, Index last) {
    if (run.cancelled()) return;
    for (Index v = first; v < last; ++v) {
      RowVector3d mean = RowVector3d::Zero();
      for (Index j = 0; j < table.index.cols(); ++j)
        mean += points.row(table.index(v, j)) - points.row(v);
      mean /= static_cast<double>(table.index.cols());
      Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
      for (Index j = 0; j < table.index.cols(); ++j) {
        const RowVector3d d = points.row(table.index(v, j)) - points.row(v) - mean;
        scatter += d.transpose() * d;
      }
      normals.row(v) = eigen_symmetric(scatter).vectors.col(0).transpose();
    }
  });
  return normals;
}

// Prim's algorithm over each component; the tie-break by index makes the tree unique.
void orient_along_tree(const Points& points, const Adjacency& ring, Points& normals) {
  const Components components = find_components(ring);
  std::vector<int32_t> top(static_cast<size_t>(components.count), -1);
  for (Index v = 0; v < points.rows(); ++v) {
    int32_t& seed = top[static_cast<size_t>(components.label[static_cast<size_t>(v)])];
    if (seed < 0 || points(v, 2) > points(seed, 2)) seed = static_cast<int32_t>(v);
  }
  std::vector<std::uint8_t> done(static_cast<size_t>(points.rows()), 0);
  using Entry = std::tuple<double, int32_t, int32_t>;  // cost, vertex, parent
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const int32_t seed : top) {
    if (normals(seed, 2) < 0.0) normals.row(seed) *= -1.0;
    queue.emplace(0.0, seed, seed);
    while (!queue.empty()) {
      const auto [cost, v, parent] = queue.top();
      queue.pop();
      if (done[static_cast<size_t>(v)] != 0) continue;
      done[static_cast<size_t>(v)] = 1;
      if (normals.row(v).dot(normals.row(parent)) < 0.0) normals.row(v) *= -1.0;
      for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        if (done[static_cast<size_t>(*j)] != 0) continue;
        queue.emplace(1.0 - std::abs(normals.row(v).dot(normals.row(*j))), *j, v);
      }
    }
  }
}

bool leaves_a_gap(const Points& points, const Adjacency& ring, const RowVector3d& normal, Index v) {
  RowVector3d u;
  RowVector3d w;
  tangent_basis(normal, u, w);
  std::vector<double> angles;
  for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
    const RowVector3d d = points.row(*j) - points.row(v);
    if (d.squaredNorm() > 0.0) angles.push_back(std::atan2(d.dot(w), d.dot(u)));
  }
  if (angles.size() < 3) return true;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
  return gap > 2.0 * std::numbers::pi / 3.0;
}

}  // namespace

CloudGraph build_cloud_graph(const PointCloud& cloud, const CloudGraphOptions& options,
                             RunControl run) {
  if (options.neighbors < 3 || options.normal_neighbors < 3) {
    throw InvalidArgument("neighbors is " + std::to_string(options.neighbors) +
                          " and normal_neighbors is " + std::to_string(options.normal_neighbors) +
                          ", both must be >= 3");
  }
  const Index num_points = cloud.points.rows();
  if (num_points <= options.neighbors) {
    throw AnalysisError("E_TOO_FEW_POINTS",
                        std::to_string(num_points) + " points, more than " +
                            std::to_string(options.neighbors) + " are needed",
                        "fewer neighbours: --neighbors K");
  }
  // Squared distances of larger coordinates overflow.
  for (Index i = 0; i < cloud.points.size(); ++i) {
    if (std::abs(cloud.points.data()[i]) > 1e150) {
      throw AnalysisError("E_RANGE", "a coordinate of the cloud is beyond 1e150",
                          "scale the points first, as the program does");
    }
  }
  CloudGraph graph;
  const int wanted = std::max(options.neighbors, options.normal_neighbors) + 1;
  const int k = static_cast<int>(std::min<Index>(wanted, num_points));
  const NeighborTable table = PointIndex(cloud.points).nearest(cloud.points, k, run);
  run.report(0.5);
  if (run.cancelled()) {
    graph.status = Status::cancelled;
    return graph;
  }
  graph.ring = symmetric_graph(table, options.neighbors);
  if (cloud.normals.rows() == num_points) {
    graph.normals = cloud.normals;
  } else {
    graph.normals = plane_normals(cloud.points, table, run);
    orient_along_tree(cloud.points, graph.ring, graph.normals);
  }
  run.report(0.9);
  graph.is_boundary.assign(static_cast<size_t>(num_points), 0);
  parallel_for(0, num_points, 4096, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      graph.is_boundary[static_cast<size_t>(v)] =
          leaves_a_gap(cloud.points, graph.ring, graph.normals.row(v), v) ? 1 : 0;
    }
  });
  if (run.cancelled()) graph.status = Status::cancelled;
  run.report(1.0);
  return graph;
}

}  // namespace dupin
