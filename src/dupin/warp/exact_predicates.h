#pragma once

#include <cmath>
#include <cstdint>

namespace dupin {

/// Corners of a prepared outline are multiples of 2^-8 px, vertices of a mesh of 2^-15 px: the
/// seven bits between them let every border segment be halved seven times without leaving its line.
inline constexpr int kOutlineBits = 8;
inline constexpr int kMeshBits = 15;
inline constexpr double kOutlineStep = 1.0 / (1 << kOutlineBits);  ///< [px]
inline constexpr double kMeshStep = 1.0 / (1 << kMeshBits);        ///< [px]

/// Two coordinates of one axis may differ by this much at most [mesh steps]: below it orientation()
/// and dot() fit in 63 bits and in_circle() in 126.
inline constexpr std::int64_t kMaxGridExtent = std::int64_t{3} << 29;

/// A point in units of 2^-15 px.
struct GridPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const GridPoint&, const GridPoint&) = default;
};

/// Twice the signed area of abc, exact: > 0 if the triangle's shoelace sum is positive.
inline std::int64_t orientation(GridPoint a, GridPoint b, GridPoint c) {
  const std::int64_t bx = std::int64_t{b.x} - a.x, by = std::int64_t{b.y} - a.y;
  const std::int64_t cx = std::int64_t{c.x} - a.x, cy = std::int64_t{c.y} - a.y;
  return bx * cy - by * cx;
}

/// (a - p) . (b - p), exact: < 0 exactly if p is strictly inside the circle with diameter ab.
inline std::int64_t dot(GridPoint p, GridPoint a, GridPoint b) {
  return (std::int64_t{a.x} - p.x) * (std::int64_t{b.x} - p.x) +
         (std::int64_t{a.y} - p.y) * (std::int64_t{b.y} - p.y);
}

namespace detail {

__extension__ using Int128 = __int128;

inline int in_circle_exactly(const std::int64_t (&x)[3], const std::int64_t (&y)[3]) {
  Int128 sum = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    sum += Int128{x[i] * x[i] + y[i] * y[i]} * Int128{x[j] * y[k] - y[j] * x[k]};
  }
  return sum > 0 ? 1 : sum < 0 ? -1 : 0;
}

}  // namespace detail

/// 1 if d lies strictly inside the circle through a, b, c (orientation(a, b, c) > 0), -1 strictly
/// outside, 0 on it: exact. Doubles decide where their error cannot: after Shewchuk (1997) ten
/// roundings of the sum of magnitudes bound it, the differences being exact here.
inline int in_circle(GridPoint a, GridPoint b, GridPoint c, GridPoint d) {
  const std::int64_t x[3] = {std::int64_t{a.x} - d.x, std::int64_t{b.x} - d.x,
                             std::int64_t{c.x} - d.x};
  const std::int64_t y[3] = {std::int64_t{a.y} - d.y, std::int64_t{b.y} - d.y,
                             std::int64_t{c.y} - d.y};
  const double ax = static_cast<double>(x[0]), ay = static_cast<double>(y[0]);
  const double bx = static_cast<double>(x[1]), by = static_cast<double>(y[1]);
  const double cx = static_cast<double>(x[2]), cy = static_cast<double>(y[2]);
  const double a2 = ax * ax + ay * ay, b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
  const double bc = bx * cy, cb = by * cx, ca = cx * ay, ac = cy * ax, ab = ax * by, ba = ay * bx;
  const double sum = a2 * (bc - cb) + b2 * (ca - ac) + c2 * (ab - ba);
  const double magnitude = a2 * (std::abs(bc) + std::abs(cb)) + b2 * (std::abs(ca) + std::abs(ac)) +
                           c2 * (std::abs(ab) + std::abs(ba));
  constexpr double kTenRoundings = 1.2e-15;
  if (sum > kTenRoundings * magnitude) return 1;
  if (sum < -kTenRoundings * magnitude) return -1;
  return detail::in_circle_exactly(x, y);
}

}  // namespace dupin
