#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dupin/image/image.h"

namespace dupin {

/// What a file says about the meaning of its colours, carried through unchanged. No function here
/// converts colours: filters work on the numbers as they are stored.
struct ColourSpace {
  std::string icc_name;                ///< 1 to 79 bytes when there is a profile
  std::vector<std::uint8_t> icc;       ///< ICC profile of RGB data; empty: none
  std::optional<int> srgb_intent;      ///< PNG sRGB: rendering intent 0 to 3
  std::optional<std::uint32_t> gamma;  ///< PNG gAMA: 100,000 / gamma
  std::optional<std::array<std::uint32_t, 8>>
      chromaticities;  ///< PNG cHRM: white, red, green, blue
};

/// A picture of 8 or 16 bits a channel. Pixel (x, y), x right and y down, starts at element
/// 4 * (y * width + x): red, green, blue, alpha, straight. One of the two arrays is empty, so a
/// picture of 8 bits takes 4 bytes a pixel. In continuous coordinates the centre of pixel (0, 0) is
/// (0.5, 0.5).
struct Raster {
  int width = 0;                      ///< [px]
  int height = 0;                     ///< [px]
  int bit_depth = 8;                  ///< 8 or 16
  std::vector<std::uint8_t> rgba8;    ///< 4 * width * height when bit_depth is 8
  std::vector<std::uint16_t> rgba16;  ///< 4 * width * height when bit_depth is 16
  ColourSpace colour = {};
};

/// A transparent black picture.
/// @throws InvalidArgument unless 1 <= width, height <= 32768 and bit_depth is 8 or 16
Raster make_raster(int width, int height, int bit_depth);

/// Throws unless both sides are in [1, 32768], the depth is 8 or 16, and the array of that depth
/// has 4 * width * height elements and the other none.
/// @throws InvalidArgument naming the field. Cost: O(1).
void validate(const Raster& raster);

/// The same pixels as a Raster of 8 bits, marked as sRGB. Cost: O(pixels).
Raster to_raster(const Image& image);

/// The same pixels at the other depth: 16 bits are v * 257, 8 bits the nearest of v / 257.
/// @throws InvalidArgument as validate(raster), or for another depth. Cost: O(pixels).
Raster with_bit_depth(const Raster& raster, int bit_depth);

/// 8 bits, whatever the depth; the colour space is forgotten. Cost: O(pixels).
Image to_image(const Raster& raster);

}  // namespace dupin
