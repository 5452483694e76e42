#pragma once

#include "dupin/image/image.h"
#include "dupin/render/camera.h"
#include "dupin/render/scene.h"
#include "dupin/render/ticks.h"

namespace dupin::detail {

/// Where the parts of a picture go. [px]
struct LegendLayout {
  Viewport picture;  ///< of the surfaces
  Viewport bar;      ///< of the colour bar, without its ticks
  Ticks ticks;
  double em = 24.0;  ///< size of the text
};

LegendLayout lay_out(const Scene& scene, int width, int height);

/// Draws title, caption, colour bar and scale bar over `image`.
void draw_legend(const Scene& scene, const LegendLayout& layout, const Projection& projection,
                 Image& image);

}  // namespace dupin::detail
