#include "dupin/render/renderer.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/render/legend.h"
#include "dupin/render/prepared_scene.h"
#include "dupin/render/tile.h"

namespace dupin {
namespace {

void validate(const RenderOptions& options) {
  const auto in = [](const char* what, double value, double low, double high) {
    if (!std::isfinite(value) || value < low || value > high) {
      throw InvalidArgument(std::string(what) + " is " + std::to_string(value) + ", legal range " +
                            std::to_string(low) + " to " + std::to_string(high));
    }
  };
  in("width", options.width, 16, 16384);
  in("height", options.height, 16, 16384);
  in("supersampling", options.supersampling, 1, 4);
  in("occlusion", options.occlusion, 0, 1);
  in("edges", options.edges, 0, 1);
}

}  // namespace

Image render_surface(const Scene& scene, const RenderOptions& options, RunControl run) {
  validate(options);
  detail::validate(scene);
  const std::uint8_t alpha = options.background == Background::white ? 255 : 0;
  Image image = make_image(options.width, options.height, 255, 255, 255, alpha);
  const detail::LegendLayout layout = detail::lay_out(scene, options.width, options.height);
  const detail::PreparedScene prepared =
      detail::prepare_scene(scene, options, layout.picture, run.stage(0.0, 0.5));
  const Eigen::Index num_tiles = Eigen::Index{prepared.tiles_x} * prepared.tiles_y;
  const RunControl drawing = run.stage(0.5, 1.0);
  parallel_for(0, num_tiles, 1, [&](Eigen::Index first, Eigen::Index last) {
    for (Eigen::Index tile = first; tile < last && !run.cancelled(); ++tile) {
      detail::draw_tile(prepared, tile, image);
      drawing.report(static_cast<double>(tile + 1) / static_cast<double>(num_tiles));
    }
  });
  if (run.cancelled()) return {};
  detail::draw_legend(scene, layout, prepared.projection, image);
  return image;
}

}  // namespace dupin
