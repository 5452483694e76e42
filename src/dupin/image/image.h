#pragma once

#include <cstdint>
#include <vector>

namespace dupin {

/// A picture as plain bytes. Pixel (x, y), x right and y down, is rgba[4 * (y * width + x)] and the
/// three bytes after it: red, green, blue, alpha. Alpha is straight (colours are not multiplied by
/// it), colours are sRGB.
struct Image {
  int width = 0;                   ///< [px]
  int height = 0;                  ///< [px]
  std::vector<std::uint8_t> rgba;  ///< 4 * width * height, row-major, top row first
};

/// An image of one colour.
/// @throws InvalidArgument unless 1 <= width, height <= 32768
Image make_image(int width, int height, std::uint8_t red = 0, std::uint8_t green = 0,
                 std::uint8_t blue = 0, std::uint8_t alpha = 0);

/// Throws unless both sides are in [1, 32768] and the number of bytes is 4 * width * height.
/// @throws InvalidArgument naming the field. Cost: O(1).
void validate(const Image& image);

}  // namespace dupin
