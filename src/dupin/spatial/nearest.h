#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "dupin/base/run_control.h"
#include "dupin/mesh/mesh.h"

namespace dupin {

/// Nearest neighbours of a set of points.
struct NeighborTable {
  using Indices = Eigen::Matrix<std::int32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Distances = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Indices index;      ///< #Q by k, nearest first; ties by smaller index
  Distances squared;  ///< #Q by k [mu^2]
};

/// Exact k-nearest search in a fixed set of points (nanoflann's kd-tree). Safe to query from many
/// threads.
class PointIndex {
 public:
  /// Keeps a copy of `points` (#V by 3). Cost: O(V log V). @throws InvalidArgument if a coordinate
  /// is not finite
  explicit PointIndex(const Points& points);
  ~PointIndex();
  PointIndex(PointIndex&&) noexcept;
  PointIndex& operator=(PointIndex&&) noexcept;

  /// The k points nearest to each query (#Q by 3). @throws InvalidArgument if k < 1 or k > #V
  NeighborTable nearest(const Points& queries, int k, const RunControl& run = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dupin
