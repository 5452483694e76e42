#pragma once

// Reads colours between pixels. Four floats at a time: red, green, blue, alpha in units of the
// picture, straight outside and weighted by alpha inside.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "dupin/base/instruction_set.h"
#include "dupin/warp/triangle_raster.h"

#ifdef DUPIN_X86
#include <immintrin.h>
#endif

namespace dupin::detail {

using Colour = float __attribute__((vector_size(16)));

/// The kernel of Catmull and Rom: interpolates, and reproduces quadratic functions.
inline float cubic_kernel(float t) {
  t = std::abs(t);
  if (t < 1.0F) return (1.5F * t - 2.5F) * t * t + 1.0F;
  if (t < 2.0F) return ((-0.5F * t + 2.5F) * t - 4.0F) * t + 2.0F;
  return 0.0F;
}

/// How a triangle is read: the same for all its pixels.
struct FilterShape {
  enum class Kind { interpolate, widen, turn };
  Kind kind = Kind::interpolate;
  float stretch_x = 1.0F;  ///< widen: factors along x and y
  float stretch_y = 1.0F;
  /// turn: source offset to kernel argument, row by row.
  std::array<float, 4> to_kernel{};
  int reach_x = 2;  ///< turn: pixels that matter on each side
  int reach_y = 2;
};

/// The filter of a triangle from the derivative of its way to the source (I + slope).
FilterShape filter_shape(const RasterTriangle& triangle);

template <class T>
class PixelReader {
 public:
  static constexpr float kMax = static_cast<float>(std::numeric_limits<T>::max());

  PixelReader(const std::vector<T>& rgba, int width, int height)
      : rgba_(rgba.data()), width_(width), height_(height) {}

  /// The straight colour at (u, v), centres at .5; transparent beyond the picture.
  DUPIN_INLINE Colour read(double u, double v, const FilterShape& shape) const {
    const auto [column, row, right, down] = cell_of(u, v);
    if (shape.kind == FilterShape::Kind::interpolate) {
      if (right == 0.0F && down == 0.0F) return copy(column, row);
      return straight(interpolate(column, row, right, down));
    }
    if (shape.kind == FilterShape::Kind::widen) {
      return straight(widen(column, row, right, down, shape));
    }
    return straight(turn(column, row, right, down, shape));
  }

#ifdef DUPIN_X86
  /// read() for machines with AVX2: the same bits.
  DUPIN_AVX2_INLINE Colour read_avx2(double u, double v, const FilterShape& shape) const {
    const auto [column, row, right, down] = cell_of(u, v);
    if (shape.kind == FilterShape::Kind::interpolate) {
      if (right == 0.0F && down == 0.0F) return copy(column, row);
      const bool is_inside = column >= 1 && row >= 1 && column + 2 < width_ && row + 2 < height_;
      return straight(is_inside ? interpolate_avx2(column, row, right, down)
                                : interpolate(column, row, right, down));
    }
    if (shape.kind == FilterShape::Kind::widen) {
      const bool is_inside = column >= 2 && row >= 2 && column + 3 < width_ && row + 3 < height_;
      return straight(is_inside ? widen_avx2(column, row, right, down, shape)
                                : widen(column, row, right, down, shape));
    }
    return straight(turn_avx2(column, row, right, down, shape));
  }
#endif

  static DUPIN_INLINE Colour load(const std::uint8_t* p) {
#ifdef DUPIN_X86
    int bits = 0;
    __builtin_memcpy(&bits, p, 4);
    const __m128i zero = _mm_setzero_si128();
    const __m128i words = _mm_unpacklo_epi8(_mm_cvtsi32_si128(bits), zero);
    return _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, zero));
#else
    return Colour{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]),
                  static_cast<float>(p[3])};
#endif
  }
  static DUPIN_INLINE Colour load(const std::uint16_t* p) {
#ifdef DUPIN_X86
    const __m128i words = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p));
    return _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, _mm_setzero_si128()));
