#include "dupin/io/png.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "tests/support/badmesh.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::span<const std::uint8_t> span_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<char>(value >> shift & 255U));
  return bytes;
}

std::string chunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const auto sum =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return big_endian(static_cast<std::uint32_t>(data.size())) + body +
         big_endian(static_cast<std::uint32_t>(sum));
}

std::string packed(const std::string& raw) {
  std::string result(compressBound(raw.size()), '\0');
  auto size = static_cast<uLongf>(result.size());
  compress(reinterpret_cast<Bytef*>(result.data()), &size,
           reinterpret_cast<const Bytef*>(raw.data()), raw.size());
  result.resize(size);
  return result;
}

/// A picture in some format of PNG: samples as they are stored, channel after channel.
struct Stored {
  int width = 0;
  int height = 0;
  int bits = 8;
  int colour_type = 0;
  std::vector<std::uint32_t> samples;
  std::string chunks;  // between IHDR and IDAT

  int channels() const {
    return colour_type == 2 ? 3 : colour_type == 4 ? 2 : colour_type == 6 ? 4 : 1;
  }
  std::uint32_t at(int x, int y, int c) const {
    return samples[static_cast<std::size_t>((y * width + x) * channels() + c)];
  }
};

std::string packed_row(const Stored& s, int y, int x0, int dx) {
  std::string row(1, '\0');  // filter 0
  std::uint32_t bits = 0;
  int count = 0;
  for (int x = x0; x < s.width; x += dx) {
    for (int c = 0; c < s.channels(); ++c) {
      if (s.bits == 16) {
        row.push_back(static_cast<char>(s.at(x, y, c) >> 8U));
        row.push_back(static_cast<char>(s.at(x, y, c) & 255U));
        continue;
      }
      bits = bits << static_cast<unsigned>(s.bits) | s.at(x, y, c);
      count += s.bits;
      if (count == 8) {
        row.push_back(static_cast<char>(bits & 255U));
        count = 0;
      }
    }
  }
  if (count > 0) row.push_back(static_cast<char>(bits << static_cast<unsigned>(8 - count) & 255U));
  return row;
}

