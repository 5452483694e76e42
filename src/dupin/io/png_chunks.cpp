#include "dupin/io/png_chunks.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/byte_loads.h"
#include "dupin/io/sniff.h"

namespace dupin::detail {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";
constexpr std::size_t kChunkFrame = 12;  // length, type, checksum
constexpr std::int64_t kMaxSide = 32768;
constexpr std::size_t kMaxProfileBytes = std::size_t{1} << 24;
// No deflate stream unpacks to more than 1032 times its length.
constexpr std::int64_t kMaxDeflateRatio = 1032;

std::uint32_t load_u32(const std::uint8_t* at) {
  return load<std::uint32_t, std::endian::native == std::endian::little>(at);
}

[[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                       const std::string& name, std::size_t byte, const std::string& hint = {}) {
  throw IoError(errc, code, message, Location{name, 0, static_cast<std::int64_t>(byte)}, hint);
}

bool is_legal_depth(int colour_type, int bits) {
  switch (colour_type) {
    case 0:
      return bits == 1 || bits == 2 || bits == 4 || bits == 8 || bits == 16;
    case 3:
      return bits == 1 || bits == 2 || bits == 4 || bits == 8;
    case 2:
    case 4:
    case 6:
      return bits == 8 || bits == 16;
    default:
      return false;
  }
}

int num_channels(int colour_type) {
  if (colour_type == 2) return 3;
  if (colour_type == 4) return 2;
  return colour_type == 6 ? 4 : 1;
}

// The profile of an iCCP chunk, or an empty one if it is damaged or not of RGB data.
std::vector<std::uint8_t> unpack_profile(ByteSpan packed, const std::string& name,
                                         std::size_t byte) {
  std::vector<std::uint8_t> profile(std::min(kMaxProfileBytes, packed.size() * 16 + 4096));
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
  // zlib reads only, but its interface is older than const.
  stream.next_in = const_cast<Bytef*>(packed.data());  // NOLINT
  stream.avail_in = static_cast<uInt>(packed.size());
  std::size_t size = 0;
  int result = Z_OK;
  while (result == Z_OK) {
    if (size == profile.size()) {
      if (size == kMaxProfileBytes) break;
      profile.resize(std::min(kMaxProfileBytes, 2 * size));
    }
    stream.next_out = profile.data() + size;
    stream.avail_out = static_cast<uInt>(profile.size() - size);
    result = inflate(&stream, Z_NO_FLUSH);
    size = profile.size() - stream.avail_out;
  }
  inflateEnd(&stream);
  if (result == Z_MEM_ERROR) throw std::bad_alloc();
  if (result == Z_OK) {
    fail(Errc::over_limit, "E_EXPANSION",
         "the colour profile unpacks to more than " + std::to_string(kMaxProfileBytes) + " bytes",
         name, byte);
  }
  profile.resize(size);
  const bool is_rgb_profile = result == Z_STREAM_END && size >= 132 &&
                              load_u32(profile.data()) == size &&
                              std::memcmp(profile.data() + 36, "acsp", 4) == 0 &&
                              std::memcmp(profile.data() + 16, "RGB ", 4) == 0;
  if (!is_rgb_profile) profile.clear();
  return profile;
}

class FrameReader {
 public:
  FrameReader(ByteSpan bytes, const std::string& name, const ReadLimits& limits)
      : bytes_(bytes), name_(name), limits_(limits) {}

  PngFrame read();

 private:
  void read_header(ByteSpan data);
  void read_palette(ByteSpan data);
  void read_colour(std::string_view type, ByteSpan data);
  void read_profile(ByteSpan data);
  void note_end(std::size_t at);
  void require_room_for_pixels() const;

  ByteSpan bytes_;
  const std::string& name_;
  const ReadLimits& limits_;
  PngFrame frame_;
  bool has_palette_ = false;
  std::int64_t image_bytes_ = 0;  // in IDAT chunks
};

void FrameReader::read_header(ByteSpan data) {
  const std::size_t at = kSignature.size() + 8;
  if (data.size() != 13) fail(Errc::malformed, "E_HEADER", "IHDR has not 13 bytes", name_, at);
  const std::int64_t width = load_u32(data.data());
  const std::int64_t height = load_u32(data.data() + 4);
  const std::string size = std::to_string(width) + "×" + std::to_string(height);
  if (width == 0 || height == 0 || width > 0x7FFFFFFF || height > 0x7FFFFFFF) {
    fail(Errc::malformed, "E_HEADER", "a picture of " + size + " pixels", name_, at);
  }
  frame_.bits = data[8];
  frame_.colour_type = data[9];
  if (!is_legal_depth(frame_.colour_type, frame_.bits) || data[10] != 0 || data[11] != 0 ||
      data[12] > 1) {
    fail(Errc::malformed, "E_HEADER",
         "colour type " + std::to_string(data[9]) + " of " + std::to_string(data[8]) +
             " bits, compression " + std::to_string(data[10]) + ", filter " +
             std::to_string(data[11]) + ", interlace " + std::to_string(data[12]) +
             " is no PNG header",
         name_, at + 8);
  }
  frame_.is_interlaced = data[12] == 1;
  const std::int64_t pixels = width * height;  // below 2^62
  if (pixels > limits_.max_image_pixels) {
    const bool in_millions = limits_.max_image_pixels % 1'000'000 == 0;
    const std::string judged =
        in_millions
            ? std::to_string(pixels / 1'000'000) + " Mpx, limit " +
                  std::to_string(limits_.max_image_pixels / 1'000'000)
            : std::to_string(pixels) + " px, limit " + std::to_string(limits_.max_image_pixels);
    fail(Errc::over_limit, "E_IMAGE_TOO_LARGE", size + " = " + judged, name_, at,
         "--max-image-pixels raises the limit");
  }
  if (std::max(width, height) > kMaxSide) {
    fail(Errc::over_limit, "E_IMAGE_TOO_LARGE",
         size + ": a side is over the limit of " + std::to_string(kMaxSide), name_, at);
  }
  frame_.width = static_cast<int>(width);
  frame_.height = static_cast<int>(height);
}

void FrameReader::read_palette(ByteSpan data) {
  const std::size_t at = static_cast<std::size_t>(data.data() - bytes_.data());
  has_palette_ = true;
  if (frame_.colour_type != 3) return;  // a suggestion of colours: nothing depends on it
  if (data.empty() || data.size() % 3 != 0 || data.size() > (std::size_t{3} << frame_.bits)) {
    fail(Errc::malformed, "E_HEADER",
         "a palette of " + std::to_string(data.size()) + " bytes for " +
             std::to_string(frame_.bits) + " bits",
         name_, at);
  }
}

void FrameReader::read_profile(ByteSpan data) {
  std::size_t name_size = 0;
  while (name_size < data.size() && data[name_size] != 0) ++name_size;
  const std::size_t at = static_cast<std::size_t>(data.data() - bytes_.data());
  if (name_size >= 1 && name_size <= 79 && name_size + 2 < data.size() &&
      data[name_size + 1] == 0) {
    frame_.colour.icc = unpack_profile(data.subspan(name_size + 2), name_, at);
    frame_.colour.icc_name.assign(reinterpret_cast<const char*>(data.data()), name_size);
  }
  if (frame_.colour.icc.empty()) {
    frame_.colour.icc_name.clear();
    frame_.warnings.add("W_COLOUR_PROFILE", "byte " + std::to_string(at),
                        "the colour profile is damaged or not of RGB data; it was left out");
  }
}

void FrameReader::read_colour(std::string_view type, ByteSpan data) {
  if (type == "iCCP" && frame_.colour.icc.empty()) {
    read_profile(data);
  } else if (type == "sRGB" && data.size() == 1 && data[0] <= 3) {
    frame_.colour.srgb_intent = data[0];
  } else if (type == "gAMA" && data.size() == 4 && load_u32(data.data()) <= 0x7FFFFFFF) {
    frame_.colour.gamma = load_u32(data.data());
  } else if (type == "cHRM" && data.size() == 32) {
    std::array<std::uint32_t, 8> values{};
    for (std::size_t i = 0; i < 8; ++i) values[i] = load_u32(data.data() + 4 * i);
    frame_.colour.chromaticities = values;
  }
}

// The file ends here without IEND. The picture may be whole all the same: its rows will tell.
void FrameReader::note_end(std::size_t at) {
  if (image_bytes_ == 0) {
    fail(Errc::malformed, "E_TRUNCATED", "the file ends before the picture", name_, bytes_.size());
  }
  frame_.end = at;
  frame_.warnings.add("W_TRUNCATED_END", "byte " + std::to_string(at),
                      "the file ends without IEND");
}

// Memory is taken for pixels only if so many can come out of the packed bytes.
void FrameReader::require_room_for_pixels() const {
  const std::int64_t row_bits =
      std::int64_t{frame_.width} * num_channels(frame_.colour_type) * frame_.bits;
  const std::int64_t unpacked = frame_.height * ((row_bits + 7) / 8 + 1);
  if (unpacked > kMaxDeflateRatio * image_bytes_ + kMaxDeflateRatio) {
    fail(Errc::malformed, "E_TRUNCATED",
         std::to_string(image_bytes_) + " packed bytes cannot hold " +
             std::to_string(frame_.width) + "×" + std::to_string(frame_.height) + " pixels",
         name_, bytes_.size());
  }
}

PngFrame FrameReader::read() {
  const std::size_t head = std::min(bytes_.size(), kSignature.size());
  if (std::memcmp(bytes_.data(), kSignature.data(), head) != 0) {
    const std::string foreign = foreign_format(bytes_);
    fail(Errc::malformed, "E_MAGIC",
         foreign.empty() ? "not a PNG image" : "not a PNG image: looks like " + foreign, name_, 0);
  }
  std::size_t at = kSignature.size();
  bool is_first = true;
  while (!frame_.has_end) {
    const std::size_t left = at < bytes_.size() ? bytes_.size() - at : 0;
    const std::string_view type =
        left >= 8 ? std::string_view(reinterpret_cast<const char*>(bytes_.data() + at + 4), 4) : "";
    const std::size_t length = left >= 8 ? load_u32(bytes_.data() + at) : 0;
    if (left < kChunkFrame || length > left - kChunkFrame) {
      if (image_bytes_ > 0 && type != "IDAT") {
        note_end(at);
        break;
      }
      fail(Errc::malformed, "E_TRUNCATED",
           left < 8 ? "the file ends before a chunk"
                    : "chunk " + std::string(type) + " claims " + std::to_string(length) +
                          " bytes, " + std::to_string(left - 8) + " follow",
           name_, bytes_.size());
    }
    const ByteSpan data = bytes_.subspan(at + 8, length);
    const auto sum =
        crc32(crc32(0, nullptr, 0), bytes_.data() + at + 4, static_cast<uInt>(length + 4));
    if (sum != load_u32(data.data() + length)) {
      fail(Errc::malformed, "E_CRC",
           "the checksum of chunk " + std::string(type) + " does not match", name_, at);
    }
    if (is_first != (type == "IHDR")) {
      fail(Errc::malformed, "E_HEADER",
           "chunk " + std::string(type) + " where IHDR is expected once", name_, at + 4);
    }
    if (is_first) {
      read_header(data);
    } else if (type == "PLTE") {
      read_palette(data);
    } else if (type == "IDAT") {
      if (frame_.colour_type == 3 && !has_palette_) {
        fail(Errc::malformed, "E_HEADER", "a palette picture without a palette", name_, at + 4);
      }
      image_bytes_ += static_cast<std::int64_t>(length);
    } else if (type == "IEND") {
      frame_.has_end = true;
    } else {
      read_colour(type, data);
    }
    is_first = false;
    at += kChunkFrame + length;
    frame_.end = at;
  }
  if (image_bytes_ == 0) fail(Errc::malformed, "E_TRUNCATED", "no IDAT chunk", name_, frame_.end);
  require_room_for_pixels();
  if (frame_.has_end && frame_.end < bytes_.size()) {
    frame_.warnings.add(
        "W_TRAILING_DATA", "byte " + std::to_string(frame_.end),
        std::to_string(bytes_.size() - frame_.end) + " bytes after IEND were ignored");
  }
  return std::move(frame_);
}

}  // namespace

PngFrame read_png_frame(ByteSpan bytes, const std::string& name, const ReadLimits& limits) {
  if (bytes.empty()) throw IoError(Errc::malformed, "E_EMPTY", "the file is empty", {name, 0, -1});
  return FrameReader(bytes, name, limits).read();
}

}  // namespace dupin::detail