#else
    return Colour{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]),
                  static_cast<float>(p[3])};
#endif
  }

 private:
  // The pixel whose centre is up and left of (u, v), and how far that is.
  struct Cell {
    int column;
    int row;
    float right;
    float down;
  };
  static DUPIN_INLINE Cell cell_of(double u, double v) {
    const double x = u - 0.5;
    const double y = v - 0.5;
    const int column = floor_to_int(x);
    const int row = floor_to_int(y);
    return {column, row, static_cast<float>(x - column), static_cast<float>(y - row)};
  }
  static DUPIN_INLINE int floor_to_int(double x) {
    const int cut = static_cast<int>(x);
    return cut - (x < cut ? 1 : 0);
  }
  DUPIN_INLINE const T* pixel(int x, int y) const {
    return rgba_ + 4 * (static_cast<std::ptrdiff_t>(y) * width_ + x);
  }
  static DUPIN_INLINE Colour weighted(Colour straight) {
    const float alpha = straight[3];
    return straight * Colour{alpha, alpha, alpha, 1.0F};
  }
  static DUPIN_INLINE Colour clamped(Colour c) {
    const Colour low{};
    const Colour high{kMax, kMax, kMax, kMax};
    c = c < low ? low : c;
    return high < c ? high : c;
  }
  // Negative lobes can leave the range; what is left of colour without alpha is none.
  static DUPIN_INLINE Colour straight(Colour sum) {
    const float alpha = sum[3];
    if (!(alpha > 0.0F)) return Colour{};
    Colour colour = sum * (1.0F / alpha);
    colour[3] = alpha;
    return clamped(colour);
  }
  DUPIN_INLINE Colour copy(int x, int y) const {
    if (x < 0 || x >= width_ || y < 0 || y >= height_) return Colour{};
    return load(pixel(x, y));
  }
  static DUPIN_INLINE std::array<float, 4> weights(float f) {
    const float g = 1.0F - f;
    return {-0.5F * f * g * g, (1.5F * f - 2.5F) * f * f + 1.0F, (1.5F * g - 2.5F) * g * g + 1.0F,
            -0.5F * g * f * f};
  }
  DUPIN_INLINE Colour interpolate(int column, int row, float right, float down) const {
    const std::array<float, 4> wx = weights(right);
    const std::array<float, 4> wy = weights(down);
    Colour sum{};
    if (column >= 1 && row >= 1 && column + 2 < width_ && row + 2 < height_) {
      const T* line = pixel(column - 1, row - 1);
      for (std::size_t j = 0; j < 4; ++j, line += 4 * static_cast<std::ptrdiff_t>(width_)) {
        const Colour part = wx[0] * weighted(load(line)) + wx[1] * weighted(load(line + 4)) +
                            wx[2] * weighted(load(line + 8)) + wx[3] * weighted(load(line + 12));
        sum += wy[j] * part;
      }
      return sum;
    }
    for (int j = 0; j < 4; ++j) {
      const int y = row - 1 + j;
      if (y < 0 || y >= height_) continue;
      Colour part{};
      for (int i = 0; i < 4; ++i) {
        const int x = column - 1 + i;
        if (x < 0 || x >= width_) continue;
        part += wx[static_cast<std::size_t>(i)] * weighted(load(pixel(x, y)));
      }
      sum += wy[static_cast<std::size_t>(j)] * part;
    }
    return sum;
  }

  // A kernel of 32 by 32 reaches 2 sqrt(2) 32 < 91 pixels; eight weights are made at a time.
  static constexpr std::size_t kMostTaps = 192;
  static constexpr int kWideTaps = 6;  // of a kernel that is up to 1.25 times as wide
  // Weights of pixels column - 2 to column + 3, of sum 1.
  static DUPIN_INLINE std::array<float, kWideTaps> wide_weights(float f, float stretch) {
    std::array<float, kWideTaps> w{};
    float sum = 0.0F;
    for (std::size_t i = 0; i < kWideTaps; ++i) {
      w[i] = cubic_kernel((static_cast<float>(i) - 2.0F - f) / stretch);
      sum += w[i];
    }
    for (float& value : w) value /= sum;
    return w;
  }
  Colour widen(int column, int row, float right, float down, const FilterShape& shape) const {
    const std::array<float, kWideTaps> wx = wide_weights(right, shape.stretch_x);
    const std::array<float, kWideTaps> wy = wide_weights(down, shape.stretch_y);
    const int first = std::clamp(2 - column, 0, kWideTaps);
    const int last = std::clamp(width_ + 2 - column, 0, kWideTaps);
    Colour sum{};
    for (int j = 0; j < kWideTaps; ++j) {
      const int y = row - 2 + j;
      if (y < 0 || y >= height_) continue;
      Colour part{};
      for (int i = first; i < last; ++i) {
        part += wx[static_cast<std::size_t>(i)] * weighted(load(pixel(column - 2 + i, y)));
      }
      sum += wy[static_cast<std::size_t>(j)] * part;
    }
    return sum;
  }

  Colour turn(int column, int row, float right, float down, const FilterShape& shape) const {
    Colour sum{};
    float total = 0.0F;
    const auto& m = shape.to_kernel;
    for (int j = -shape.reach_y; j <= shape.reach_y + 1; ++j) {
      const int y = row + j;
      const float dy = static_cast<float>(j) - down;
      const bool is_row_inside = y >= 0 && y < height_;
      Colour part{};
      float row_total = 0.0F;
      for (int i = -shape.reach_x; i <= shape.reach_x + 1; ++i) {
        const float dx = static_cast<float>(i) - right;
        const float s = m[0] * dx + m[1] * dy;
        const float t = m[2] * dx + m[3] * dy;
        if (!(std::abs(s) < 2.0F && std::abs(t) < 2.0F)) continue;
        const float weight = cubic_kernel(s) * cubic_kernel(t);
        row_total += weight;
        const int x = column + i;
        if (is_row_inside && x >= 0 && x < width_) part += weight * weighted(load(pixel(x, y)));
      }
      sum += part;
      total += row_total;
    }
    // The lattice is finer than the kernel, so the weights cannot cancel.
    return total > 0.0F ? sum * (1.0F / total) : Colour{};
  }

