#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

namespace dupin::detail {

/// A position in the sample grid in 1/256 of a sample, |x|, |y| < 2^29; sample (i, j) lies at
/// (256 i + 128, 256 j + 128). Integers make the coverage of a triangle exact.
struct FixedPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
};

constexpr double kFixedPerSample = 256.0;

/// Samples [x0, x1) x [y0, y1).
struct SampleBox {
  int x0 = 0;
  int y0 = 0;
  int x1 = 0;
  int y1 = 0;
};

/// Twice the signed area of abc in fixed units, > 0 when the turn is from +x to +y.
inline std::int64_t doubled_area(FixedPoint a, FixedPoint b, FixedPoint c) {
  return std::int64_t{b.x - a.x} * (c.y - a.y) - std::int64_t{b.y - a.y} * (c.x - a.x);
}

/// One side of a triangle: value >= 0 where a sample belongs to it. Samples on the line itself
/// belong to it for one direction of travel only, so that two triangles which share the edge, and
/// hence walk it in opposite directions, never both own a sample or both miss it.
struct EdgeFunction {
  std::int64_t step_x = 0;
  std::int64_t step_y = 0;
  std::int64_t at_origin = 0;  ///< at the first sample of the box

  EdgeFunction(FixedPoint a, FixedPoint b, int x0, int y0) {
    const std::int64_t dx = b.x - a.x;
    const std::int64_t dy = b.y - a.y;
    const std::int64_t px = std::int64_t{x0} * 256 + 128 - a.x;
    const std::int64_t py = std::int64_t{y0} * 256 + 128 - a.y;
    const bool owns_line = dy < 0 || (dy == 0 && dx > 0);
    step_x = -dy * 256;
    step_y = dx * 256;
    at_origin = dx * py - dy * px - (owns_line ? 0 : 1);
  }
};

/// Calls sample(x, y) for every sample of `box` inside triangle abc, row by row; either winding,
/// nothing for zero area. Cost: O(samples of its bounding box inside `box`).
template <class Sample>
void fill_triangle(FixedPoint a, FixedPoint b, FixedPoint c, const SampleBox& box,
                   Sample&& sample) {
  const std::int64_t area = doubled_area(a, b, c);
  if (area == 0) return;
  if (area < 0) std::swap(b, c);
  // The first sample at or right of fixed x is ceil((x - 128) / 256); shifts floor negatives.
  const int x0 = std::max(box.x0, (std::min({a.x, b.x, c.x}) + 127) >> 8);
  const int y0 = std::max(box.y0, (std::min({a.y, b.y, c.y}) + 127) >> 8);
  const int x1 = std::min(box.x1, ((std::max({a.x, b.x, c.x}) - 128) >> 8) + 1);
  const int y1 = std::min(box.y1, ((std::max({a.y, b.y, c.y}) - 128) >> 8) + 1);
  if (x0 >= x1 || y0 >= y1) return;
  EdgeFunction ab(a, b, x0, y0);
  EdgeFunction bc(b, c, x0, y0);
  EdgeFunction ca(c, a, x0, y0);
  for (int y = y0; y < y1; ++y) {
    std::int64_t e0 = ab.at_origin;
    std::int64_t e1 = bc.at_origin;
    std::int64_t e2 = ca.at_origin;
    for (int x = x0; x < x1; ++x) {
      if ((e0 | e1 | e2) >= 0) sample(x, y);
      e0 += ab.step_x;
      e1 += bc.step_x;
      e2 += ca.step_x;
    }
    ab.at_origin += ab.step_y;
    bc.at_origin += bc.step_y;
    ca.at_origin += ca.step_y;
  }
}

/// A quantity that is linear over the sample grid, from its values at three corners.
struct SamplePlane {
  double at_zero = 0.0;  ///< at sample (0, 0)
  double per_x = 0.0;
  double per_y = 0.0;

  /// The corners must not be collinear.
  SamplePlane(FixedPoint a, FixedPoint b, FixedPoint c, double va, double vb, double vc) {
    const double scale = kFixedPerSample / static_cast<double>(doubled_area(a, b, c));
    const double ub = vb - va;
    const double uc = vc - va;
    per_x = (ub * (c.y - a.y) - uc * (b.y - a.y)) * scale;
    per_y = (uc * (b.x - a.x) - ub * (c.x - a.x)) * scale;
    at_zero = va + (128 - a.x) / kFixedPerSample * per_x + (128 - a.y) / kFixedPerSample * per_y;
  }
  double at(int x, int y) const { return at_zero + per_x * x + per_y * y; }
};

}  // namespace dupin::detail
