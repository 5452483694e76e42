#include "dupin/io/png.h"

#include <png.h>

#include <new>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/file.h"

namespace dupin {
namespace {

/// What the callbacks of libpng see. A C++ exception must not cross C frames, so the callbacks
/// leave a flag and png_error() jumps back to write_rows().
struct Sink {
  std::string bytes;
  std::string message;
  bool is_out_of_memory = false;
};

void append_bytes(png_structp png, png_bytep data, png_size_t size) {
  auto* sink = static_cast<Sink*>(png_get_io_ptr(png));
  try {
    sink->bytes.append(reinterpret_cast<const char*>(data), size);
  } catch (const std::bad_alloc&) {
    sink->is_out_of_memory = true;
  }
  if (sink->is_out_of_memory) png_error(png, "out of memory");
}

[[noreturn]] void fail(png_structp png, png_const_charp message) {
  auto* sink = static_cast<Sink*>(png_get_error_ptr(png));
  try {
    sink->message = message;
  } catch (const std::bad_alloc&) {
    sink->is_out_of_memory = true;
  }
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

/// All calls of libpng that may jump; holds nothing that needs a destructor.
bool write_rows(png_structp png, png_infop info, const std::uint8_t* pixels, int width, int height,
                int channels) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), 8,
               channels == 4 ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_BASE, PNG_FILTER_TYPE_BASE);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_set_compression_level(png, 6);
  png_write_info(png, info);
  const std::size_t stride = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels);
  for (int y = 0; y < height; ++y) {
    png_write_row(png, pixels + static_cast<std::size_t>(y) * stride);
  }
  png_write_end(png, nullptr);
  return true;
}

bool is_opaque(const Image& image) {
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
    if (image.rgba[i] != 255) return false;
  }
  return true;
}

std::vector<std::uint8_t> without_alpha(const Image& image) {
  std::vector<std::uint8_t> rgb(image.rgba.size() / 4 * 3);
  for (std::size_t i = 0, j = 0; i < image.rgba.size(); i += 4, j += 3) {
    rgb[j] = image.rgba[i];
    rgb[j + 1] = image.rgba[i + 1];
    rgb[j + 2] = image.rgba[i + 2];
  }
  return rgb;
}

}  // namespace

std::string format_png(const Image& image) {
  validate(image);
  const bool opaque = is_opaque(image);
  const std::vector<std::uint8_t> rgb = opaque ? without_alpha(image) : std::vector<std::uint8_t>();
  Sink sink;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, fail, ignore_warning);
  if (png == nullptr) throw std::bad_alloc();
  png_infop info = png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_write_struct(&png, nullptr);
    throw std::bad_alloc();
  }
  png_set_write_fn(png, &sink, append_bytes, nullptr);
  const bool done = write_rows(png, info, opaque ? rgb.data() : image.rgba.data(), image.width,
                               image.height, opaque ? 3 : 4);
  png_destroy_write_struct(&png, &info);
  if (sink.is_out_of_memory) throw std::bad_alloc();
  if (!done) throw IoError(Errc::internal, "E_INTERNAL", "libpng: " + sink.message);
  return std::move(sink.bytes);
}

void write_png(const std::string& path, const Image& image) {
  write_file_atomically(path, format_png(image));
}

}  // namespace dupin