#ifdef DUPIN_X86
  // Two rows at once: the lower four lanes are a pixel of the upper row, the others the one below
  // it. Sums over a row and then over rows are taken in the order of the functions above.
  static DUPIN_AVX2_INLINE __m256 floats(__m128i eight_bytes_or_words) {
    if constexpr (sizeof(T) == 1) {
      return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(eight_bytes_or_words));
    } else {
      return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(eight_bytes_or_words));
    }
  }
  static DUPIN_AVX2_INLINE __m256 weighted_avx2(__m256 straight) {
    const __m256 alpha = _mm256_shuffle_ps(straight, straight, 0xFF);
    return straight * _mm256_blend_ps(alpha, _mm256_set1_ps(1.0F), 0x88);
  }
  // Two neighbouring pixels of both rows.
  static DUPIN_AVX2_INLINE void load_taps(const T* upper, const T* lower, __m256& first,
                                          __m256& second) {
    if constexpr (sizeof(T) == 1) {
      const __m128i both =
          _mm_unpacklo_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(upper)),
                             _mm_loadl_epi64(reinterpret_cast<const __m128i*>(lower)));
      first = weighted_avx2(floats(both));
      second = weighted_avx2(floats(_mm_srli_si128(both, 8)));
    } else {
      const __m128i a = _mm_loadu_si128(reinterpret_cast<const __m128i*>(upper));
      const __m128i b = _mm_loadu_si128(reinterpret_cast<const __m128i*>(lower));
      first = weighted_avx2(floats(_mm_unpacklo_epi64(a, b)));
      second = weighted_avx2(floats(_mm_unpackhi_epi64(a, b)));
    }
  }
  static DUPIN_AVX2_INLINE void add_rows(__m256 part, float upper, float lower, Colour& sum) {
    const __m256 scaled = _mm256_set_m128(_mm_set1_ps(lower), _mm_set1_ps(upper)) * part;
    sum += _mm256_castps256_ps128(scaled);
    sum += _mm256_extractf128_ps(scaled, 1);
  }
  DUPIN_AVX2_INLINE Colour interpolate_avx2(int column, int row, float right, float down) const {
    const std::array<float, 4> wx = weights(right);
    const std::array<float, 4> wy = weights(down);
    const std::ptrdiff_t stride = 4 * static_cast<std::ptrdiff_t>(width_);
    const T* line = pixel(column - 1, row - 1);
    Colour sum{};
    for (std::size_t j = 0; j < 4; j += 2, line += 2 * stride) {
      __m256 a;
      __m256 b;
      __m256 c;
      __m256 d;
      load_taps(line, line + stride, a, b);
      load_taps(line + 8, line + stride + 8, c, d);
      const __m256 part = _mm256_set1_ps(wx[0]) * a + _mm256_set1_ps(wx[1]) * b +
                          _mm256_set1_ps(wx[2]) * c + _mm256_set1_ps(wx[3]) * d;
      add_rows(part, wy[j], wy[j + 1], sum);
    }
    return sum;
  }

  // cubic_kernel() of eight.
  static DUPIN_AVX2_INLINE __m256 cubic_avx2(__m256 t) {
    t = _mm256_andnot_ps(_mm256_set1_ps(-0.0F), t);
    const __m256 one = _mm256_set1_ps(1.0F);
    const __m256 two = _mm256_set1_ps(2.0F);
    const __m256 middle = (_mm256_set1_ps(1.5F) * t - _mm256_set1_ps(2.5F)) * t * t + one;
    const __m256 lobe =
        ((_mm256_set1_ps(-0.5F) * t + _mm256_set1_ps(2.5F)) * t - _mm256_set1_ps(4.0F)) * t + two;
    const __m256 outer = _mm256_and_ps(lobe, _mm256_cmp_ps(t, two, _CMP_LT_OQ));
    return _mm256_blendv_ps(outer, middle, _mm256_cmp_ps(t, one, _CMP_LT_OQ));
  }
  static DUPIN_AVX2_INLINE std::array<float, 8> wide_weights_avx2(float f, float stretch) {
    const __m256 place = _mm256_setr_ps(-2.0F, -1.0F, 0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F);
    const __m256 w = cubic_avx2((place - _mm256_set1_ps(f)) / _mm256_set1_ps(stretch));
    std::array<float, 8> result{};
    _mm256_storeu_ps(result.data(), w);
    float sum = 0.0F;
    for (std::size_t i = 0; i < kWideTaps; ++i) sum += result[i];
    _mm256_storeu_ps(result.data(), w / _mm256_set1_ps(sum));
    return result;
  }
  DUPIN_AVX2_INLINE Colour widen_avx2(int column, int row, float right, float down,
                                      const FilterShape& shape) const {
    const std::array<float, 8> wx = wide_weights_avx2(right, shape.stretch_x);
    const std::array<float, 8> wy = wide_weights_avx2(down, shape.stretch_y);
    const std::ptrdiff_t stride = 4 * static_cast<std::ptrdiff_t>(width_);
    const T* line = pixel(column - 2, row - 2);
    Colour sum{};
    for (std::size_t j = 0; j < kWideTaps; j += 2, line += 2 * stride) {
      __m256 part = _mm256_setzero_ps();
      for (std::size_t i = 0; i < kWideTaps; i += 2) {
        __m256 a;
        __m256 b;
        load_taps(line + 4 * i, line + stride + 4 * static_cast<std::ptrdiff_t>(i), a, b);
        part += _mm256_set1_ps(wx[i]) * a;
        part += _mm256_set1_ps(wx[i + 1]) * b;
      }
      add_rows(part, wy[j], wy[j + 1], sum);
    }
    return sum;
  }

  static DUPIN_AVX2_INLINE Colour weighted_load(const T* p) {
    Colour straight;
    if constexpr (sizeof(T) == 1) {
      int bits = 0;
      __builtin_memcpy(&bits, p, 4);
      straight = _mm_cvtepi32_ps(_mm_cvtepu8_epi32(_mm_cvtsi32_si128(bits)));
    } else {
      straight =
          _mm_cvtepi32_ps(_mm_cvtepu16_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))));
    }
    const __m128 alpha = _mm_shuffle_ps(straight, straight, 0xFF);
    return straight * _mm_blend_ps(alpha, _mm_set1_ps(1.0F), 0x8);
  }
  DUPIN_AVX2_INLINE Colour turn_avx2(int column, int row, float right, float down,
                                     const FilterShape& shape) const {
    std::array<float, kMostTaps> weight;
    const int num_taps = 2 * shape.reach_x + 2;
    const int first = std::clamp(shape.reach_x - column, 0, num_taps);
    const int last = std::clamp(width_ + shape.reach_x - column, first, num_taps);
    const auto& m = shape.to_kernel;
    const __m256 across_s = _mm256_set1_ps(m[0]);
    const __m256 across_t = _mm256_set1_ps(m[2]);
    const __m256 lane = _mm256_setr_ps(0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 7.0F);
    const __m256 start = _mm256_set1_ps(static_cast<float>(-shape.reach_x));
    Colour sum{};
    float total = 0.0F;
    for (int j = -shape.reach_y; j <= shape.reach_y + 1; ++j) {
      const int y = row + j;
      const float dy = static_cast<float>(j) - down;
      const __m256 down_s = _mm256_set1_ps(m[1] * dy);
      const __m256 down_t = _mm256_set1_ps(m[3] * dy);
      int heavy = num_taps;  // the first tap that weighs something
      int light = 0;         // one past the last
      for (int i = 0; i < num_taps; i += 8) {
        const __m256 place = start + (_mm256_set1_ps(static_cast<float>(i)) + lane);
        const __m256 dx = place - _mm256_set1_ps(right);
        const __m256 w = cubic_avx2(across_s * dx + down_s) * cubic_avx2(across_t * dx + down_t);
        _mm256_storeu_ps(weight.data() + i, w);
        const int mask = _mm256_movemask_ps(_mm256_cmp_ps(w, _mm256_setzero_ps(), _CMP_NEQ_UQ));
        if (mask == 0) continue;
        heavy = std::min(heavy, i + std::countr_zero(static_cast<unsigned>(mask)));
        light = i + 32 - std::countl_zero(static_cast<unsigned>(mask));
      }
      // Taps beyond the kernel weigh nothing: adding them would change no bit.
      light = std::min(light, num_taps);
      const bool is_row_inside = y >= 0 && y < height_;
      const int from = is_row_inside ? std::clamp(first, heavy, std::max(heavy, light)) : light;
      const int to = is_row_inside ? std::clamp(last, from, std::max(from, light)) : light;
      float row_total = 0.0F;
      int i = heavy;
      for (; i < from; ++i) row_total += weight[static_cast<std::size_t>(i)];
      Colour part{};
      const T* line = pixel(column - shape.reach_x + from, is_row_inside ? y : 0);
      for (; i < to; ++i, line += 4) {
        const float w = weight[static_cast<std::size_t>(i)];
        row_total += w;
        part += w * weighted_load(line);
      }
      for (; i < light; ++i) row_total += weight[static_cast<std::size_t>(i)];
      total += row_total;
      sum += part;
    }
    return total > 0.0F ? sum * (1.0F / total) : Colour{};
  }
#endif

  const T* rgba_;
  int width_;
  int height_;
};

}  // namespace dupin::detail
