#include "dupin/surface/cloud_graph.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <queue>
#include <string>
#include <tuple>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

// Points as far as the last of the k nearest are neighbours too, up to so many: which of them came
// first in the input must not matter. A square grid needs four.
constexpr int kMaxTied = 8;
constexpr double kTie = 1.0 + 1e-9;  // of squared distances

// Columns of row v of the table that hold its `wanted` nearest other points and those tied with the
// last. Without ties wanted + 1, for the point itself is there.
Index num_nearest(const NeighborTable& table, Index v, int wanted) {
  const Index last = std::min<Index>(wanted, table.index.cols() - 1);
  const double reach = kTie * table.squared(v, last);
  Index count = last + 1;
  while (count < table.index.cols() && table.squared(v, count) <= reach) ++count;
  return count;
}

// Union of "j is near i" and "i is near j", coincident points included; rows sorted, without
// repetition. Empty when cancelled.
Adjacency symmetric_graph(const NeighborTable& table, int neighbors, const RunControl& run) {
  const Index num_points = table.index.rows();
  // An int32 offset holds twice as many entries as are joined.
  if (2 * num_points * (neighbors + kMaxTied) > std::numeric_limits<int32_t>::max()) {
    throw Error(Errc::over_limit, "E_TOO_LARGE",
                std::to_string(num_points) + " points with " + std::to_string(neighbors) +
                    " neighbours each are too many",
                {}, "fewer neighbours: --neighbors K");
  }
  const auto for_each_pair = [&](auto&& action) {
    for (Index v = 0; v < num_points; ++v) {
      if (v % 4096 == 0 && run.cancelled()) return false;
      const Index nearest = num_nearest(table, v, neighbors);
      for (Index j = 0; j < nearest; ++j) {
        if (table.index(v, j) == v) continue;
        action(static_cast<size_t>(v), static_cast<size_t>(table.index(v, j)));
      }
    }
    return true;
  };
  std::vector<int32_t> first(static_cast<size_t>(num_points) + 1, 0);
  const auto count = [&](size_t v, size_t other) {
    ++first[v + 1];
    ++first[other + 1];
  };
  if (!for_each_pair(count)) return {};
  for (size_t v = 1; v < first.size(); ++v) first[v] += first[v - 1];
  std::vector<int32_t> entries(static_cast<size_t>(first.back()));
  std::vector<int32_t> cursor(first.begin(), first.end() - 1);
  const auto place = [&](size_t v, size_t other) {
    entries[static_cast<size_t>(cursor[v]++)] = static_cast<int32_t>(other);
    entries[static_cast<size_t>(cursor[other]++)] = static_cast<int32_t>(v);
  };
  if (!for_each_pair(place)) return {};
  // Each row is sorted and shortened in its place, then all are moved together.
  parallel_for(0, num_points, 4096, [&](Index begin, Index end) {
    if (run.cancelled()) return;
    for (Index v = begin; v < end; ++v) {
      const auto row = entries.begin() + first[static_cast<size_t>(v)];
      const auto row_end = entries.begin() + first[static_cast<size_t>(v) + 1];
      std::sort(row, row_end);
      cursor[static_cast<size_t>(v)] = static_cast<int32_t>(std::unique(row, row_end) - row);
    }
  });
  if (run.cancelled()) return {};
  Adjacency ring;
  ring.offset.assign(first.size(), 0);
  ring.neighbor.reserve(entries.size());
  for (size_t v = 0; v < cursor.size(); ++v) {
    const auto row = entries.begin() + first[v];
    ring.neighbor.insert(ring.neighbor.end(), row, row + cursor[v]);
    ring.offset[v + 1] = static_cast<int32_t>(ring.neighbor.size());
  }
  return ring;
}

// Unit vectors of the given normals; is_given is 0 where one is zero or not finite.
Points unit_normals(const Points& given, std::vector<std::uint8_t>& is_given, CloudGraph& graph) {
  Points normals = Points::Zero(given.rows(), 3);
  is_given.assign(static_cast<size_t>(given.rows()), 0);
  for (Index v = 0; v < given.rows(); ++v) {
    double largest = 0.0;
    bool is_finite = true;
    for (Index k = 0; k < 3; ++k) {
      is_finite = is_finite && std::isfinite(given(v, k));
      if (is_finite) largest = std::max(largest, std::abs(given(v, k)));
    }
    if (!is_finite || largest == 0.0) continue;
    // Divided first: the square of a long or short vector leaves the range of a double.
    const RowVector3d direction = given.row(v) / largest;
    const double length = direction.norm();
    normals.row(v) = direction / length;
    is_given[static_cast<size_t>(v)] = 1;
    const bool is_rescaled = largest > 2.0 || std::abs(largest * length - 1.0) > 0.01;
    if (is_rescaled && graph.num_rescaled_normals++ == 0) graph.first_rescaled_normal = v;
  }
  return normals;
}

Points plane_normals(const Points& points, const NeighborTable& table, int neighbors,
                     const RunControl& run) {
  Points normals = Points::Zero(points.rows(), 3);
  parallel_for(0, points.rows(), 1024, [&](Index first, Index last) {
    if (run.cancelled()) return;
    for (Index v = first; v < last; ++v) {
      const Index nearest = num_nearest(table, v, neighbors);
      RowVector3d mean = RowVector3d::Zero();
      for (Index j = 0; j < nearest; ++j) mean += points.row(table.index(v, j)) - points.row(v);
      mean /= static_cast<double>(nearest);
      Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
      for (Index j = 0; j < nearest; ++j) {
        const RowVector3d d = points.row(table.index(v, j)) - points.row(v) - mean;
        scatter += d.transpose() * d;
      }
      normals.row(v) = eigen_symmetric(scatter).vectors.col(0).transpose();
    }
  });
  return normals;
}

