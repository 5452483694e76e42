#include "dupin/image/image.h"

#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

constexpr int kMaxSide = 32768;

void validate_sides(int width, int height) {
  if (width < 1 || width > kMaxSide || height < 1 || height > kMaxSide) {
    throw InvalidArgument("image: " + std::to_string(width) + " x " + std::to_string(height) +
                          " pixels, both sides must be in [1, " + std::to_string(kMaxSide) + "]");
  }
}

std::size_t num_bytes(int width, int height) {
  return 4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

}  // namespace

Image make_image(int width, int height, std::uint8_t red, std::uint8_t green, std::uint8_t blue,
                 std::uint8_t alpha) {
  validate_sides(width, height);
  Image image{width, height, std::vector<std::uint8_t>(num_bytes(width, height))};
  for (std::size_t i = 0; i < image.rgba.size(); i += 4) {
    image.rgba[i] = red;
    image.rgba[i + 1] = green;
    image.rgba[i + 2] = blue;
    image.rgba[i + 3] = alpha;
  }
  return image;
}

void validate(const Image& image) {
  validate_sides(image.width, image.height);
  if (image.rgba.size() != num_bytes(image.width, image.height)) {
    throw InvalidArgument("image.rgba: " + std::to_string(image.rgba.size()) + " bytes, expected " +
                          std::to_string(num_bytes(image.width, image.height)));
  }
}

}  // namespace dupin
