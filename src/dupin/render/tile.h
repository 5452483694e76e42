#pragma once

#include "dupin/image/image.h"
#include "dupin/render/prepared_scene.h"

namespace dupin::detail {

/// Draws tile `index` (row by row) of `scene` into `image`, whose size is that of the
/// options; a tile without items is left as it is.
void draw_tile(const PreparedScene& scene, Eigen::Index index, Image& image);

}  // namespace dupin::detail
