// Bytes to pixels to outline: a picture is read whole or refused with a code, twice the same, and
// the outline along its pixels encloses as many as are inside.
#include <algorithm>

#include "dupin/io/png.h"
#include "dupin/warp/shape_from_image.h"
#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using dupin::fuzz::require;

std::optional<dupin::PngFile> try_read(const std::uint8_t* data, std::size_t size,
                                       std::string& code) {
  dupin::ReadLimits limits;
  limits.max_image_pixels = 1 << 16;
  try {
    return dupin::parse_png({data, size}, "input", limits);
  } catch (const dupin::Error& error) {
    require(error.code().starts_with("E_"));
    code = error.diagnostic();
    return std::nullopt;
  }
}

double num_inside(const dupin::Raster& raster) {
  double count = 0.0;
  for (std::size_t i = 3; i < raster.rgba8.size(); i += 4) count += raster.rgba8[i] > 127 ? 1 : 0;
  for (std::size_t i = 3; i < raster.rgba16.size(); i += 4) {
    count += raster.rgba16[i] > 32767 ? 1 : 0;
  }
  return count;
}

// Loops of a positive and of a negative area, each hole after the outer loop of its part.
void require_nested(const dupin::ImageShape& shape) {
  std::int32_t part = -1;
  for (std::size_t l = 0; l < shape.outline.loops.size(); ++l) {
    const double area = dupin::signed_area(shape.outline.loops[l]);
    if (area > 0.0) {
      require(shape.outline.component[l] == ++part);
    } else {
      require(area < 0.0 && shape.outline.component[l] == part);
    }
  }
}

}  // namespace

// Checksums guard every chunk, so random changes rarely get further: seeds decide what is tried.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string first_code;
  std::string second_code;
  const auto file = try_read(data, size, first_code);
  const auto again = try_read(data, size, second_code);
  require(file.has_value() == again.has_value() && first_code == second_code);
  if (!file) return 0;
  dupin::validate(file->raster);
  require(file->raster.rgba8 == again->raster.rgba8 && file->raster.rgba16 == again->raster.rgba16);
  const std::string written = dupin::format_png(file->raster);
  const auto read_back =
      try_read(reinterpret_cast<const std::uint8_t*>(written.data()), written.size(), second_code);
  require(read_back && read_back->raster.rgba8 == file->raster.rgba8 &&
          read_back->raster.rgba16 == file->raster.rgba16 &&
          read_back->raster.colour.icc == file->raster.colour.icc);
  dupin::ShapeOptions options;
  options.parts = dupin::ShapeParts::all;
  options.minimum_area = 1.0;
  options.minimum_hole_area = 1.0;
  options.opaque_is_shape = true;
  const double inside = num_inside(file->raster);
  if (inside == 0.0) return 0;
  options.contour = dupin::ContourKind::pixel_edges;
  const dupin::ImageShape pixels = dupin::shape_from_image(file->raster, options);
  require(dupin::signed_area(pixels.outline) == inside);
  require_nested(pixels);
  options.contour = dupin::ContourKind::sub_pixel;
  const dupin::ImageShape smooth = dupin::shape_from_image(file->raster, options);
  require_nested(smooth);
  require(smooth.outline.component == pixels.outline.component);
  return 0;
}
