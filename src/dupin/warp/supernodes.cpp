#include "dupin/warp/supernodes.h"

#include <Eigen/OrderingMethods>
#include <algorithm>
#include <utility>

namespace dupin::detail {
namespace {

using Eigen::Index;
using Matrix = Eigen::SparseMatrix<double>;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// Of every row the columns left of the diagonal, for a matrix whose unknowns were given places.
struct RowLists {
  std::vector<std::int32_t> begin;
  std::vector<std::int32_t> column;
};

RowLists row_lists(const Matrix& lower, const Eigen::VectorXi& place) {
  RowLists rows;
  rows.begin.assign(at(lower.cols()) + 1, 0);
  const auto for_each = [&](const auto& take) {
    for (Index j = 0; j < lower.outerSize(); ++j) {
      for (Matrix::InnerIterator entry(lower, j); entry; ++entry) {
        if (entry.row() == j) continue;
        const std::int32_t a = place[entry.row()];
        const std::int32_t b = place[j];
        take(std::max(a, b), std::min(a, b));
      }
    }
  };
  for_each([&](std::int32_t row, std::int32_t) { ++rows.begin[at(row) + 1]; });
  for (std::size_t i = 1; i < rows.begin.size(); ++i) rows.begin[i] += rows.begin[i - 1];
  rows.column.resize(at(rows.begin.back()));
  std::vector<std::int32_t> next(rows.begin.begin(), rows.begin.end() - 1);
  for_each(
      [&](std::int32_t row, std::int32_t column) { rows.column[at(next[at(row)]++)] = column; });
  return rows;
}

// parent[j]: the first row below j in which column j of the factor has an entry; -1: none.
std::vector<std::int32_t> elimination_tree(const RowLists& rows) {
  const std::size_t size = rows.begin.size() - 1;
  std::vector<std::int32_t> parent(size, -1);
  std::vector<std::int32_t> ancestor(size, -1);
  for (std::int32_t i = 0; at(i) < size; ++i) {
    for (std::int32_t e = rows.begin[at(i)]; e < rows.begin[at(i) + 1]; ++e) {
      std::int32_t j = rows.column[at(e)];
      while (j != -1 && j != i) {
        const std::int32_t next = std::exchange(ancestor[at(j)], i);
        if (next == -1) parent[at(j)] = i;
        j = next;
      }
    }
  }
  return parent;
}

// New numbers by which every subtree is a range that ends at its root.
std::vector<std::int32_t> postorder(const std::vector<std::int32_t>& parent) {
  const auto size = static_cast<std::int32_t>(parent.size());
  std::vector<std::int32_t> first_child(parent.size(), -1);
  std::vector<std::int32_t> sibling(parent.size(), -1);
  for (std::int32_t j = size - 1; j >= 0; --j) {
    if (parent[at(j)] < 0) continue;
    sibling[at(j)] = first_child[at(parent[at(j)])];
    first_child[at(parent[at(j)])] = j;
  }
  std::vector<std::int32_t> number(parent.size());
  std::vector<std::int32_t> path;
  std::int32_t next = 0;
  for (std::int32_t root = 0; root < size; ++root) {
    if (parent[at(root)] >= 0) continue;
    path.push_back(root);
    while (!path.empty()) {
      const std::int32_t child = std::exchange(first_child[at(path.back())], -1);
      if (child >= 0) {
        for (std::int32_t c = child; c >= 0; c = sibling[at(c)]) path.push_back(c);
        continue;
      }
      number[at(path.back())] = next++;
      path.pop_back();
    }
  }
  return number;
}

// Entries below the diagonal of each column of the factor: row i has one in every column on the
// ways of the tree from the columns of row i up to i.
std::vector<std::int32_t> column_counts(const RowLists& rows,
                                        const std::vector<std::int32_t>& parent) {
  std::vector<std::int32_t> count(parent.size(), 0);
  std::vector<std::int32_t> seen(parent.size(), -1);
  for (std::int32_t i = 0; at(i) < parent.size(); ++i) {
    seen[at(i)] = i;
    for (std::int32_t e = rows.begin[at(i)]; e < rows.begin[at(i) + 1]; ++e) {
      for (std::int32_t j = rows.column[at(e)]; seen[at(j)] != i; j = parent[at(j)]) {
        seen[at(j)] = i;
        ++count[at(j)];
      }
    }
  }
  return count;
}

// Joining is worth some zeros: small blocks cost more than the zeros of larger ones.
bool is_worth_joining(std::int64_t num_columns, std::int64_t num_zeros, std::int64_t num_entries) {
  const auto share = static_cast<double>(num_zeros) / static_cast<double>(num_entries);
  if (num_columns <= 4) return share <= 0.3;
  if (num_columns <= 16) return share <= 0.15;
  return share <= 0.1;
}

// First columns of the supernodes.
std::vector<std::int32_t> group_columns(const std::vector<std::int32_t>& parent,
                                        const std::vector<std::int32_t>& count) {
  const auto size = static_cast<std::int32_t>(parent.size());
  std::vector<std::int32_t> first;
  for (std::int32_t j = 0; j < size; ++j) {
    if (j == 0 || parent[at(j - 1)] != j || count[at(j - 1)] != count[at(j)] + 1)
      first.push_back(j);
  }
  first.push_back(size);
  // From the end, since a supernode joins the one after it, which may have grown.
  std::vector<std::int32_t> joined{size};
  std::int64_t zeros = 0;
  for (std::size_t s = first.size() - 1; s-- > 0;) {
    const std::int32_t begin = first[s];
    const std::int32_t end = first[s + 1];
    const std::int64_t own = end - begin;
    if (end < size && parent[at(end - 1)] >= 0 && parent[at(end - 1)] < joined[joined.size() - 2]) {
      const std::int32_t group_end = joined[joined.size() - 2];
      const std::int64_t group = group_end - end;
      const std::int64_t below = count[at(group_end - 1)];
      const std::int64_t columns = own + group;
      const std::int64_t more = zeros + own * (group + below - count[at(end - 1)]);
      if (is_worth_joining(columns, more, columns * (columns + 1) / 2 + columns * below)) {
        joined.back() = begin;
        zeros = more;
        continue;
      }
    }
    joined.push_back(begin);
    zeros = 0;
  }
  std::reverse(joined.begin(), joined.end());
  return joined;
}

void find_rows(const RowLists& rows, const std::vector<std::int32_t>& parent, Supernodes& nodes) {
  const auto num_nodes = static_cast<std::int32_t>(nodes.first.size()) - 1;
  std::vector<std::int32_t> node_of(parent.size());
  for (std::int32_t s = 0; s < num_nodes; ++s) {
    for (std::int32_t j = nodes.first[at(s)]; j < nodes.first[at(s) + 1]; ++j) node_of[at(j)] = s;
  }
  nodes.parent.assign(at(num_nodes), -1);
  std::vector<std::vector<std::int32_t>> below(at(num_nodes));
  for (std::int32_t s = 0; s < num_nodes; ++s) {
    const std::int32_t up = parent[at(nodes.first[at(s) + 1] - 1)];
    if (up >= 0) nodes.parent[at(s)] = node_of[at(up)];
  }
  // Rows rise, so that each list is in order and the last one tells whether a row is there already.
  // Row i is below the supernode of every column on the ways from its columns up to i.
  std::vector<std::int32_t> seen(at(num_nodes), -1);
  for (std::int32_t i = 0; at(i) < parent.size(); ++i) {
    const std::int32_t home = node_of[at(i)];
    seen[at(home)] = i;
    for (std::int32_t e = rows.begin[at(i)]; e < rows.begin[at(i) + 1]; ++e) {
      for (std::int32_t s = node_of[at(rows.column[at(e)])]; seen[at(s)] != i;
           s = nodes.parent[at(s)]) {
        seen[at(s)] = i;
        below[at(s)].push_back(i);
      }
    }
  }
  nodes.row_begin.assign(1, 0);
  for (const auto& list : below) {
    nodes.row.insert(nodes.row.end(), list.begin(), list.end());
    nodes.row_begin.push_back(static_cast<std::int32_t>(nodes.row.size()));
  }
}

}  // namespace

Supernodes find_supernodes(const Matrix& lower) {
  const Index size = lower.cols();
  Supernodes nodes;
  if (size == 0) {
    nodes.first.assign(1, 0);
    nodes.row_begin.assign(1, 0);
    return nodes;
  }
  Eigen::PermutationMatrix<Eigen::Dynamic> unknown_at;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), unknown_at);
  nodes.place = unknown_at.inverse().eval().indices();
  const std::vector<std::int32_t> number =
      postorder(elimination_tree(row_lists(lower, nodes.place)));
  for (Index i = 0; i < size; ++i) nodes.place[i] = number[at(nodes.place[i])];
  const RowLists rows = row_lists(lower, nodes.place);
  const std::vector<std::int32_t> parent = elimination_tree(rows);
  nodes.first = group_columns(parent, column_counts(rows, parent));
  find_rows(rows, parent, nodes);
  return nodes;
}

}  // namespace dupin::detail
