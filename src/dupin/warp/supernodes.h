#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

namespace dupin::detail {

/// Where the factor of a sparse symmetric matrix has entries. Columns with the same rows below
/// them stand side by side as one supernode, a dense block; a few zeros are stored where that joins
/// small supernodes.
struct Supernodes {
  Eigen::VectorXi place;  ///< #size: column of the factor for each unknown (AMD, then postorder)
  std::vector<std::int32_t> first;      ///< #supernodes + 1: first column of each
  std::vector<std::int32_t> row_begin;  ///< #supernodes + 1, into row
  std::vector<std::int32_t> row;        ///< rising rows below the columns of a supernode
  std::vector<std::int32_t> parent;     ///< of each supernode, later than it; -1: none

  std::int32_t count() const { return static_cast<std::int32_t>(parent.size()); }
  std::int32_t num_columns(std::int32_t s) const {
    return first[static_cast<std::size_t>(s) + 1] - first[static_cast<std::size_t>(s)];
  }
  std::int32_t num_rows(std::int32_t s) const {
    return row_begin[static_cast<std::size_t>(s) + 1] - row_begin[static_cast<std::size_t>(s)];
  }
};

/// @param lower lower triangle, column-major
/// Cost: O(entries of the factor) time, O(size + entries of the matrix + rows) memory.
/// Source: Liu, The role of elimination trees in sparse factorization (1990).
Supernodes find_supernodes(const Eigen::SparseMatrix<double>& lower);

}  // namespace dupin::detail
