#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "dupin/warp/pixel_runs.h"

namespace dupin::detail {

/// Values at the pixels of a box that reaches beyond the picture on all sides.
struct DistanceField {
  int width = 0;
  int height = 0;
  int origin_x = 0;  ///< picture column of column 0
  int origin_y = 0;  ///< picture row of row 0
  std::vector<float>
      value;  ///< expansion + 0.5 less the distance to the nearest inside centre [px]
};

/// Replaces `runs` by those of the pixels of the shape in row y.
using ShapeRow = std::function<void(std::int32_t y, std::vector<PixelRun>& runs)>;

/// How far inside the shape grown by `expansion` each pixel centre lies; the border of the shape is
/// taken half a pixel beyond the centres of its pixels. Negative values further out than two pixels
/// are cut off. `shape` is that of a picture of width by height pixels and has some.
/// Cost: O(pixels of the box) time, 6 bytes a pixel. Exact distances, after Felzenszwalb and
/// Huttenlocher (2012), columns first.
DistanceField distance_to_border(int width, int height, const ShapeRow& shape, double expansion);

}  // namespace dupin::detail
