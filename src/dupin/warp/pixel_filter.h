#pragma once

// Reads colours between pixels. Four floats at a time: red, green, blue, alpha in units of the
// picture, straight outside and weighted by alpha inside.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "dupin/base/instruction_set.h"
#include "dupin/warp/triangle_raster.h"

#ifdef DUPIN_X86
#include <emmintrin.h>
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
    const double x = u - 0.5;
    const double y = v - 0.5;
    const int column = floor_to_int(x);
    const int row = floor_to_int(y);
    const auto right = static_cast<float>(x - column);
    const auto down = static_cast<float>(y - row);
    if (shape.kind == FilterShape::Kind::interpolate) {
      if (right == 0.0F && down == 0.0F) return copy(column, row);
      return straight(interpolate(column, row, right, down));
    }
    if (shape.kind == FilterShape::Kind::widen) {
      return straight(widen(column, row, right, down, shape));
    }
    return straight(turn(column, row, right, down, shape));
  }

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
  // Negative lobes can leave the range; what is left of colour without alpha is none.
  static DUPIN_INLINE Colour straight(Colour sum) {
    const float alpha = sum[3];
    if (!(alpha > 0.0F)) return Colour{};
    Colour colour = sum * (1.0F / alpha);
    for (int k = 0; k < 3; ++k) colour[k] = std::min(std::max(colour[k], 0.0F), kMax);
    colour[3] = std::min(alpha, kMax);
    return colour;
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
      for (int i = -shape.reach_x; i <= shape.reach_x + 1; ++i) {
        const float dx = static_cast<float>(i) - right;
        const float s = m[0] * dx + m[1] * dy;
        const float t = m[2] * dx + m[3] * dy;
        if (!(std::abs(s) < 2.0F && std::abs(t) < 2.0F)) continue;
        const float weight = cubic_kernel(s) * cubic_kernel(t);
        total += weight;
        const int x = column + i;
        if (is_row_inside && x >= 0 && x < width_) part += weight * weighted(load(pixel(x, y)));
      }
      sum += part;
    }
    // The lattice is finer than the kernel, so the weights cannot cancel.
    return total > 0.0F ? sum * (1.0F / total) : Colour{};
  }

  const T* rgba_;
  int width_;
  int height_;
};

}  // namespace dupin::detail
