#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

namespace dupin {

/// L D L^T of a symmetric positive definite matrix (Eigen's SimplicialLDLT, AMD order), and its
/// solution for two right-hand sides at once. The two are interleaved, x0 y0 x1 y1 ...: every entry
/// of the factor is read once for both.
template <class Scalar>
class PairFactor {
 public:
  PairFactor() = default;

  /// @param lower lower triangle of the matrix, column-major
  /// @throws Error(Errc::numerical) E_NOT_CONVERGED if it is not positive definite
  explicit PairFactor(const Eigen::SparseMatrix<double>& lower);

  Eigen::Index size() const { return size_; }
  /// #size: place of unknown i in the order in which solve() takes and gives the vectors.
  const Eigen::VectorXi& place() const { return place_; }
  Eigen::Index num_entries() const { return static_cast<Eigen::Index>(row_.size()); }

  /// Replaces `pairs` (2 size) by the solution, in the order of place().
  void solve(Scalar* pairs) const;

 private:
  Eigen::Index size_ = 0;
  Eigen::VectorXi place_;
  std::vector<std::int32_t> column_begin_;
  std::vector<std::int32_t> row_;
  std::vector<Scalar> value_;
  std::vector<Scalar> inverse_diagonal_;
};

extern template class PairFactor<double>;
extern template class PairFactor<float>;

}  // namespace dupin
