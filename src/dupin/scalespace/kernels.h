#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "dupin/scalespace/diffusion_operator.h"

namespace dupin::detail {

/// Slices first..last-1 of one step of the recurrence, in row order:
/// out = alpha (sum_j b_ij x_j) + (beta0 + beta1 B_ii) x - gamma previous.
/// The operator's arrays in the precision T; pointers may be null as in DiffusionOperator.
template <class T>
struct SlicedView {
  const std::int64_t* slice_start;
  const std::int32_t* slice_width;
  const std::int32_t* slice_base;
  const std::uint16_t* compact_index;
  const std::int32_t* index;
  const T* weight;
  const T* off_diagonal;
  const T* diagonal;
};

template <class T>
struct StepFactors {
  T alpha;
  T beta0;
  T beta1;
  T gamma;
};

template <class T>
void recurrence_step(const SlicedView<T>& op, const StepFactors<T>& factors, Eigen::Index first,
                     Eigen::Index last, const T* x, const T* previous, T* out);

/// rows[m][v] += sum_{k < count} coefficient[k * stride + m] * term[k][v] for v in [first, last)
/// and m in [0, num_rows); num_rows <= 4. The order of the additions is by k, whatever the
/// instruction set.
template <class T>
void accumulate_terms(const T* const* term, Eigen::Index count, const T* coefficient,
                      Eigen::Index stride, T* const* rows, Eigen::Index num_rows,
                      Eigen::Index first, Eigen::Index last);

}  // namespace dupin::detail
