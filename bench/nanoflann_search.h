#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <nanoflann.hpp>

#include "dupin/mesh/mesh.h"

namespace dupin::bench {

/// The peer of NeighborSearch: nanoflann's kd-tree over points that it does not copy.
class NanoflannSearch {
 public:
  explicit NanoflannSearch(const Points& points)
      : adaptor_{points}, tree_(3, adaptor_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  /// Of at most `k` points nearest to `query`; returns how many there are.
  std::size_t nearest(const double* query, std::size_t k, std::int32_t* index,
                      double* squared) const {
    return tree_.knnSearch(query, k, index, squared);
  }

 private:
  struct Adaptor {
    const Points& points;
    std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.rows()); }
    double kdtree_get_pt(std::size_t i, std::size_t dim) const {
      return points(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(dim));
    }
    template <class Box>
    bool kdtree_get_bbox(Box& /*unused*/) const {
      return false;
    }
  };
  Adaptor adaptor_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Adaptor>, Adaptor, 3,
                                      std::int32_t>
      tree_;
};

}  // namespace dupin::bench
