#include "dupin/registration/consistency.h"

#include <algorithm>
#include <utility>

#include "dupin/base/parallel.h"

namespace dupin::detail {

using Eigen::Index;
using std::size_t;

ConsistencyGraph::ConsistencyGraph(Index count,
                                   const std::function<bool(Index i, Index j)>& is_consistent,
                                   const RunControl& run)
    : count_(count), words_((count + 63) / 64), bits_(static_cast<size_t>(count * words_), 0) {
  // Rows are written by one thread each, so every pair is asked about from both ends.
  parallel_for(0, count, 16, [&](Index first, Index last) {
    for (Index i = first; i < last && !run.cancelled(); ++i) {
      std::uint64_t* line = bits_.data() + i * words_;
      for (Index j = 0; j < count; ++j) {
        if (i != j && is_consistent(std::min(i, j), std::max(i, j)))
          line[j / 64] |= std::uint64_t{1} << (j % 64);
      }
    }
  });
}

int ConsistencyGraph::common(Index i, Index j) const {
  const std::uint64_t* a = row(i);
  const std::uint64_t* b = row(j);
  int count = 0;
  for (Index k = 0; k < words_; ++k) count += std::popcount(a[k] & b[k]);
  return count;
}

Eigen::VectorXd ConsistencyGraph::support(const RunControl& run) const {
  Eigen::VectorXd support = Eigen::VectorXd::Zero(count_);
  parallel_for(0, count_, 16, [&](Index first, Index last) {
    for (Index i = first; i < last && !run.cancelled(); ++i) {
      for (Index j = 0; j < count_; ++j) {
        if (contains(i, j)) support[i] += 1.0 + common(i, j);
      }
    }
  });
  return support;
}

std::vector<std::int32_t> ConsistencyGraph::partners(Index seed, Index count) const {
  std::vector<std::pair<int, std::int32_t>> found;
  for (Index j = 0; j < count_; ++j) {
    if (contains(seed, j)) found.emplace_back(-common(seed, j), static_cast<std::int32_t>(j));
  }
  std::sort(found.begin(), found.end());
  std::vector<std::int32_t> members{static_cast<std::int32_t>(seed)};
  for (const auto& [weight, j] : found) {
    if (static_cast<Index>(members.size()) >= count) break;
    members.push_back(j);
  }
  return members;
}

}  // namespace dupin::detail
