#include "dupin/warp/pixel_filter.h"

#include <Eigen/Core>

namespace dupin::detail {
namespace {

// Up to here the kernel is widened along x and y: cheaper, and not to be told apart.
constexpr double kMaxWiden = 1.25;
constexpr double kMaxShrink = 32.0;
// Rounding alone must not leave the interpolation, which copies pixels.
constexpr double kNoShrink = 1.0 + 1.0 / (1 << 20);

}  // namespace

FilterShape filter_shape(const RasterTriangle& triangle) {
  const double a = 1.0 + triangle.slope[0];
  const double b = triangle.slope[1];
  const double c = triangle.slope[2];
  const double d = 1.0 + triangle.slope[3];
  // J = [a b; c d] takes output pixels to source pixels; J J^T has its stretches as the roots of
  // its eigenvalues, and the directions in the source as its eigenvectors.
  const double xx = a * a + b * b;
  const double xy = a * c + b * d;
  const double yy = c * c + d * d;
  const double mean = 0.5 * (xx + yy);
  const double spread = std::hypot(0.5 * (xx - yy), xy);
  const double longest = std::sqrt(mean + spread);
  FilterShape shape;
  if (longest <= kNoShrink) return shape;
  if (longest <= kMaxWiden) {
    shape.kind = FilterShape::Kind::widen;
    shape.stretch_x = static_cast<float>(std::max(1.0, std::sqrt(xx)));
    shape.stretch_y = static_cast<float>(std::max(1.0, std::sqrt(yy)));
    return shape;
  }
  shape.kind = FilterShape::Kind::turn;
  const double shortest = std::sqrt(std::max(0.0, mean - spread));
  const double s1 = std::min(longest, kMaxShrink);
  const double s2 = std::clamp(shortest, 1.0, kMaxShrink);
  // Direction of the longest stretch; any, where both are equal.
  double ux = 1.0;
  double uy = 0.0;
  if (spread > 1e-12 * mean) {
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
    ux = std::cos(angle);
    uy = std::sin(angle);
  }
  shape.to_kernel = {static_cast<float>(ux / s1), static_cast<float>(uy / s1),
                     static_cast<float>(-uy / s2), static_cast<float>(ux / s2)};
  shape.reach_x = static_cast<int>(std::ceil(2.0 * (std::abs(ux) * s1 + std::abs(uy) * s2)));
  shape.reach_y = static_cast<int>(std::ceil(2.0 * (std::abs(uy) * s1 + std::abs(ux) * s2)));
  return shape;
}

}  // namespace dupin::detail
