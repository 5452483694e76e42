#include "dupin/image/raster.h"

#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

constexpr int kMaxSide = 32768;

void validate_shape(int width, int height, int bit_depth) {
  if (width < 1 || width > kMaxSide || height < 1 || height > kMaxSide) {
    throw InvalidArgument("raster: " + std::to_string(width) + " x " + std::to_string(height) +
                          " pixels, both sides must be in [1, " + std::to_string(kMaxSide) + "]");
  }
  if (bit_depth != 8 && bit_depth != 16) {
    throw InvalidArgument("raster.bit_depth: " + std::to_string(bit_depth) + ", legal: 8 and 16");
  }
}

std::size_t num_elements(int width, int height) {
  return 4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

}  // namespace

Raster make_raster(int width, int height, int bit_depth) {
  validate_shape(width, height, bit_depth);
  Raster raster;
  raster.width = width;
  raster.height = height;
  raster.bit_depth = bit_depth;
  if (bit_depth == 8) {
    raster.rgba8.resize(num_elements(width, height));
  } else {
    raster.rgba16.resize(num_elements(width, height));
  }
  return raster;
}

void validate(const Raster& raster) {
  validate_shape(raster.width, raster.height, raster.bit_depth);
  const std::size_t expected = num_elements(raster.width, raster.height);
  const std::size_t expected8 = raster.bit_depth == 8 ? expected : 0;
  const std::size_t expected16 = raster.bit_depth == 16 ? expected : 0;
  if (raster.rgba8.size() != expected8) {
    throw InvalidArgument("raster.rgba8: " + std::to_string(raster.rgba8.size()) +
                          " elements, expected " + std::to_string(expected8));
  }
  if (raster.rgba16.size() != expected16) {
    throw InvalidArgument("raster.rgba16: " + std::to_string(raster.rgba16.size()) +
                          " elements, expected " + std::to_string(expected16));
  }
}

Raster to_raster(const Image& image) {
  validate(image);
  Raster raster;
  raster.width = image.width;
  raster.height = image.height;
  raster.rgba8 = image.rgba;
  raster.colour.srgb_intent = 0;
  return raster;
}

Raster with_bit_depth(const Raster& raster, int bit_depth) {
  validate(raster);
  validate_shape(raster.width, raster.height, bit_depth);
  if (bit_depth == raster.bit_depth) return raster;
  Raster result = make_raster(raster.width, raster.height, bit_depth);
  result.colour = raster.colour;
  if (bit_depth == 16) {
    for (std::size_t i = 0; i < raster.rgba8.size(); ++i) {
      result.rgba16[i] = static_cast<std::uint16_t>(257U * raster.rgba8[i]);
    }
  } else {
    for (std::size_t i = 0; i < raster.rgba16.size(); ++i) {
      result.rgba8[i] = static_cast<std::uint8_t>((raster.rgba16[i] + 128U) / 257U);
    }
  }
  return result;
}

Image to_image(const Raster& raster) {
  validate(raster);
  if (raster.bit_depth == 8) return {raster.width, raster.height, raster.rgba8};
  return {raster.width, raster.height, with_bit_depth(raster, 8).rgba8};
}

}  // namespace dupin
