#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "dupin/base/run_control.h"
#include "dupin/mesh/mesh.h"

namespace dupin {

/// Receives the neighbours of one query: indices into the points and squared distances [mu^2], as
/// rounded by dx dx + dy dy + dz dz. The set is exact for these; its order is unspecified, but a
/// function of points, queries and k (or radius) alone, so the same for any number of threads. The
/// spans end with the call.
using NeighborVisitor = std::function<void(Eigen::Index query, std::span<const std::int32_t> index,
                                           std::span<const double> squared)>;

/// Nearest neighbours of a set of points.
struct NeighborTable {
  using Indices = Eigen::Matrix<std::int32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Distances = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Indices index;      ///< #Q by k, nearest first; ties by smaller index
  Distances squared;  ///< #Q by k [mu^2]
};

/// Exact neighbours of many queries at once: queries that lie together share one list of
/// candidates. Safe to query from many threads.
///
/// Memory: 28 bytes a point and 8 to 16 for the cells, 32 more while they are sorted; the same for
/// the queries of a search, unless they are the points in the same order. See
/// docs/adr/0012-neighbour-search.md.
class NeighborSearch {
 public:
  /// Keeps its own sorted copy of `points` (#V by 3, #V = 0 allowed). Cost: O(V log V).
  /// @throws InvalidArgument if a coordinate is not finite or beyond 1e150 (its squared distances
  ///   would overflow)
  explicit NeighborSearch(const Points& points);
  ~NeighborSearch();
  NeighborSearch(NeighborSearch&&) noexcept;
  NeighborSearch& operator=(NeighborSearch&&) noexcept;

  /// Visits every query (#Q by 3) once, in an order of its own, with its k nearest points. A query
  /// that is one of the points finds itself. Of points equally far the smaller index wins.
  ///
  /// make_visitor is called once for each block of queries that a thread takes, so that a visitor
  /// may own a workspace; visitors of different blocks run at the same time. A cancelled run stops
  /// visiting; progress is left to the caller.
  ///
  /// Cost: O(Q (log V + k)) for clouds and queries of any density; more only for queries to which
  /// very many points are almost equally near. Distances below 1e-154 mu square to zero, so they
  /// count as ties, and many ties are slow.
  /// @throws InvalidArgument if k < 1 or k > #V, or for a query as for a point in the constructor
  void visit_nearest(const Points& queries, int k,
                     const std::function<NeighborVisitor()>& make_visitor,
                     const RunControl& run = {}) const;

  /// The same with all points whose squared distance is at most radius^2 [mu]; there may be none.
  ///
  /// Cost: O(Q log V + number of neighbours).
  /// @throws InvalidArgument if the radius is not finite or not > 0, or for a query as above
  void visit_within(const Points& queries, double radius,
                    const std::function<NeighborVisitor()>& make_visitor,
                    const RunControl& run = {}) const;

  /// The k points nearest to each query, sorted, in one table of 12 k bytes a query; everything
  /// else as visit_nearest(). Rows that a cancelled run did not reach hold -1 and infinity.
  NeighborTable nearest(const Points& queries, int k, const RunControl& run = {}) const;

  /// Number of points.
  Eigen::Index size() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dupin