std::string encoded(const Stored& s, bool is_interlaced) {
  std::string raw;
  if (is_interlaced) {
    constexpr int kPasses[7][4] = {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                   {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
    for (const auto& [x0, y0, dx, dy] : kPasses) {
      if (x0 >= s.width) continue;
      for (int y = y0; y < s.height; y += dy) raw += packed_row(s, y, x0, dx);
    }
  } else {
    for (int y = 0; y < s.height; ++y) raw += packed_row(s, y, 0, 1);
  }
  const std::string header =
      big_endian(static_cast<std::uint32_t>(s.width)) +
      big_endian(static_cast<std::uint32_t>(s.height)) +
      std::string{static_cast<char>(s.bits), static_cast<char>(s.colour_type), 0, 0,
                  static_cast<char>(is_interlaced)};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + s.chunks + chunk("IDAT", packed(raw)) +
         chunk("IEND", "");
}

// The definition of the format, pixel by pixel.
std::array<std::uint32_t, 4> colour_of(const Stored& s, int x, int y, std::uint32_t key,
                                       const std::vector<std::array<std::uint8_t, 4>>& palette) {
  const std::uint32_t full = s.bits == 16 ? 65535 : 255;
  const auto spread = [&](std::uint32_t v) {
    return s.bits < 8 ? v * 255 / ((1U << s.bits) - 1) : v;
  };
  if (s.colour_type == 3) {
    const auto& p = palette[s.at(x, y, 0)];
    return {p[0], p[1], p[2], p[3]};
  }
  const std::uint32_t first = spread(s.at(x, y, 0));
  if (s.colour_type == 0) return {first, first, first, s.at(x, y, 0) == key ? 0 : full};
  if (s.colour_type == 4) return {first, first, first, s.at(x, y, 1)};
  const std::uint32_t g = s.at(x, y, 1);
  const std::uint32_t b = s.at(x, y, 2);
  if (s.colour_type == 6) return {first, g, b, s.at(x, y, 3)};
  return {first, g, b, first == key && g == key && b == key ? 0 : full};
}

// Every colour type at every depth, interlaced and not, with and without a transparent colour.
TEST(Png, EveryKindOfPictureIsReadAsTheFormatDefinesIt) {
  const std::vector<std::pair<int, int>> kinds = {{0, 1}, {0, 2},  {0, 4},  {0, 8}, {0, 16},
                                                  {2, 8}, {2, 16}, {3, 1},  {3, 2}, {3, 4},
                                                  {3, 8}, {4, 8},  {4, 16}, {6, 8}, {6, 16}};
  Rng random(1);
  int num_checked = 0;
  for (const auto& [type, bits] : kinds) {
    for (const bool has_key : {false, true}) {
      for (const auto& [width, height] : {std::pair{1, 1}, {5, 3}, {13, 19}, {33, 8}}) {
        SCOPED_TRACE(std::to_string(type) + "/" + std::to_string(bits) + " " +
                     std::to_string(width));
        Stored s{width, height, bits, type, {}, {}};
        const int count = width * height * s.channels();
        for (int i = 0; i < count; ++i) {
          // Few values, so that the key is met.
          const std::uint64_t range = std::uint64_t{1} << bits;
          s.samples.push_back(static_cast<std::uint32_t>(
              bits == 16 ? 257 * random.below(3)
                         : random.below(std::min<std::uint64_t>(range, 9))));
        }
        std::vector<std::array<std::uint8_t, 4>> palette;
        const std::uint32_t key = has_key && type != 3 && type < 4 ? s.samples[0] : 0xFFFFFFFF;
        const std::string key16{static_cast<char>(key >> 8U & 255U), static_cast<char>(key & 255U)};
        if (type == 3) {
          std::string rgb;
          std::string alpha;
          for (std::size_t i = 0; i < std::min<std::size_t>(9, std::size_t{1} << bits); ++i) {
            palette.push_back({static_cast<std::uint8_t>(random.below(256)),
                               static_cast<std::uint8_t>(i), 77,
                               static_cast<std::uint8_t>(has_key && i < 2 ? 100 * i : 255)});
            for (std::size_t k = 0; k < 3; ++k) rgb.push_back(static_cast<char>(palette[i][k]));
            if (i < 2) alpha.push_back(static_cast<char>(palette[i][3]));
          }
          s.chunks = chunk("PLTE", rgb) + (has_key ? chunk("tRNS", alpha) : "");
        } else if (key != 0xFFFFFFFF) {
          s.chunks = chunk("tRNS", type == 0 ? key16 : key16 + key16 + key16);
        }
        for (const bool is_interlaced : {false, true}) {
          const std::string bytes = encoded(s, is_interlaced);
          const PngFile file = parse_png(span_of(bytes), "made.png");
          ASSERT_EQ(file.raster.bit_depth, bits == 16 ? 16 : 8);
          ASSERT_EQ(file.raster.width, width);
          EXPECT_TRUE(file.warnings.empty());
          for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
              const auto expected = colour_of(s, x, y, key, palette);
              for (std::size_t k = 0; k < 4; ++k) {
                const std::size_t at = 4 * static_cast<std::size_t>(y * width + x) + k;
                ASSERT_EQ(bits == 16 ? file.raster.rgba16[at] : file.raster.rgba8[at], expected[k]);
              }
            }
          }
          ++num_checked;
        }
      }
    }
  }
  EXPECT_EQ(num_checked, 15 * 2 * 4 * 2);
}

Raster noise(int width, int height, int bit_depth, bool is_opaque) {
  Raster raster = make_raster(width, height, bit_depth);
  Rng random(2);
  for (std::uint8_t& v : raster.rgba8) v = static_cast<std::uint8_t>(random.below(256));
  for (std::uint16_t& v : raster.rgba16) v = static_cast<std::uint16_t>(random.below(65536));
  for (std::size_t i = 3; is_opaque && i < raster.rgba8.size(); i += 4) raster.rgba8[i] = 255;
  for (std::size_t i = 3; is_opaque && i < raster.rgba16.size(); i += 4) raster.rgba16[i] = 65535;
  return raster;
}

