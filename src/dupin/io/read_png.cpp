#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <new>
#include <string_view>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/io/png_chunks.h"

namespace dupin {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

// What libpng reads instead of a missing end.
constexpr std::array<std::uint8_t, 12> kEndChunk = {0,   0,   0,    0,    'I',  'E',
                                                    'N', 'D', 0xAE, 0x42, 0x60, 0x82};

// The mapped file must not stay in memory beside the picture.
constexpr std::size_t kReleasedAtOnce = std::size_t{1} << 22;

/// All that the calls of libpng share. They run between setjmp() and longjmp(), so nothing here is
/// made or destroyed there, and messages go into arrays of fixed size.
struct Decoder {
  png_structp png = nullptr;
  png_infop info = nullptr;
  ByteSpan stream;                  // of the file up to its last whole chunk
  std::size_t taken = 0;            // of stream, then of kEndChunk
  const FileBytes* file = nullptr;  // what stream maps, if it does
  std::size_t released = 0;         // of stream
  const RunControl* run = nullptr;
  std::uint8_t* rows = nullptr;  // first output row
  std::size_t stride = 0;        // bytes from row to row; 0: every row at the same place
  int height = 0;
  bool is_palette = false;
  int bit_depth = 8;
  int y = 0;  // row being read
  bool is_cancelled = false;
  std::array<char, 160> error{};
  std::array<char, 160> warning{};  // the first one about an ancillary chunk
  int num_warnings = 0;
  bool has_extra_data = false;
  bool has_bad_sum = false;
  bool is_unfinished = false;  // the packed data do not end where the picture does
  /// Called with each row as soon as it is complete (not interlaced pictures only).
  bool (*take_row)(void* target, const std::uint8_t* row, int y) = nullptr;
  void* target = nullptr;
};

void copy_text(std::array<char, 160>& to, const char* from) {
  std::strncpy(to.data(), from, to.size() - 1);
}

void read_bytes(png_structp png, png_bytep to, png_size_t size) {
  auto* const decoder = static_cast<Decoder*>(png_get_io_ptr(png));
  const std::size_t whole = decoder->stream.size();
  if (decoder->taken + size <= whole) {
    std::memcpy(to, decoder->stream.data() + decoder->taken, size);
  } else if (decoder->taken >= whole && decoder->taken + size <= whole + kEndChunk.size()) {
    std::memcpy(to, kEndChunk.data() + (decoder->taken - whole), size);
  } else {
    png_error(png, "Not enough data");
  }
  decoder->taken += size;
  if (decoder->file == nullptr || decoder->taken < decoder->released + kReleasedAtOnce) return;
  decoder->file->release(decoder->released, decoder->taken);
  decoder->released = decoder->taken;
}

[[noreturn]] void jump_out(png_structp png, png_const_charp message) {
  copy_text(static_cast<Decoder*>(png_get_error_ptr(png))->error, message);
  png_longjmp(png, 1);
}

void note_warning(png_structp png, png_const_charp message) {
  auto* const decoder = static_cast<Decoder*>(png_get_error_ptr(png));
  if (std::strncmp(message, "IDAT", 4) == 0 || std::strncmp(message, "Too m", 5) == 0) {
    if (std::strstr(message, "Too m") != nullptr || std::strstr(message, "Extra") != nullptr) {
      decoder->has_extra_data = true;
    } else if (std::strstr(message, "incorrect data check") != nullptr) {
      decoder->has_bad_sum = true;
    } else {
      decoder->is_unfinished = true;
      copy_text(decoder->error, message);
    }
    return;
  }
  if (decoder->num_warnings++ == 0) copy_text(decoder->warning, message);
}

void set_transformations(Decoder& decoder) {
  png_structp png = decoder.png;
  if (decoder.is_palette) {
    png_set_packing(png);  // indices; the palette is looked up, and checked, afterwards
    return;
  }
  png_set_expand(png);
  png_set_gray_to_rgb(png);
  const bool has_alpha = (png_get_color_type(png, decoder.info) & PNG_COLOR_MASK_ALPHA) != 0 ||
                         png_get_valid(png, decoder.info, PNG_INFO_tRNS) != 0;
  if (!has_alpha) png_set_add_alpha(png, 0xFFFF, PNG_FILLER_AFTER);
  if (decoder.bit_depth == 16 && std::endian::native == std::endian::little) png_set_swap(png);
}

// Everything of libpng that may jump back here; holds nothing that needs a destructor.
bool decode(Decoder& decoder) {
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  // A negative number: all ancillary chunks, known ones too, are skipped, but for tRNS.
  png_set_keep_unknown_chunks(decoder.png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  static constexpr png_byte kTransparency[] = {'t', 'R', 'N', 'S', 0};
  png_set_keep_unknown_chunks(decoder.png, PNG_HANDLE_CHUNK_AS_DEFAULT, kTransparency, 1);
  png_read_info(decoder.png, decoder.info);
  set_transformations(decoder);
  const int num_passes = png_set_interlace_handling(decoder.png);
  png_read_update_info(decoder.png, decoder.info);
  for (int pass = 0; pass < num_passes; ++pass) {
    for (decoder.y = 0; decoder.y < decoder.height; ++decoder.y) {
      if (decoder.y % 64 == 0) {
        if (decoder.run->cancelled()) {
          decoder.is_cancelled = true;
          return true;
        }
        decoder.run->report((pass + static_cast<double>(decoder.y) / decoder.height) / num_passes);
      }
      std::uint8_t* const row = decoder.rows + static_cast<std::size_t>(decoder.y) * decoder.stride;
      png_read_row(decoder.png, row, nullptr);
      if (decoder.take_row != nullptr && !decoder.take_row(decoder.target, row, decoder.y)) {
        return true;
      }
    }
  }
  png_read_end(decoder.png, nullptr);
  return true;
}

/// Owns the structures of libpng.
class Session {
 public:
  explicit Session(Decoder& decoder, const detail::PngFrame& frame) : decoder_(decoder) {
    decoder.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoder, jump_out, note_warning);
    if (decoder.png == nullptr) throw std::bad_alloc();
    decoder.info = png_create_info_struct(decoder.png);
    if (decoder.info == nullptr) {
      png_destroy_read_struct(&decoder.png, nullptr, nullptr);
      throw std::bad_alloc();
    }
    configure(frame);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  ~Session() { png_destroy_read_struct(&decoder_.png, &decoder_.info, nullptr); }

 private:
  void configure(const detail::PngFrame& frame) {
    png_structp png = decoder_.png;
    png_set_read_fn(png, &decoder_, read_bytes);
    png_set_user_limits(png, static_cast<png_uint_32>(frame.width),
                        static_cast<png_uint_32>(frame.height));
    // A limit for what is kept of a chunk, but libpng warns of long ones that are skipped, too.
    // Only palettes and transparent colours are kept, and their size is judged by the format.
    png_set_chunk_malloc_max(png, std::max<std::size_t>(decoder_.stream.size(), 1U << 20U));
    png_set_benign_errors(png, 1);
    // Checksums were compared when the chunks were walked over.
    png_set_crc_action(png, PNG_CRC_QUIET_USE, PNG_CRC_QUIET_USE);
  }

  Decoder& decoder_;
};

[[noreturn]] void fail_decoding(const Decoder& decoder, const std::string& name) {
  const std::string_view message = decoder.error.data();
  const auto holds = [&](std::string_view word) {
    return message.find(word) != std::string_view::npos;
  };
  if (holds("emory")) throw std::bad_alloc();
  const char* code = "E_SYNTAX";
  if (holds("filter")) {
    code = "E_FILTER";
  } else if (holds("Not enough") || holds("unexpected end")) {
    code = "E_TRUNCATED";
  } else if (holds("incorrect data check")) {
    code = "E_CRC";
  } else if (holds("chunk") || holds("IHDR") || holds("of place") || holds("palette")) {
    code = "E_HEADER";
  }
  throw IoError(Errc::malformed, code,
                "row " + std::to_string(decoder.y) + " of " + std::to_string(decoder.height) +
                    ": " + std::string(message),
                {name, 0, static_cast<std::int64_t>(decoder.taken)});
}

/// Colours of a palette picture, and the place of the first index without one.
struct Palette {
  std::array<std::uint8_t, 1024> rgba{};
  int size = 0;
  std::uint8_t* pixels = nullptr;
  int width = 0;
  int bad_x = -1;
  int bad_y = -1;
  int bad_index = 0;
};

bool resolve_row(void* target, const std::uint8_t* row, int y) {
  auto& palette = *static_cast<Palette*>(target);
  std::uint8_t* to = palette.pixels + std::size_t{4} * static_cast<std::size_t>(palette.width) *
                                          static_cast<std::size_t>(y);
  for (int x = 0; x < palette.width; ++x, to += 4) {
    const std::uint8_t index = row[x];
    if (index >= palette.size) {
      palette.bad_x = x;
      palette.bad_y = y;
      palette.bad_index = index;
      return false;
    }
    std::memcpy(to, palette.rgba.data() + std::size_t{4} * index, 4);
  }
  return true;
}

// libpng knows the palette only after png_read_info(), so the first row fills it.
struct PaletteRows {
  Decoder* decoder = nullptr;
  Palette palette;
};

void load_palette(PaletteRows& rows) {
  png_colorp colours = nullptr;
  png_bytep alpha = nullptr;
  int num_alpha = 0;
  Decoder& decoder = *rows.decoder;
  png_get_PLTE(decoder.png, decoder.info, &colours, &rows.palette.size);
  if (png_get_valid(decoder.png, decoder.info, PNG_INFO_tRNS) != 0) {
    png_get_tRNS(decoder.png, decoder.info, &alpha, &num_alpha, nullptr);
  }
  for (int i = 0; i < rows.palette.size; ++i) {
    std::uint8_t* const to = rows.palette.rgba.data() + 4 * i;
    to[0] = colours[i].red;
    to[1] = colours[i].green;
    to[2] = colours[i].blue;
    to[3] = i < num_alpha ? alpha[i] : 255;
  }
}

bool take_palette_row(void* target, const std::uint8_t* row, int y) {
  auto& rows = *static_cast<PaletteRows*>(target);
  if (y == 0) load_palette(rows);
  return resolve_row(&rows.palette, row, y);
}

void judge(const Decoder& decoder, bool is_done, const std::string& name, PngFile& file) {
  if (decoder.is_cancelled) decoder.run->throw_if_cancelled();
  if (!is_done || decoder.is_unfinished) fail_decoding(decoder, name);
  if (decoder.has_bad_sum) {
    throw IoError(Errc::malformed, "E_CRC", "the checksum of the pixels does not match",
                  {name, 0, static_cast<std::int64_t>(decoder.taken)});
  }
  if (decoder.has_extra_data) {
    file.warnings.add("W_TRAILING_DATA", "row " + std::to_string(decoder.height),
                      "packed data after the last row were ignored");
  }
  if (decoder.num_warnings > 0) {
    file.warnings.add("W_IMAGE_CHUNK", decoder.warning.data(), "damaged chunks were left out",
                      decoder.num_warnings);
  }
}

void read_palette_pixels(Decoder& decoder, const detail::PngFrame& frame, const std::string& name,
                         PngFile& file) {
  const auto width = static_cast<std::size_t>(frame.width);
  // The passes of an interlaced picture need all rows at once.
  const auto num_rows = frame.is_interlaced ? static_cast<std::size_t>(frame.height) : 1U;
  std::vector<std::uint8_t> indices(width * num_rows);
  PaletteRows rows;
  rows.decoder = &decoder;
  rows.palette.pixels = file.raster.rgba8.data();
  rows.palette.width = frame.width;
  decoder.rows = indices.data();
  decoder.stride = frame.is_interlaced ? width : 0;
  if (!frame.is_interlaced) {
    decoder.take_row = take_palette_row;
    decoder.target = &rows;
  }
  const Session session(decoder, frame);
  const bool is_done = decode(decoder);
  const auto require_colour = [&] {
    if (rows.palette.bad_x < 0) return;
    throw IoError(Errc::malformed, "E_PALETTE_INDEX",
                  "pixel (" + std::to_string(rows.palette.bad_x) + ", " +
                      std::to_string(rows.palette.bad_y) + ") has colour " +
                      std::to_string(rows.palette.bad_index) + " of a palette of " +
                      std::to_string(rows.palette.size),
                  {name, 0, -1});
  };
  require_colour();
  judge(decoder, is_done, name, file);
  if (!frame.is_interlaced) return;
  for (int y = 0; y < frame.height; ++y) {
    if (!take_palette_row(&rows, indices.data() + width * static_cast<std::size_t>(y), y)) break;
  }
  require_colour();
}

void read_pixels(Decoder& decoder, const detail::PngFrame& frame, const std::string& name,
                 PngFile& file) {
  const bool is_deep = file.raster.bit_depth == 16;
  decoder.rows = is_deep ? reinterpret_cast<std::uint8_t*>(file.raster.rgba16.data())
                         : file.raster.rgba8.data();
  decoder.stride =
      (is_deep ? std::size_t{8} : std::size_t{4}) * static_cast<std::size_t>(frame.width);
  const Session session(decoder, frame);
  const bool is_done = decode(decoder);
  judge(decoder, is_done, name, file);
}

}  // namespace

bool is_png(ByteSpan bytes) {
  return bytes.size() >= 4 && std::memcmp(bytes.data(), "\x89PNG", 4) == 0;
}

namespace {

PngFile parse(ByteSpan bytes, const FileBytes* mapped, const std::string& name,
              const ReadLimits& limits, const RunControl& run) {
  detail::PngFrame frame = detail::read_png_frame(bytes, name, limits);
  if (mapped != nullptr) mapped->release(0, bytes.size());
  run.throw_if_cancelled();
  PngFile file;
  file.raster = make_raster(frame.width, frame.height, frame.bits == 16 ? 16 : 8);
  file.raster.colour = std::move(frame.colour);
  file.warnings = std::move(frame.warnings);
  Decoder decoder;
  decoder.stream = bytes.first(frame.end);
  decoder.file = mapped;
  decoder.run = &run;
  decoder.height = frame.height;
  decoder.is_palette = frame.colour_type == 3;
  decoder.bit_depth = file.raster.bit_depth;
  if (decoder.is_palette) {
    read_palette_pixels(decoder, frame, name, file);
  } else {
    read_pixels(decoder, frame, name, file);
  }
  return file;
}

}  // namespace

PngFile parse_png(ByteSpan bytes, const std::string& name, const ReadLimits& limits,
                  const RunControl& run) {
  return parse(bytes, nullptr, name, limits, run);
}

PngFile parse_png(const FileBytes& file, const std::string& name, const ReadLimits& limits,
                  const RunControl& run) {
  return parse(file.bytes(), &file, name, limits, run);
}

PngFile read_png(const std::string& path, const ReadLimits& limits, RunControl run) {
  const FileBytes file = FileBytes::open(path, limits, run);
  return file.judge(path, [&] { return parse_png(file, path, limits, run); });
}

}  // namespace dupin
