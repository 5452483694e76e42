#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <functional>
#include <vector>

#include "dupin/base/run_control.h"

namespace dupin::detail {

/// Which of N matches are consistent with each other, a bit each.
class ConsistencyGraph {
 public:
  /// `is_consistent(i, j)` is asked for i < j; may be called from many threads. Cost: O(N^2).
  ConsistencyGraph(Eigen::Index count,
                   const std::function<bool(Eigen::Index i, Eigen::Index j)>& is_consistent,
                   const RunControl& run);

  Eigen::Index size() const { return count_; }
  bool contains(Eigen::Index i, Eigen::Index j) const {
    return (row(i)[j / 64] >> (j % 64) & 1U) != 0;
  }
  /// Matches consistent with both.
  int common(Eigen::Index i, Eigen::Index j) const;
  /// For every match the sum of common() over its partners: large within a clique.
  Eigen::VectorXd support(const RunControl& run) const;
  /// `seed` and its partners by falling common(), at most `count`, ties by index.
  std::vector<std::int32_t> partners(Eigen::Index seed, Eigen::Index count) const;

 private:
  const std::uint64_t* row(Eigen::Index i) const { return bits_.data() + i * words_; }

  Eigen::Index count_ = 0;
  Eigen::Index words_ = 0;
  std::vector<std::uint64_t> bits_;
};

}  // namespace dupin::detail