std::vector<std::uint8_t> small_profile() {
  std::vector<std::uint8_t> icc(200, 7);
  const std::string size = big_endian(200);
  std::copy(size.begin(), size.end(), icc.begin());
  const std::string space = "RGB ";
  std::copy(space.begin(), space.end(), icc.begin() + 16);
  const std::string magic = "acsp";
  std::copy(magic.begin(), magic.end(), icc.begin() + 36);
  return icc;
}

// parse(write(r)) = r: pixels and all that is said of colours; and equal pictures give equal bytes.
TEST(Png, ReadingGivesBackWhatWasWritten) {
  for (const int depth : {8, 16}) {
    for (const bool is_opaque : {false, true}) {
      Raster raster = noise(37, 11, depth, is_opaque);
      raster.colour.icc = small_profile();
      raster.colour.icc_name = "a profile";
      raster.colour.gamma = 45455;
      raster.colour.chromaticities = {31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000};
      const std::string bytes = format_png(raster);
      EXPECT_EQ(bytes, format_png(raster));
      const PngFile file = parse_png(span_of(bytes), "written.png");
      EXPECT_EQ(file.raster.rgba8, raster.rgba8);
      EXPECT_EQ(file.raster.rgba16, raster.rgba16);
      EXPECT_EQ(file.raster.colour.icc, raster.colour.icc);
      EXPECT_EQ(file.raster.colour.icc_name, "a profile");
      EXPECT_EQ(file.raster.colour.gamma, raster.colour.gamma);
      EXPECT_EQ(file.raster.colour.chromaticities, raster.colour.chromaticities);
      EXPECT_FALSE(file.raster.colour.srgb_intent.has_value());
      EXPECT_TRUE(file.warnings.empty());
    }
  }
}

TEST(Png, AnImageIsMarkedAsSrgb) {
  const std::string bytes = format_png(make_image(3, 2, 1, 2, 3, 4));
  const PngFile file = parse_png(span_of(bytes), "image.png");
  EXPECT_EQ(file.raster.colour.srgb_intent, 0);
  EXPECT_EQ(file.raster.rgba8[3], 4);
}

std::string code_of(std::span<const std::uint8_t> bytes, const ReadLimits& limits = {}) {
  try {
    parse_png(bytes, "x.png", limits);
  } catch (const Error& error) {
    return error.code();
  }
  return {};
}

// No prefix of a picture is half a picture: it is refused, unless only the end mark is missing.
TEST(Png, EveryPrefixIsRefusedOrWhole) {
  const Raster raster = noise(16, 16, 8, false);
  const std::string bytes = format_png(raster);
  int num_whole = 0;
  for (std::size_t size = 1; size < bytes.size(); ++size) {
    const auto part = span_of(bytes).first(size);
    const std::string code = code_of(part);
    if (code.empty()) {
      EXPECT_EQ(parse_png(part, "x.png").raster.rgba8, raster.rgba8);
      EXPECT_TRUE(parse_png(part, "x.png").warnings.contains("W_TRUNCATED_END"));
      ++num_whole;
    } else {
      EXPECT_EQ(code, "E_TRUNCATED") << size;
    }
  }
  EXPECT_EQ(num_whole, 12);  // cut before or within the 12 bytes of IEND
}

// Checksums cover everything behind the signature, so no flipped bit goes unseen.
TEST(Png, EveryFlippedBitIsSeen) {
  std::string bytes = format_png(noise(4, 4, 8, false));
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      bytes[i] = static_cast<char>(bytes[i] ^ (1 << bit));
      bool is_seen = !code_of(span_of(bytes)).empty();
      if (!is_seen) is_seen = !parse_png(span_of(bytes), "x.png").warnings.empty();
      EXPECT_TRUE(is_seen) << i;
      bytes[i] = static_cast<char>(bytes[i] ^ (1 << bit));
    }
  }
}

