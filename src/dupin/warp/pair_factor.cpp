#include "dupin/warp/pair_factor.h"

#include <algorithm>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/warp/front_kernels.h"
#include "dupin/warp/supernodes.h"

namespace dupin {
namespace {

using detail::Supernodes;
using Eigen::Index;

constexpr std::int32_t kMostColumns = 16;  // of a block
constexpr std::int32_t kPanel = detail::kPanelRows;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// The matrix in the order of the factor: for each column the entries on and below the diagonal.
struct OrderedMatrix {
  std::vector<std::int32_t> begin;
  std::vector<std::int32_t> row;
  std::vector<double> value;
};

OrderedMatrix ordered(const Eigen::SparseMatrix<double>& lower, const Eigen::VectorXi& place) {
  OrderedMatrix result;
  result.begin.assign(at(lower.cols()) + 1, 0);
  const auto for_each = [&](const auto& take) {
    for (Index j = 0; j < lower.outerSize(); ++j) {
      for (Eigen::SparseMatrix<double>::InnerIterator entry(lower, j); entry; ++entry) {
        const std::int32_t a = place[entry.row()];
        const std::int32_t b = place[j];
        take(std::min(a, b), std::max(a, b), entry.value());
      }
    }
  };
  for_each([&](std::int32_t column, std::int32_t, double) { ++result.begin[at(column) + 1]; });
  for (std::size_t j = 1; j < result.begin.size(); ++j) result.begin[j] += result.begin[j - 1];
  result.row.resize(at(result.begin.back()));
  result.value.resize(at(result.begin.back()));
  std::vector<std::int32_t> next(result.begin.begin(), result.begin.end() - 1);
  for_each([&](std::int32_t column, std::int32_t row, double value) {
    const std::size_t slot = at(next[at(column)]++);
    result.row[slot] = row;
    result.value[slot] = value;
  });
  return result;
}

[[noreturn]] void fail_not_definite() {
  throw Error(Errc::numerical, "E_NOT_CONVERGED",
              "the system of the deformation is not positive definite", {},
              "look for triangles without area");
}

}  // namespace

// A supernode while it is eliminated: its columns and then its rows, as a dense lower triangle.
struct PairFactor::Front {
  std::int32_t first = 0;
  std::int32_t num_columns = 0;
  std::int32_t num_rows = 0;
  const std::int32_t* row = nullptr;
  std::vector<double> value;     // (columns + rows)^2, column-major
  std::vector<double> diagonal;  // of D

