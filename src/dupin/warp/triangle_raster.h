#pragma once

// Which pixels a triangle covers, exactly, and where they come from.

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/warp_render.h"

namespace dupin::detail {

inline constexpr std::int64_t kSubPixels = 256;
inline constexpr int kBandRows = 16;

/// A triangle of the output with positive area on the sub-pixel grid, and its way to the source.
struct RasterTriangle {
  std::array<std::int64_t, 3> x{};  ///< corners in 1/256 px, turning from x towards y
  std::array<std::int64_t, 3> y{};
  std::int32_t first_row = 0;  ///< rows with a pixel centre between the lowest and highest corner
  std::int32_t last_row = -1;
  // Source of output place p: p + shift + slope (p - anchor). In this form the identity is exact.
  double anchor_x = 0.0;
  double anchor_y = 0.0;
  double shift_x = 0.0;
  double shift_y = 0.0;
  std::array<double, 4> slope{};  ///< dx/dx, dx/dy, dy/dx, dy/dy, row by row
  // Places read from stay within this box, whatever the rounding of a sliver.
  double box_left = 0.0;
  double box_right = 0.0;
  double box_top = 0.0;
  double box_bottom = 0.0;
};

/// Triangles in the order in which they are painted, and which of them meet each band of rows.
struct TriangleBands {
  std::vector<RasterTriangle> triangles;
  std::vector<std::int32_t> begin;   ///< #bands + 1, into member
  std::vector<std::int32_t> member;  ///< triangles of a band, back to front
  Eigen::Index num_flipped = 0;
  Eigen::Index num_degenerate = 0;

  Eigen::Index num_bands() const { return static_cast<Eigen::Index>(begin.size()) - 1; }
};

/// Checks all arguments but the pictures and sorts the triangles into bands.
/// @throws InvalidArgument as render_warp()
TriangleBands make_bands(const PlanarMesh& mesh, const Points2& target,
                         const std::vector<std::int32_t>& draw_order, const WarpView& view,
                         int width, int height);

/// Pixels [begin, end) of row y whose centres the triangle covers, cut to [0, width).
struct PixelSpan {
  std::int32_t begin = 0;
  std::int32_t end = 0;
};
PixelSpan span_of(const RasterTriangle& triangle, std::int32_t y, std::int32_t width);

/// The source of row y: at(x) for the centre of pixel x.
class SourceRow {
 public:
  SourceRow(const RasterTriangle& triangle, std::int32_t y) : t_(triangle) {
    const double place = y + 0.5;
    base_x_ = t_.shift_x + t_.slope[1] * (place - t_.anchor_y);
    base_y_ = place + (t_.shift_y + t_.slope[3] * (place - t_.anchor_y));
  }
  std::array<double, 2> at(std::int32_t x) const {
    const double place = x + 0.5;
    const double along = place - t_.anchor_x;
    const double u = place + (base_x_ + t_.slope[0] * along);
    const double v = base_y_ + t_.slope[2] * along;
    return {std::clamp(u, t_.box_left, t_.box_right), std::clamp(v, t_.box_top, t_.box_bottom)};
  }

 private:
  const RasterTriangle& t_;
  double base_x_ = 0.0;
  double base_y_ = 0.0;
};

}  // namespace dupin::detail
