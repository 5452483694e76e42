#include "dupin/io/png.h"

#include <png.h>
#include <zlib.h>

#include <bit>
#include <limits>
#include <new>
#include <utility>
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

/// Rows to be written, and the colour chunks before them, made beforehand.
struct Rows {
  const std::uint8_t* pixels = nullptr;
  int width = 0;
  int height = 0;
  int channels = 0;
  int bit_depth = 8;
  std::vector<std::pair<std::string, std::string>> chunks = {};  // type, data
};

/// All calls of libpng that may jump; holds nothing that needs a destructor.
bool write_rows(png_structp png, png_infop info, const Rows& rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(rows.width),
               static_cast<png_uint_32>(rows.height), rows.bit_depth,
               rows.channels == 4 ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_BASE, PNG_FILTER_TYPE_BASE);
  png_set_compression_level(png, 6);
  png_write_info_before_PLTE(png, info);
  // libpng would have opinions about profiles; they pass unchanged.
  for (const auto& [type, data] : rows.chunks) {
    png_write_chunk(png, reinterpret_cast<png_const_bytep>(type.data()),
                    reinterpret_cast<png_const_bytep>(data.data()), data.size());
  }
  png_write_info(png, info);
  if (rows.bit_depth == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  const std::size_t stride = static_cast<std::size_t>(rows.width) *
                             static_cast<std::size_t>(rows.channels * rows.bit_depth / 8);
  for (int y = 0; y < rows.height; ++y) {
    png_write_row(png, rows.pixels + static_cast<std::size_t>(y) * stride);
  }
  png_write_end(png, nullptr);
  return true;
}

template <class T>
bool is_opaque(const std::vector<T>& rgba) {
  for (std::size_t i = 3; i < rgba.size(); i += 4) {
    if (rgba[i] != std::numeric_limits<T>::max()) return false;
  }
  return true;
}

template <class T>
std::vector<T> without_alpha(const std::vector<T>& rgba) {
  std::vector<T> rgb(rgba.size() / 4 * 3);
  for (std::size_t i = 0, j = 0; i < rgba.size(); i += 4, j += 3) {
    rgb[j] = rgba[i];
    rgb[j + 1] = rgba[i + 1];
    rgb[j + 2] = rgba[i + 2];
  }
  return rgb;
}

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<char>(value >> shift & 0xFFU));
  return bytes;
}

std::string packed_profile(const ColourSpace& colour) {
  if (colour.icc_name.empty() || colour.icc_name.size() > 79 ||
      colour.icc_name.find('\0') != std::string::npos) {
    throw InvalidArgument("raster.colour.icc_name: " + std::to_string(colour.icc_name.size()) +
                          " bytes, legal are 1 to 79 without NUL");
  }
  const auto size = static_cast<uLong>(colour.icc.size());
  std::string packed(compressBound(size), '\0');
  auto packed_size = static_cast<uLongf>(packed.size());
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &packed_size, colour.icc.data(), size,
                9) != Z_OK) {
    throw std::bad_alloc();
  }
  packed.resize(packed_size);
  return colour.icc_name + std::string(2, '\0') + packed;
}

std::vector<std::pair<std::string, std::string>> colour_chunks(const ColourSpace& colour) {
  std::vector<std::pair<std::string, std::string>> chunks;
  if (colour.chromaticities) {
    std::string data;
    for (const std::uint32_t value : *colour.chromaticities) data += big_endian(value);
    chunks.emplace_back("cHRM", data);
  }
  if (colour.gamma) chunks.emplace_back("gAMA", big_endian(*colour.gamma));
  if (!colour.icc.empty()) chunks.emplace_back("iCCP", packed_profile(colour));
  if (colour.srgb_intent) {
    chunks.emplace_back("sRGB", std::string(1, static_cast<char>(*colour.srgb_intent)));
  }
  return chunks;
}

std::string format_rows(const Rows& rows) {
  Sink sink;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, fail, ignore_warning);
  if (png == nullptr) throw std::bad_alloc();
  png_infop info = png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_write_struct(&png, nullptr);
    throw std::bad_alloc();
  }
  png_set_write_fn(png, &sink, append_bytes, nullptr);
  const bool done = write_rows(png, info, rows);
  png_destroy_write_struct(&png, &info);
  if (sink.is_out_of_memory) throw std::bad_alloc();
  if (!done) throw IoError(Errc::internal, "E_INTERNAL", "libpng: " + sink.message);
  return std::move(sink.bytes);
}

template <class T>
std::string format_pixels(int width, int height, const std::vector<T>& rgba,
                          const ColourSpace& colour) {
  const bool opaque = is_opaque(rgba);
  const std::vector<T> rgb = opaque ? without_alpha(rgba) : std::vector<T>();
  Rows rows;
  rows.pixels = reinterpret_cast<const std::uint8_t*>(opaque ? rgb.data() : rgba.data());
  rows.width = width;
  rows.height = height;
  rows.channels = opaque ? 3 : 4;
  rows.bit_depth = 8 * static_cast<int>(sizeof(T));
  rows.chunks = colour_chunks(colour);
  return format_rows(rows);
}

}  // namespace

std::string format_png(const Image& image) {
  validate(image);
  ColourSpace colour;
  colour.srgb_intent = PNG_sRGB_INTENT_PERCEPTUAL;
  return format_pixels(image.width, image.height, image.rgba, colour);
}

std::string format_png(const Raster& raster) {
  validate(raster);
  if (raster.bit_depth == 8) {
    return format_pixels(raster.width, raster.height, raster.rgba8, raster.colour);
  }
  return format_pixels(raster.width, raster.height, raster.rgba16, raster.colour);
}

void write_png(const std::string& path, const Image& image) {
  write_file_atomically(path, format_png(image));
}

void write_png(const std::string& path, const Raster& raster) {
  write_file_atomically(path, format_png(raster));
}

}  // namespace dupin