// Prim's algorithm over each component; the tie-break by index makes the tree unique. Normals that
// were given keep their sign, and the tree of a component starts at all of them.
void orient_along_tree(const Points& points, const Adjacency& ring,
                       const std::vector<std::uint8_t>& is_given, const RunControl& run,
                       Points& normals) {
  const Components components = find_components(ring);
  std::vector<int32_t> top(static_cast<size_t>(components.count), -1);
  for (Index v = 0; v < points.rows(); ++v) {
    int32_t& seed = top[static_cast<size_t>(components.label[static_cast<size_t>(v)])];
    if (seed < 0 || points(v, 2) > points(seed, 2)) seed = static_cast<int32_t>(v);
  }
  std::vector<std::uint8_t> done(static_cast<size_t>(points.rows()), 0);
  using Entry = std::tuple<double, int32_t, int32_t>;  // cost, vertex, parent
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  std::vector<std::uint8_t> has_given(top.size(), 0);
  for (size_t v = 0; v < is_given.size(); ++v) {
    if (is_given[v] == 0) continue;
    has_given[static_cast<size_t>(components.label[v])] = 1;
    queue.emplace(0.0, static_cast<int32_t>(v), static_cast<int32_t>(v));
  }
  std::int64_t steps = 0;
  for (size_t c = 0; c < top.size(); ++c) {
    const int32_t seed = top[c];
    if (has_given[c] == 0) {
      if (normals(seed, 2) < 0.0) normals.row(seed) *= -1.0;
      queue.emplace(0.0, seed, seed);
    }
    while (!queue.empty()) {
      if ((++steps & 0xFFF) == 0 && run.cancelled()) return;
      const auto [cost, v, parent] = queue.top();
      queue.pop();
      if (done[static_cast<size_t>(v)] != 0) continue;
      done[static_cast<size_t>(v)] = 1;
      const bool is_fixed = !is_given.empty() && is_given[static_cast<size_t>(v)] != 0;
      if (!is_fixed && normals.row(v).dot(normals.row(parent)) < 0.0) normals.row(v) *= -1.0;
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
  if (options.neighbors < 3 || options.normal_neighbors < 3 || options.neighbors > 1000 ||
      options.normal_neighbors > 1000) {
    throw InvalidArgument("neighbors is " + std::to_string(options.neighbors) +
                          " and normal_neighbors is " + std::to_string(options.normal_neighbors) +
                          ", legal range 3 to 1000 of both");
  }
  const Index num_points = cloud.points.rows();
  if (cloud.normals.rows() != 0 && cloud.normals.rows() != num_points) {
    throw InvalidArgument("there are " + std::to_string(cloud.normals.rows()) + " normals for " +
                          std::to_string(num_points) + " points");
  }
  if (num_points <= options.neighbors) {
    throw AnalysisError("E_TOO_FEW_POINTS",
                        std::to_string(num_points) + " points, more than " +
                            std::to_string(options.neighbors) + " are needed",
                        "more points; fewer neighbours (--neighbors) for keypoints or scalespace");
  }
  // Squared distances of larger coordinates overflow.
  for (Index i = 0; i < cloud.points.size(); ++i) {
    if (std::abs(cloud.points.data()[i]) > 1e150) {
      throw AnalysisError("E_RANGE", "a coordinate of the cloud is beyond 1e150",
                          "scale the points first, as the program does");
    }
  }
  CloudGraph graph;
  const int wanted = std::max(options.neighbors, options.normal_neighbors) + 1 + kMaxTied;
  const int k = static_cast<int>(std::min<Index>(wanted, num_points));
  const NeighborTable table = NeighborSearch(cloud.points).nearest(cloud.points, k, run);
  run.report(0.5);
  if (run.cancelled()) {
    graph.status = Status::cancelled;
    return graph;
  }
  graph.ring = symmetric_graph(table, options.neighbors, run);
  std::vector<std::uint8_t> is_given;
  if (cloud.normals.rows() == num_points)
    graph.normals = unit_normals(cloud.normals, is_given, graph);
  const auto num_given = std::count(is_given.begin(), is_given.end(), std::uint8_t{1});
  if (num_given < num_points && !run.cancelled()) {
    if (!is_given.empty()) {
      graph.num_estimated_normals = num_points - num_given;
      graph.first_estimated_normal =
          std::find(is_given.begin(), is_given.end(), std::uint8_t{0}) - is_given.begin();
    }
    const Points estimated = plane_normals(cloud.points, table, options.normal_neighbors, run);
    if (is_given.empty()) graph.normals = estimated;
    for (size_t v = 0; v < is_given.size(); ++v) {
      const auto row = static_cast<Index>(v);
      if (is_given[v] == 0) graph.normals.row(row) = estimated.row(row);
    }
    if (!run.cancelled()) orient_along_tree(cloud.points, graph.ring, is_given, run, graph.normals);
  }
  if (run.cancelled()) {
    graph.status = Status::cancelled;
    return graph;
  }
  run.report(0.9);
  graph.is_boundary.assign(static_cast<size_t>(num_points), 0);
  parallel_for(0, num_points, 4096, [&](Index first, Index last) {
    for (Index v = first; v < last && !run.cancelled(); ++v) {
      graph.is_boundary[static_cast<size_t>(v)] =
          leaves_a_gap(cloud.points, graph.ring, graph.normals.row(v), v) ? 1 : 0;
    }
  });
  if (run.cancelled()) graph.status = Status::cancelled;
  run.report(1.0);
  return graph;
}

}  // namespace dupin
