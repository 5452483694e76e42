// Real cut-outs with soft edges, from file to picture.
#include <gtest/gtest.h>

#include <string>

#include "dupin/io/png.h"
#include "dupin/warp/shape_from_image.h"
#include "dupin/warp/warp_render.h"
#include "tests/support/data.h"

namespace dupin {
namespace {

// Two triangles that cover the picture and two pixels around it.
PlanarMesh sheet(const Raster& raster) {
  PlanarMesh mesh;
  mesh.points.resize(4, 2);
  mesh.points << -2, -2, raster.width + 2, -2, raster.width + 2, raster.height + 2, -2,
      raster.height + 2;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

// The sum of alpha is the area that a soft edge means. The outline lies where a pixel is half
// covered, so along a smooth edge it encloses as much; these garments have ribs, cords and faint
// shadows, which it cuts: 2 %. Painting a garment where it was gives the file's pixels.
TEST(Garments, AreFoundAndPaintedWhereTheyWere) {
  for (const std::string name : {"tshirt", "dress", "kimono", "sari", "t-shirt_02", "jeans"}) {
    SCOPED_TRACE(name);
    DUPIN_REQUIRE_SHARED(path, "garments/cutouts/" + name + ".png");
    const PngFile file = read_png(path);
    const Raster& raster = file.raster;
    ShapeOptions options;
    options.parts = ShapeParts::all;
    const ImageShape shape = shape_from_image(raster, options);
    double sum = 0.0;
    for (std::size_t i = 3; i < raster.rgba8.size(); i += 4) sum += raster.rgba8[i] / 255.0;
    EXPECT_NEAR(signed_area(shape.outline), sum, 0.02 * sum);
    options.expansion_px = 2.0;
    EXPECT_GT(signed_area(shape_from_image(raster, options).outline), signed_area(shape.outline));
    const PlanarMesh mesh = sheet(raster);
    EXPECT_EQ(render_warp(raster, mesh, mesh.points).raster.rgba8, raster.rgba8);
    const std::string written = format_png(raster);
    const PngFile again = parse_png(
        {reinterpret_cast<const std::uint8_t*>(written.data()), written.size()}, "written");
    EXPECT_EQ(again.raster.rgba8, raster.rgba8);
  }
}

}  // namespace
}  // namespace dupin
