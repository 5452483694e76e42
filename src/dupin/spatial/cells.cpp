#include "dupin/spatial/cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"

namespace dupin::detail {

using Eigen::Index;
using std::int32_t;
using std::size_t;

struct Cells::Item {
  std::array<double, 3> at;
  int32_t index;
};

Cells::Cells(const Points& points, int32_t leaf_size, const char* what) {
  if (points.rows() > std::numeric_limits<int32_t>::max()) {
    throw InvalidArgument(std::string(what) + ": more than 2147483647 rows");
  }
  const auto count = static_cast<size_t>(points.rows());
  std::vector<Item> items(count);
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const double value = points(static_cast<Index>(i), static_cast<Index>(c));
      if (!std::isfinite(value) || std::abs(value) > 1e150) {
        throw InvalidArgument(std::string(what) + ": row " + std::to_string(i) +
                              " is not finite or beyond 1e150");
      }
      items[i].at[c] = value;
    }
    items[i].index = static_cast<int32_t>(i);
  }
  if (count > 0) split(items, 0, static_cast<int32_t>(count), leaf_size);
  x.resize(count);
  y.resize(count);
  z.resize(count);
  index.resize(count);
  for (size_t i = 0; i < count; ++i) {
    x[i] = items[i].at[0];
    y[i] = items[i].at[1];
    z[i] = items[i].at[2];
    index[i] = items[i].index;
  }
}

void Cells::split(std::vector<Item>& items, int32_t first, int32_t last, int32_t leaf_size) {
  const auto begin = items.begin() + first;
  const auto end = items.begin() + last;
  Node node{{begin->at, begin->at}, first, last, 0};
  for (auto item = begin; item != end; ++item) {
    for (size_t c = 0; c < 3; ++c) {
      node.box.low[c] = std::min(node.box.low[c], item->at[c]);
      node.box.high[c] = std::max(node.box.high[c], item->at[c]);
    }
  }
  const size_t self = nodes.size();
  nodes.push_back(node);
  if (last - first <= leaf_size || node.is_one_place()) {
    std::sort(begin, end, [](const Item& a, const Item& b) { return a.index < b.index; });
    return;
  }
  size_t axis = 0;
  for (size_t c = 1; c < 3; ++c) {
    if (node.box.high[c] - node.box.low[c] > node.box.high[axis] - node.box.low[axis]) axis = c;
  }
  const int32_t middle = first + (last - first) / 2;
  std::nth_element(begin, items.begin() + middle, end, [axis](const Item& a, const Item& b) {
    return a.at[axis] < b.at[axis] || (a.at[axis] == b.at[axis] && a.index < b.index);
  });
  split(items, first, middle, leaf_size);
  nodes[self].right = static_cast<int32_t>(nodes.size());
  split(items, middle, last, leaf_size);
}

std::vector<Cells::Node> Cells::batches(int32_t limit) const {
  std::vector<Node> result;
  if (nodes.empty()) return result;
  std::vector<int32_t> stack{0};
  while (!stack.empty()) {
    const int32_t self = stack.back();
    stack.pop_back();
    const Node& node = nodes[static_cast<size_t>(self)];
    if (node.size() > limit && !node.is_leaf()) {
      stack.push_back(node.right);
      stack.push_back(self + 1);
      continue;
    }
    int32_t first = node.first;
    for (; node.last - first > limit; first += limit) {
      result.push_back({node.box, first, first + limit, 0});
    }
    result.push_back({node.box, first, node.last, 0});
  }
  return result;
}

bool Cells::holds(const Points& points) const {
  if (points.rows() != static_cast<Index>(index.size())) return false;
  for (size_t i = 0; i < index.size(); ++i) {
    const Index v = index[i];
    if (points(v, 0) != x[i] || points(v, 1) != y[i] || points(v, 2) != z[i]) return false;
  }
  return true;
}

}  // namespace dupin::detail
