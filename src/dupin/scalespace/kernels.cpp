#include "dupin/scalespace/kernels.h"

#include <algorithm>
#include <cstddef>

#include "dupin/base/instruction_set.h"

namespace dupin::detail {
namespace {

using Eigen::Index;

// Sums of the neighbours of eight rows. `Entry` is the width of the stored indices.
template <class T, class Entry>
DUPIN_INLINE void add_neighbors(const Entry* __restrict entry, std::int32_t width,
                                const T* __restrict x, T* sum) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  for (std::int32_t j = 0; j < width; ++j, entry += kLanes) {
    for (Index lane = 0; lane < kLanes; ++lane) sum[lane] += x[entry[lane]];
  }
}

template <class T, bool kWeighted>
DUPIN_INLINE void step_body(const SlicedView<T>& op, const StepFactors<T>& f, Index first,
                            Index last, const T* __restrict x, const T* previous,
                            T* __restrict out) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  for (Index s = first; s < last; ++s) {
    T sum[static_cast<std::size_t>(kLanes)] = {};
    const std::int32_t width = op.slice_width[s];
    const std::int64_t start = op.slice_start[s];
    const Index row = s * kLanes;
    if constexpr (kWeighted) {
      for (std::int64_t e = start; e < start + width * kLanes; e += kLanes) {
        for (Index lane = 0; lane < kLanes; ++lane)
          sum[lane] += op.weight[e + lane] * x[op.index[e + lane]];
      }
      for (Index lane = 0; lane < kLanes; ++lane) {
        const Index r = row + lane;
        out[r] = f.alpha * sum[lane] + (f.beta0 + f.beta1 * op.diagonal[r]) * x[r] -
                 f.gamma * previous[r];
      }
    } else if (op.slice_base[s] >= 0) {
      add_neighbors<T>(op.compact_index + start, width, x + op.slice_base[s], sum);
      const T inverse = op.off_diagonal[row];
      for (Index lane = 0; lane < kLanes; ++lane) {
        const Index r = row + lane;
        out[r] =
            f.alpha * (inverse * sum[lane]) + (f.beta0 + f.beta1) * x[r] - f.gamma * previous[r];
      }
    } else {
      add_neighbors<T>(op.index + start, width, x, sum);
      for (Index lane = 0; lane < kLanes; ++lane) {
        const Index r = row + lane;
        out[r] = f.alpha * (op.off_diagonal[r] * sum[lane]) + (f.beta0 + f.beta1) * x[r] -
                 f.gamma * previous[r];
      }
    }
  }
}

template <class T>
DUPIN_INLINE void step_any(const SlicedView<T>& op, const StepFactors<T>& f, Index first,
                           Index last, const T* x, const T* previous, T* out) {
  if (op.weight != nullptr) {
    step_body<T, true>(op, f, first, last, x, previous, out);
  } else {
    step_body<T, false>(op, f, first, last, x, previous, out);
  }
}

// Two vectors of kBytes for each of up to four rows: eight sums hide the latency of an addition.
// Vectors are written out because GCC 12 unrolls the plain loops before it vectorises them and then
// shuffles (20 times slower in double).
template <class T, Index kRows, Index kBytes>
DUPIN_INLINE void accumulate_block(const T* const* term, Index count, const T* coefficient,
                                   Index stride, T* const* rows, Index v) {
  typedef T Vector __attribute__((vector_size(static_cast<std::size_t>(kBytes)),
                                  aligned(alignof(T)), may_alias));
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(T));
  const auto load = [](const T* from) { return reinterpret_cast<const Vector*>(from); };
  Vector sum[static_cast<std::size_t>(kRows)][2];
  for (Index m = 0; m < kRows; ++m) {
    sum[m][0] = *load(rows[m] + v);
    sum[m][1] = *load(rows[m] + v + kWidth);
  }
  for (Index k = 0; k < count; ++k) {
    const Vector low = *load(term[k] + v);
    const Vector high = *load(term[k] + v + kWidth);
    for (Index m = 0; m < kRows; ++m) {
      const T c = coefficient[k * stride + m];
      sum[m][0] += low * c;
      sum[m][1] += high * c;
    }
  }
  for (Index m = 0; m < kRows; ++m) {
    *reinterpret_cast<Vector*>(rows[m] + v) = sum[m][0];
    *reinterpret_cast<Vector*>(rows[m] + v + kWidth) = sum[m][1];
  }
}

