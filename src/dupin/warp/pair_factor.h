#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"

namespace dupin {

/// L D L^T of a sparse symmetric positive definite matrix, and its solution for two right-hand
/// sides at once. The two are interleaved, x0 y0 x1 y1 ...: every entry of the factor is read once
/// for both. The factor is kept in dense blocks of up to 16 columns, so that it is read in one
/// stream.
class PairFactor {
 public:
  PairFactor() = default;

  /// @param lower lower triangle of the matrix, column-major
  /// @throws Error(Errc::numerical) E_NOT_CONVERGED if it is not positive definite;
  ///   Error(Errc::interrupted) if cancelled
  /// Cost: for a mesh of V vertices about V^1.5 operations, and entries growing with V log V.
  /// Source: Duff and Reid, The multifrontal solution of indefinite sparse symmetric linear
  /// equations (1983).
  explicit PairFactor(const Eigen::SparseMatrix<double>& lower, const RunControl& run = {});

  Eigen::Index size() const { return size_; }
  /// #size: place of unknown i in the order in which solve() takes and gives the vectors.
  const Eigen::VectorXi& place() const { return place_; }
  /// Stored below the diagonal; a few of them are zeros.
  Eigen::Index num_entries() const { return num_entries_; }

  /// Replaces `pairs` (2 size) by the solution, in the order of place(). The same bits on every
  /// machine. Cost: O(entries).
  void solve(double* pairs) const;

 private:
  // Columns first to first + num_columns: a unit lower triangle, column by column, then the rows
  // below it in panels of four rows: [panel][column][row].
  struct Block {
    std::int32_t first;
    std::int32_t num_columns;
    std::int32_t num_rows;
    std::int32_t row_begin;
    std::int64_t value_begin;
  };

  struct Front;
  void keep_columns(const Front& front);

  Eigen::Index size_ = 0;
  Eigen::Index num_entries_ = 0;
  std::int32_t most_rows_ = 0;
  Eigen::VectorXi place_;
  std::vector<Block> blocks_;
  std::vector<std::int32_t> row_;
  std::vector<double> value_;
  std::vector<double> inverse_diagonal_;
};

}  // namespace dupin
