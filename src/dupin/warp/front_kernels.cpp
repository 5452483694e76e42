#include "dupin/warp/front_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "dupin/base/instruction_set.h"

namespace dupin::detail {
namespace {

using Pair = double __attribute__((vector_size(16)));
using Lanes = double __attribute__((vector_size(32)));  // rows of a panel

constexpr std::int32_t kPivots = 4;  // eliminated together, so that the rest is read less often

template <class Vector>
DUPIN_INLINE void load(const double* from, Vector& to) {
  __builtin_memcpy(&to, from, sizeof(Vector));
}

// rest -= the products of pivot columns k to k + kCount, for columns `begin` and further.
template <std::size_t kCount>
DUPIN_INLINE void subtract_products(double* front, std::int32_t size, std::int32_t k,
                                    std::int32_t begin, const double* diagonal) {
  std::array<const double*, kCount> pivot{};
  std::array<double, kCount> scale{};
  for (std::size_t t = 0; t < kCount; ++t)
    pivot[t] = front + (k + static_cast<std::ptrdiff_t>(t)) * size;
  for (std::int32_t j = begin; j < size; ++j) {
    for (std::size_t t = 0; t < kCount; ++t)
      scale[t] = diagonal[k + static_cast<std::int32_t>(t)] * pivot[t][j];
    double* __restrict column = front + std::ptrdiff_t{j} * size;
    for (std::int32_t i = j; i < size; ++i) {
      double value = column[i];
      for (std::size_t t = 0; t < kCount; ++t) value -= pivot[t][i] * scale[t];
      column[i] = value;
    }
  }
}

DUPIN_INLINE bool eliminate_any(double* front, std::int32_t size, std::int32_t num_columns,
                                double* diagonal) {
  for (std::int32_t k = 0; k < num_columns; k += kPivots) {
    const std::int32_t count = std::min(kPivots, num_columns - k);
    for (std::int32_t t = k; t < k + count; ++t) {
      double* __restrict column = front + std::ptrdiff_t{t} * size;
      for (std::int32_t u = k; u < t; ++u) {
        const double* before = front + std::ptrdiff_t{u} * size;
        const double scale = diagonal[u] * before[t];
        for (std::int32_t i = t; i < size; ++i) column[i] -= before[i] * scale;
      }
      const double d = column[t];
      if (!std::isfinite(d) || !(d > 0.0)) return false;
      diagonal[t] = d;
      const double inverse = 1.0 / d;
      for (std::int32_t i = t + 1; i < size; ++i) column[i] *= inverse;
    }
    const std::int32_t begin = k + count;
    switch (count) {
      case 4:
        subtract_products<4>(front, size, k, begin, diagonal);
        break;
      case 3:
        subtract_products<3>(front, size, k, begin, diagonal);
        break;
      case 2:
        subtract_products<2>(front, size, k, begin, diagonal);
        break;
      default:
        subtract_products<1>(front, size, k, begin, diagonal);
    }
  }
  return true;
}

DUPIN_INLINE std::int32_t triangle_size(std::int32_t num_columns) {
  return num_columns * (num_columns - 1) / 2;
}

DUPIN_INLINE void forward_any(const FactorBlock& block, double* pairs) {
  double* own = pairs + 2 * std::ptrdiff_t{block.first};
  const double* value = block.value;
  const std::int32_t width = block.num_columns;
  for (std::int32_t c = 0; c < width; ++c) {
    Pair x;
    load(own + 2 * c, x);
    for (std::int32_t r = c + 1; r < width; ++r, ++value) {
      Pair y;
      load(own + 2 * r, y);
      y -= *value * x;
      __builtin_memcpy(own + 2 * r, &y, sizeof(Pair));
    }
  }
  for (std::int32_t r = 0; r < block.num_rows; r += kPanelRows) {
    Lanes sum_x{};
    Lanes sum_y{};
    for (std::int32_t c = 0; c < width; ++c, value += kPanelRows) {
      Lanes entry;
      load(value, entry);
      sum_x += entry * own[2 * c];
      sum_y += entry * own[2 * c + 1];
    }
    const std::int32_t count = std::min(kPanelRows, block.num_rows - r);
    for (std::int32_t i = 0; i < count; ++i) {
      double* to = pairs + 2 * std::ptrdiff_t{block.row[r + i]};
      Pair y;
      load(to, y);
      y -= Pair{sum_x[i], sum_y[i]};
      __builtin_memcpy(to, &y, sizeof(Pair));
    }
  }
}

// own[c] -= column c of the panels times the gathered rows, for kCount columns from `begin`.
template <std::size_t kCount>
DUPIN_INLINE void subtract_columns(const double* panels, std::int32_t num_panels,
                                   std::int32_t width, std::int32_t begin, const double* gathered,
                                   double* own) {
  std::array<Lanes, kCount> sum_x{};
  std::array<Lanes, kCount> sum_y{};
  const double* value = panels + std::ptrdiff_t{begin} * kPanelRows;
  for (std::int32_t p = 0; p < num_panels; ++p, value += std::ptrdiff_t{width} * kPanelRows) {
    Lanes x;
    Lanes y;
    load(gathered + std::ptrdiff_t{2 * p} * kPanelRows, x);
    load(gathered + std::ptrdiff_t{2 * p + 1} * kPanelRows, y);
    for (std::size_t c = 0; c < kCount; ++c) {
      Lanes entry;
      load(value + c * kPanelRows, entry);
      sum_x[c] += entry * x;
      sum_y[c] += entry * y;
    }
  }
  double* to = own + 2 * std::ptrdiff_t{begin};
  for (std::size_t c = 0; c < kCount; ++c, to += 2) {
    const Lanes& sx = sum_x[c];
    const Lanes& sy = sum_y[c];
    to[0] -= (sx[0] + sx[1]) + (sx[2] + sx[3]);
    to[1] -= (sy[0] + sy[1]) + (sy[2] + sy[3]);
  }
}

DUPIN_INLINE void backward_any(const FactorBlock& block, const double* inverse_diagonal,
                               double* gathered, double* pairs) {
  double* own = pairs + 2 * std::ptrdiff_t{block.first};
  const std::int32_t width = block.num_columns;
  for (std::int32_t c = 0; c < width; ++c) {
    own[2 * c] *= inverse_diagonal[block.first + c];
    own[2 * c + 1] *= inverse_diagonal[block.first + c];
  }
  // Panel by panel four x, then four y.
  const std::int32_t num_panels = (block.num_rows + kPanelRows - 1) / kPanelRows;
  for (std::int32_t r = 0; r < num_panels * kPanelRows; ++r) {
    double* to = gathered + 2 * (r / kPanelRows) * kPanelRows + r % kPanelRows;
    to[0] = r < block.num_rows ? pairs[2 * std::ptrdiff_t{block.row[r]}] : 0.0;
    to[kPanelRows] = r < block.num_rows ? pairs[2 * std::ptrdiff_t{block.row[r]} + 1] : 0.0;
  }
  const double* panels = block.value + triangle_size(width);
  std::int32_t c = 0;
  for (; c + 4 <= width; c += 4) subtract_columns<4>(panels, num_panels, width, c, gathered, own);
  switch (width - c) {
    case 3:
      subtract_columns<3>(panels, num_panels, width, c, gathered, own);
      break;
    case 2:
      subtract_columns<2>(panels, num_panels, width, c, gathered, own);
      break;
    case 1:
      subtract_columns<1>(panels, num_panels, width, c, gathered, own);
      break;
    default:
      break;
  }
  const double* value = panels;
  for (c = width - 1; c >= 0; --c) {
    value -= width - 1 - c;
    Pair x;
    load(own + 2 * c, x);
    for (std::int32_t r = c + 1; r < width; ++r) {
      Pair y;
      load(own + 2 * r, y);
      x -= value[r - c - 1] * y;
    }
    __builtin_memcpy(own + 2 * c, &x, sizeof(Pair));
  }
}

#define DUPIN_VARIANT(suffix, attribute)                                                        \
  attribute bool eliminate_##suffix(double* front, std::int32_t size, std::int32_t num_columns, \
                                    double* diagonal) {                                         \
    return eliminate_any(front, size, num_columns, diagonal);                                   \
  }                                                                                             \
  attribute void forward_##suffix(const FactorBlock& block, double* pairs) {                    \
    forward_any(block, pairs);                                                                  \
  }                                                                                             \
  attribute void backward_##suffix(const FactorBlock& block, const double* inverse_diagonal,    \
                                   double* gathered, double* pairs) {                           \
    backward_any(block, inverse_diagonal, gathered, pairs);                                     \
  }

DUPIN_VARIANT(base, )
#ifdef DUPIN_X86
DUPIN_VARIANT(avx2, DUPIN_AVX2)
#endif

}  // namespace

bool eliminate(double* front, std::int32_t size, std::int32_t num_columns, double* diagonal) {
#ifdef DUPIN_X86
  if (instruction_set() != InstructionSet::base)
    return eliminate_avx2(front, size, num_columns, diagonal);
#endif
  return eliminate_base(front, size, num_columns, diagonal);
}

void solve_forward(const FactorBlock& block, double* pairs) {
#ifdef DUPIN_X86
  if (instruction_set() != InstructionSet::base) return forward_avx2(block, pairs);
#endif
  forward_base(block, pairs);
}

void solve_backward(const FactorBlock& block, const double* inverse_diagonal, double* gathered,
                    double* pairs) {
#ifdef DUPIN_X86
  if (instruction_set() != InstructionSet::base)
    return backward_avx2(block, inverse_diagonal, gathered, pairs);
#endif
  backward_base(block, inverse_diagonal, gathered, pairs);
}

}  // namespace dupin::detail