template <class T>
DUPIN_INLINE void accumulate_rest(const T* const* term, Index count, const T* coefficient,
                                  Index stride, T* const* rows, Index num_rows, Index first,
                                  Index last) {
  for (Index v = first; v < last; ++v) {
    for (Index m = 0; m < num_rows; ++m) {
      T sum = rows[m][v];
      for (Index k = 0; k < count; ++k) sum += term[k][v] * coefficient[k * stride + m];
      rows[m][v] = sum;
    }
  }
}

template <class T, Index kRows, Index kBytes>
DUPIN_INLINE void accumulate_body(const T* const* term, Index count, const T* coefficient,
                                  Index stride, T* const* rows, Index first, Index last) {
  constexpr Index kWidth = 2 * kBytes / static_cast<Index>(sizeof(T));
  Index v = first;
  for (; v + kWidth <= last; v += kWidth)
    accumulate_block<T, kRows, kBytes>(term, count, coefficient, stride, rows, v);
  accumulate_rest(term, count, coefficient, stride, rows, kRows, v, last);
}

template <class T, Index kBytes>
DUPIN_INLINE void accumulate_any(const T* const* term, Index count, const T* coefficient,
                                 Index stride, T* const* rows, Index num_rows, Index first,
                                 Index last) {
  switch (num_rows) {
    case 4:
      return accumulate_body<T, 4, kBytes>(term, count, coefficient, stride, rows, first, last);
    case 3:
      return accumulate_body<T, 3, kBytes>(term, count, coefficient, stride, rows, first, last);
    case 2:
      return accumulate_body<T, 2, kBytes>(term, count, coefficient, stride, rows, first, last);
    default:
      return accumulate_body<T, 1, kBytes>(term, count, coefficient, stride, rows, first, last);
  }
}

// Three builds of each kernel.
#define DUPIN_VARIANT(suffix, attribute, bytes)                                                 \
  template <class T>                                                                            \
  attribute void step_##suffix(const SlicedView<T>& op, const StepFactors<T>& f, Index first,   \
                               Index last, const T* x, const T* previous, T* out) {             \
    step_any<T>(op, f, first, last, x, previous, out);                                          \
  }                                                                                             \
  template <class T>                                                                            \
  attribute void accumulate_##suffix(const T* const* term, Index count, const T* coefficient,   \
                                     Index stride, T* const* rows, Index num_rows, Index first, \
                                     Index last) {                                              \
    accumulate_any<T, bytes>(term, count, coefficient, stride, rows, num_rows, first, last);    \
  }

DUPIN_VARIANT(base, , 16)
#ifdef DUPIN_X86
DUPIN_VARIANT(avx2, DUPIN_AVX2, 32)
DUPIN_VARIANT(avx512, DUPIN_AVX512, 64)
#endif

}  // namespace

template <class T>
void recurrence_step(const SlicedView<T>& op, const StepFactors<T>& factors, Index first,
                     Index last, const T* x, const T* previous, T* out) {
#ifdef DUPIN_X86
  switch (instruction_set()) {
    case InstructionSet::avx512:
      return step_avx512<T>(op, factors, first, last, x, previous, out);
    case InstructionSet::avx2:
      return step_avx2<T>(op, factors, first, last, x, previous, out);
    default:
      break;
  }
#endif
  step_base<T>(op, factors, first, last, x, previous, out);
}

template <class T>
void accumulate_terms(const T* const* term, Index count, const T* coefficient, Index stride,
                      T* const* rows, Index num_rows, Index first, Index last) {
#ifdef DUPIN_X86
  switch (instruction_set()) {
    case InstructionSet::avx512:
      return accumulate_avx512<T>(term, count, coefficient, stride, rows, num_rows, first, last);
    case InstructionSet::avx2:
      return accumulate_avx2<T>(term, count, coefficient, stride, rows, num_rows, first, last);
    default:
      break;
  }
#endif
  accumulate_base<T>(term, count, coefficient, stride, rows, num_rows, first, last);
}

template void recurrence_step<double>(const SlicedView<double>&, const StepFactors<double>&, Index,
                                      Index, const double*, const double*, double*);
template void recurrence_step<float>(const SlicedView<float>&, const StepFactors<float>&, Index,
                                     Index, const float*, const float*, float*);
template void accumulate_terms<double>(const double* const*, Index, const double*, Index,
                                       double* const*, Index, Index, Index);
template void accumulate_terms<float>(const float* const*, Index, const float*, Index,
                                      float* const*, Index, Index, Index);

}  // namespace dupin::detail
