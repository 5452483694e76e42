#include "dupin/warp/pair_factor.h"

#include <Eigen/SparseCholesky>
#include <cmath>

#include "dupin/base/error.h"

namespace dupin {

using Eigen::Index;

template <class Scalar>
PairFactor<Scalar>::PairFactor(const Eigen::SparseMatrix<double>& lower) : size_(lower.rows()) {
  if (size_ == 0) return;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(lower);
  const Eigen::VectorXd diagonal = factor.vectorD();
  bool is_definite = factor.info() == Eigen::Success;
  for (Index i = 0; is_definite && i < size_; ++i)
    is_definite = std::isfinite(diagonal[i]) && diagonal[i] > 0.0;
  if (!is_definite) {
    throw Error(Errc::numerical, "E_NOT_CONVERGED",
                "the system of the deformation is not positive definite", {},
                "look for triangles without area");
  }
  place_ = factor.permutationP().indices();
  if (place_.size() == 0) place_.setLinSpaced(size_, 0, static_cast<int>(size_) - 1);
  const auto view = factor.matrixL();
  const Eigen::SparseMatrix<double>& triangle = view.nestedExpression();
  column_begin_.reserve(static_cast<std::size_t>(size_) + 1);
  row_.reserve(static_cast<std::size_t>(triangle.nonZeros()));
  value_.reserve(static_cast<std::size_t>(triangle.nonZeros()));
  inverse_diagonal_.reserve(static_cast<std::size_t>(size_));
  column_begin_.push_back(0);
  for (Index j = 0; j < size_; ++j) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(triangle, j); entry; ++entry) {
      if (entry.row() <= j) continue;
      row_.push_back(static_cast<std::int32_t>(entry.row()));
      value_.push_back(static_cast<Scalar>(entry.value()));
    }
    column_begin_.push_back(static_cast<std::int32_t>(row_.size()));
    inverse_diagonal_.push_back(static_cast<Scalar>(1.0 / diagonal[j]));
  }
}

template <class Scalar>
void PairFactor<Scalar>::solve(Scalar* pairs) const {
  using Pair = Eigen::Array<Scalar, 2, 1>;
  const std::int32_t* begin = column_begin_.data();
  for (Index j = 0; j < size_; ++j) {
    const Scalar x = pairs[2 * j];
    const Scalar y = pairs[2 * j + 1];
    for (std::int32_t i = begin[j]; i < begin[j + 1]; ++i) {
      Scalar* target = pairs + 2 * static_cast<Index>(row_[static_cast<std::size_t>(i)]);
      const Scalar l = value_[static_cast<std::size_t>(i)];
      target[0] -= l * x;
      target[1] -= l * y;
    }
  }
  for (Index j = size_ - 1; j >= 0; --j) {
    const Scalar inverse = inverse_diagonal_[static_cast<std::size_t>(j)];
    Pair sum(pairs[2 * j] * inverse, pairs[2 * j + 1] * inverse);
    for (std::int32_t i = begin[j]; i < begin[j + 1]; ++i) {
      const Scalar* other = pairs + 2 * static_cast<Index>(row_[static_cast<std::size_t>(i)]);
      const Scalar l = value_[static_cast<std::size_t>(i)];
      sum[0] -= l * other[0];
      sum[1] -= l * other[1];
    }
    pairs[2 * j] = sum[0];
    pairs[2 * j + 1] = sum[1];
  }
}

template class PairFactor<double>;
template class PairFactor<float>;

}  // namespace dupin
