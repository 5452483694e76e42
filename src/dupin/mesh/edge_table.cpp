#include "dupin/mesh/edge_table.h"

#include <algorithm>
#include <utility>

#include "dupin/mesh/topology.h"

namespace dupin {

EdgeTable compute_edge_table(const Triangles& triangles, Eigen::Index num_vertices) {
  using std::int32_t;
  using std::size_t;
  require_indexable(triangles.rows());
  const auto num_half_edges = static_cast<int32_t>(3 * triangles.rows());
  // Bucketed by lower end, then sorted by higher end inside the bucket.
  std::vector<int32_t> bucket(static_cast<size_t>(num_vertices) + 1, 0);
  for (int32_t h = 0; h < num_half_edges; ++h) {
    ++bucket[static_cast<size_t>(std::min(tail(triangles, h), head(triangles, h))) + 1];
  }
  for (size_t v = 1; v < bucket.size(); ++v) bucket[v] += bucket[v - 1];
  std::vector<std::pair<int32_t, int32_t>> member(static_cast<size_t>(num_half_edges));
  std::vector<int32_t> cursor(bucket.begin(), bucket.end() - 1);
  for (int32_t h = 0; h < num_half_edges; ++h) {
    const auto [low, high] = std::minmax({tail(triangles, h), head(triangles, h)});
    member[static_cast<size_t>(cursor[static_cast<size_t>(low)]++)] = {high, h};
  }
  EdgeTable table;
  table.edge.resize(static_cast<size_t>(num_half_edges));
  table.half_edge.reserve(static_cast<size_t>(num_half_edges));
  table.offset.reserve(static_cast<size_t>(num_half_edges) / 2 + 2);
  for (size_t v = 0; v + 1 < bucket.size(); ++v) {
    const auto first = member.begin() + bucket[v];
    const auto last = member.begin() + bucket[v + 1];
    std::sort(first, last);
    for (auto it = first; it != last; ++it) {
      if (it == first || it->first != (it - 1)->first) {
        table.offset.push_back(static_cast<int32_t>(table.half_edge.size()));
      }
      table.edge[static_cast<size_t>(it->second)] = static_cast<int32_t>(table.offset.size()) - 1;
      table.half_edge.push_back(it->second);
    }
  }
  table.offset.push_back(num_half_edges);
  return table;
}

}  // namespace dupin