TEST(Png, LimitsAreJudgedBeforeAnyPixel) {
  const auto header = [](std::uint32_t width, std::uint32_t height) {
    return "\x89PNG\r\n\x1a\n" +
           chunk("IHDR", big_endian(width) + big_endian(height) + std::string{8, 6, 0, 0, 0});
  };
  try {
    parse_png(span_of(header(65535, 65535)), "big.png");
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(error.errc(), Errc::over_limit);
    EXPECT_EQ(error.diagnostic(),
              "big.png@0x10: E_IMAGE_TOO_LARGE: 65535×65535 = 4294 Mpx, limit 64");
  }
  EXPECT_EQ(code_of(span_of(header(40000, 10))), "E_IMAGE_TOO_LARGE");
  ReadLimits limits;
  limits.max_image_pixels = 99;
  EXPECT_EQ(code_of(span_of(header(10, 10)), limits), "E_IMAGE_TOO_LARGE");
  // 60 Mpx from ten bytes: refused before 240 MB are taken.
  EXPECT_EQ(code_of(span_of(header(7500, 8000) + chunk("IDAT", "0123456789") + chunk("IEND", ""))),
            "E_TRUNCATED");
}

TEST(Png, AProfileBombIsRefused) {
  Stored s{1, 1, 8, 0, {5}, {}};
  s.chunks = chunk("iCCP", std::string("p\0\0", 3) + packed(std::string(20'000'000, 'a')));
  EXPECT_EQ(code_of(span_of(encoded(s, false))), "E_EXPANSION");
}

// Text is not unpacked, and no chunk beside the pixels is held in memory: descriptions of any
// length and bombs in them do not keep a picture from being read.
TEST(Png, LongTextsAreSkipped) {
  Stored s{1, 1, 8, 0, {5}, {}};
  const std::string many(3'000'000, 'a');
  s.chunks = chunk("iTXt", std::string("XML\0\0\0\0\0", 8) + many) +
             chunk("tEXt", std::string("k\0", 2) + many) + chunk("eXIf", many) +
             chunk("prVt", many) +
             chunk("zTXt", std::string("k\0\0", 3) + packed(std::string(20'000'000, 'a')));
  const PngFile file = parse_png(span_of(encoded(s, false)), "x.png");
  EXPECT_EQ(file.raster.rgba8, (std::vector<std::uint8_t>{5, 5, 5, 255}));
  EXPECT_TRUE(file.warnings.empty());
}

// A mapped file is let go while it is read; the picture is that of its bytes.
TEST(Png, AMappedFileGivesTheSamePicture) {
  test::TemporaryFolder folder;
  const Raster raster = noise(1100, 1100, 16, false);
  const std::string path = folder / "large.png";
  write_png(path, raster);
  EXPECT_EQ(read_png(path).raster.rgba16, raster.rgba16);
}

TEST(Png, ADamagedProfileIsLeftOutAndSaid) {
  Stored s{1, 1, 8, 0, {5}, {}};
  s.chunks = chunk("iCCP", std::string("p\0\0", 3) + packed("short"));
  const std::string bytes = encoded(s, false);
  const PngFile file = parse_png(span_of(bytes), "x.png");
  EXPECT_TRUE(file.raster.colour.icc.empty());
  EXPECT_TRUE(file.warnings.contains("W_COLOUR_PROFILE"));
}

TEST(Png, CancelledReadsAreInterrupted) {
  const std::string bytes = format_png(noise(8, 8, 8, false));
  const RunControl run = RunControl::create();
  run.cancel();
  try {
    parse_png(span_of(bytes), "x.png", {}, run);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.errc(), Errc::interrupted);
  }
}

// The pictures of the corpus of bad files: what the reader decides, it decides as the manifest
// says.
TEST(Png, TheCorpusIsAnsweredAsTheManifestSays) {
  test::TemporaryFolder folder;
  const std::vector<test::BadMesh> corpus = test::generate_badmesh(folder.path());
  if (corpus.empty()) GTEST_SKIP() << "the generator of bad files is not on this machine";
  int num_pictures = 0;
  for (const test::BadMesh& bad : corpus) {
    if (bad.format != "png") continue;
    SCOPED_TRACE(bad.file);
    ++num_pictures;
    const bool is_refused = bad.exit_code == 4 || bad.exit_code == 6;
    try {
      const PngFile file = read_png(bad.file);
      EXPECT_FALSE(is_refused);
      EXPECT_EQ(file.raster.width, 64);
    } catch (const IoError& error) {
      EXPECT_TRUE(is_refused);
      EXPECT_EQ(error.code(), bad.codes.at(0));
      EXPECT_EQ(static_cast<int>(error.errc()), bad.exit_code);
    }
  }
  EXPECT_GE(num_pictures, 28);
}

}  // namespace
}  // namespace dupin