  std::int32_t size() const { return num_columns + num_rows; }
};

// Copies the eliminated columns into blocks.
void PairFactor::keep_columns(const Front& front) {
  const std::int32_t size = front.size();
  for (std::int32_t c0 = 0; c0 < front.num_columns; c0 += kMostColumns) {
    const std::int32_t width = std::min(kMostColumns, front.num_columns - c0);
    const std::int32_t top = c0 + width;
    Block block;
    block.first = front.first + c0;
    block.num_columns = width;
    block.num_rows = size - top;
    block.row_begin = static_cast<std::int32_t>(row_.size());
    block.value_begin = static_cast<std::int64_t>(value_.size());
    for (std::int32_t c = c0; c < top; ++c) {
      const double* column = front.value.data() + std::int64_t{c} * size;
      value_.insert(value_.end(), column + c + 1, column + top);
    }
    for (std::int32_t r = top; r < front.num_columns; ++r) row_.push_back(front.first + r);
    row_.insert(row_.end(), front.row, front.row + front.num_rows);
    for (std::int32_t r = top; r < size; r += kPanel) {
      for (std::int32_t c = c0; c < top; ++c) {
        const double* column = front.value.data() + std::int64_t{c} * size;
        for (std::int32_t i = r; i < r + kPanel; ++i) value_.push_back(i < size ? column[i] : 0.0);
      }
    }
    num_entries_ += std::int64_t{width} * (width - 1) / 2 + std::int64_t{width} * block.num_rows;
    most_rows_ = std::max(most_rows_, block.num_rows);
    blocks_.push_back(block);
  }
  for (std::int32_t c = 0; c < front.num_columns; ++c)
    inverse_diagonal_.push_back(1.0 / front.diagonal[at(c)]);
}

PairFactor::PairFactor(const Eigen::SparseMatrix<double>& lower, const RunControl& run)
    : size_(lower.cols()) {
  if (size_ == 0) return;
  run.throw_if_cancelled();
  const Supernodes nodes = detail::find_supernodes(lower);
  run.throw_if_cancelled();
  place_ = nodes.place;
  const OrderedMatrix matrix = ordered(lower, place_);
  std::vector<std::vector<std::int32_t>> children(at(nodes.count()));
  for (std::int32_t s = 0; s < nodes.count(); ++s) {
    if (nodes.parent[at(s)] >= 0) children[at(nodes.parent[at(s)])].push_back(s);
  }
  // What a supernode takes from the rows below it, until its parent has added it up.
  std::vector<std::vector<double>> update(at(nodes.count()));
  std::vector<std::int32_t> local(at(size_));  // row to its place in the front
  std::vector<std::int32_t> way;
  Front front;
  inverse_diagonal_.reserve(at(size_));
  for (std::int32_t s = 0; s < nodes.count(); ++s) {
    run.throw_if_cancelled();
    front.first = nodes.first[at(s)];
    front.num_columns = nodes.num_columns(s);
    front.num_rows = nodes.num_rows(s);
    front.row = nodes.row.data() + nodes.row_begin[at(s)];
    const std::int32_t size = front.size();
    front.value.assign(at(std::int64_t{size} * size), 0.0);
    front.diagonal.resize(at(front.num_columns));
    for (std::int32_t c = 0; c < front.num_columns; ++c) local[at(front.first + c)] = c;
    for (std::int32_t r = 0; r < front.num_rows; ++r)
      local[at(front.row[r])] = front.num_columns + r;
    for (std::int32_t c = 0; c < front.num_columns; ++c) {
      double* column = front.value.data() + std::int64_t{c} * size;
      const std::int32_t j = front.first + c;
      for (std::int32_t e = matrix.begin[at(j)]; e < matrix.begin[at(j) + 1]; ++e)
        column[local[at(matrix.row[at(e)])]] += matrix.value[at(e)];
    }
    for (const std::int32_t child : children[at(s)]) {
      std::vector<double>& part = update[at(child)];
      const std::int32_t* row = nodes.row.data() + nodes.row_begin[at(child)];
      const std::int32_t num_rows = nodes.num_rows(child);
      way.resize(at(num_rows));
      for (std::int32_t r = 0; r < num_rows; ++r) way[at(r)] = local[at(row[r])];
      for (std::int32_t c = 0; c < num_rows; ++c) {
        double* column = front.value.data() + std::int64_t{way[at(c)]} * size;
        const double* from = part.data() + std::int64_t{c} * num_rows;
        for (std::int32_t r = c; r < num_rows; ++r) column[way[at(r)]] += from[r];
      }
      part = std::vector<double>();
    }
    if (!detail::eliminate(front.value.data(), size, front.num_columns, front.diagonal.data()))
      fail_not_definite();
    keep_columns(front);
    if (nodes.parent[at(s)] < 0) continue;
    std::vector<double>& rest = update[at(s)];
    rest.resize(at(std::int64_t{front.num_rows} * front.num_rows));
    for (std::int32_t c = 0; c < front.num_rows; ++c) {
      const double* from = front.value.data() + std::int64_t{front.num_columns + c} * size;
      std::copy(from + front.num_columns + c, from + size,
                rest.data() + std::int64_t{c} * front.num_rows + c);
    }
  }
}

void PairFactor::solve(double* pairs) const {
  std::vector<double> gathered(2 * at((most_rows_ + kPanel - 1) / kPanel * kPanel));
  for (const Block& block : blocks_) {
    detail::solve_forward({block.first, block.num_columns, block.num_rows,
                           row_.data() + block.row_begin, value_.data() + block.value_begin},
                          pairs);
  }
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    detail::solve_backward({block->first, block->num_columns, block->num_rows,
                            row_.data() + block->row_begin, value_.data() + block->value_begin},
                           inverse_diagonal_.data(), gathered.data(), pairs);
  }
}

}  // namespace dupin
