#include "dupin/spatial/nearest.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"

namespace dupin {

using Eigen::Index;

struct PointIndex::Impl {
  struct Adaptor {
    Points points;
    std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.rows()); }
    double kdtree_get_pt(std::size_t i, std::size_t dim) const {
      return points(static_cast<Index>(i), static_cast<Index>(dim));
    }
    template <class Box>
    bool kdtree_get_bbox(Box& /*unused*/) const {
      return false;
    }
  };
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Adaptor>,
                                                   Adaptor, 3, std::int32_t>;
  Adaptor adaptor;
  std::unique_ptr<Tree> tree;
};

PointIndex::PointIndex(const Points& points) : impl_(std::make_unique<Impl>()) {
  for (Index v = 0; v < points.rows(); ++v) {
    for (Index c = 0; c < 3; ++c) {
      if (!std::isfinite(points(v, c))) {
        throw InvalidArgument("points: vertex " + std::to_string(v) + " is not finite");
      }
    }
  }
  impl_->adaptor.points = points;
  impl_->tree = std::make_unique<Impl::Tree>(3, impl_->adaptor,
                                             nanoflann::KDTreeSingleIndexAdaptorParams(16));
}

PointIndex::~PointIndex() = default;
PointIndex::PointIndex(PointIndex&&) noexcept = default;
PointIndex& PointIndex::operator=(PointIndex&&) noexcept = default;

NeighborTable PointIndex::nearest(const Points& queries, int k, const RunControl& run) const {
  const Index num_points = impl_->adaptor.points.rows();
  if (k < 1 || k > num_points) {
    throw InvalidArgument("k is " + std::to_string(k) + ", legal range 1 to " +
                          std::to_string(num_points));
  }
  NeighborTable table;
  table.index.resize(queries.rows(), k);
  table.squared.resize(queries.rows(), k);
  parallel_for(0, queries.rows(), 512, [&](Index first, Index last) {
    const auto count = static_cast<std::size_t>(k);
    std::vector<std::int32_t> index(count);
    std::vector<double> squared(count);
    std::vector<std::pair<double, std::int32_t>> order(count);
    for (Index q = first; q < last; ++q) {
      if (run.cancelled()) return;
      const double point[3] = {queries(q, 0), queries(q, 1), queries(q, 2)};
      impl_->tree->knnSearch(point, count, index.data(), squared.data());
      for (std::size_t j = 0; j < count; ++j) order[j] = {squared[j], index[j]};
      std::sort(order.begin(), order.end());
      for (std::size_t j = 0; j < count; ++j) {
        table.index(q, static_cast<Index>(j)) = order[j].second;
        table.squared(q, static_cast<Index>(j)) = order[j].first;
      }
    }
  });
  return table;
}

}  // namespace dupin
