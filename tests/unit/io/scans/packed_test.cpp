#include <gtest/gtest.h>
#include <png.h>
#include <zlib.h>

#include <bit>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <vector>

#include "dupin/io/formats.h"
#include "dupin/io/npy_format.h"
#include "dupin/io/npz.h"
#include "dupin/io/png.h"
#include "tests/unit/io/scans/scan_files.h"

namespace dupin {
namespace {

using detail::ByteSpan;

std::string gzipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&stream, text.size()) + 64, '\0');
  std::string copy = text;
  stream.next_in = reinterpret_cast<Bytef*>(copy.data());
  stream.avail_in = static_cast<uInt>(copy.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string gunzipped(const std::string& packed, const ReadLimits& limits = {}) {
  const std::vector<std::uint8_t> bytes = detail::gunzip(test::as_bytes(packed), "a.gz", limits);
  return std::string(bytes.begin(), bytes.end());
}

std::string gunzip_code(const std::string& packed, const ReadLimits& limits = {}) {
  try {
    gunzipped(packed, limits);
  } catch (const IoError& error) {
    return error.code();
  }
  return {};
}

std::string noise(std::size_t size) {
  Rng rng(3);
  std::string text(size, '\0');
  for (char& c : text) c = static_cast<char>(rng.below(256));
  return text;
}

// gunzip(gzip(t)) = t, and the join of two files is the join of their texts.
TEST(Gunzip, InvertsGzip) {
  for (const std::size_t size : {0U, 1U, 1000U, 3000000U}) {
    const std::string text = noise(size);
    EXPECT_EQ(gunzipped(gzipped(text)), text);
  }
  EXPECT_EQ(gunzipped(gzipped("abc") + gzipped("") + gzipped("def")), "abcdef");
}

// 64 MiB of zeros pack a thousandfold: refused by ratio, by size, and allowed when both allow it.
TEST(Gunzip, StopsAtTheLimitsOfExpansion) {
  const std::string packed = gzipped(std::string(std::size_t{64} << 20, '\0'));
  ASSERT_LT(packed.size(), std::size_t{100} << 10);
  EXPECT_EQ(gunzip_code(packed), "E_EXPANSION");
  ReadLimits limits;
  limits.max_expansion_ratio = 2000;
  EXPECT_EQ(gunzip_code(packed, limits), "");
  limits.max_expanded_bytes = std::int64_t{63} << 20;
  EXPECT_EQ(gunzip_code(packed, limits), "E_EXPANSION");
  // Up to 1 MiB any ratio will do: small files are no bombs.
  EXPECT_EQ(gunzip_code(gzipped(std::string(std::size_t{1} << 20, '\0'))), "");
}

TEST(Gunzip, NamesTruncationAndDamage) {
  const std::string packed = gzipped("some text, some text, some more text");
  for (std::size_t size = 0; size < packed.size(); ++size) {
    EXPECT_EQ(gunzip_code(packed.substr(0, size)), "E_TRUNCATED") << size;
  }
  std::string damaged = packed;
  damaged[packed.size() - 8] = static_cast<char>(damaged[packed.size() - 8] ^ 1);
  EXPECT_EQ(gunzip_code(damaged), "E_CRC");
  EXPECT_EQ(gunzip_code("not gzip"), "E_MAGIC");
  EXPECT_EQ(gunzip_code(packed + "junk"), "E_MAGIC");
}

NpyArray matrix(bool as_float32) {
  NpyArray array;
  array.name = "F";
  array.shape = {2, 3};
  array.values.resize(2, 3);
  array.values << 1.0, -2.5, 0.1, 1e-3, 4096.0, -0.0;
  array.as_float32 = as_float32;
  return array;
}

NpyArray vector_of(Eigen::Index size) {
  NpyArray array;
  array.name = "tau";
  array.shape = {size};
  array.values = RowMatrixXd::Constant(size, 1, 0.3);
  return array;
}

// parse(format(a)) = a: bit for bit in double, rounded once in single precision.
TEST(Npy, ReadsBackWhatItWrites) {
  for (const bool as_float32 : {false, true}) {
    const NpyArray array = matrix(as_float32);
    const std::string bytes = detail::format_npy(array);
    EXPECT_EQ((bytes.size() - (as_float32 ? 24 : 48)) % 64, 0U);
    const NpyArray back = detail::parse_npy(test::as_bytes(bytes), "a.npy", {});
    EXPECT_EQ(back.shape, array.shape);
    EXPECT_EQ(back.as_float32, as_float32);
    const RowMatrixXd expected =
        as_float32 ? RowMatrixXd(array.values.cast<float>().cast<double>()) : array.values;
    EXPECT_EQ(back.values, expected);
  }
  const NpyArray line = vector_of(7);
  EXPECT_EQ(detail::parse_npy(test::as_bytes(detail::format_npy(line)), "a.npy", {}).shape,
            line.shape);
}

// Any shape, NaN kept: the bytes after the header are those of the floats.
TEST(Npy, SinglePrecisionOfAnyShapeKeepsNaN) {
  const std::vector<float> values = {
      1.5F, std::numeric_limits<float>::quiet_NaN(), -0.1F, 0.0F, 3e38F, 1e-45F};
  const std::string bytes = detail::format_npy({1, 3, 2}, values);
  EXPECT_NE(bytes.find("'<f4', 'fortran_order': False, 'shape': (1, 3, 2), }"), std::string::npos);
  ASSERT_EQ(bytes.size() % 64, 24U);
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 4; ++k)
      bits |= std::uint32_t{static_cast<unsigned char>(bytes[bytes.size() - 24 + 4 * i + k])}
              << (8 * k);
    EXPECT_EQ(bits, std::bit_cast<std::uint32_t>(values[i]));
  }
  EXPECT_EQ(detail::format_npy({6}, std::vector<float>(6, 0.25F)), detail::format_npy([] {
              NpyArray array;
              array.shape = {6};
              array.values = RowMatrixXd::Constant(6, 1, 0.25);
              array.as_float32 = true;
              return array;
            }()));
  EXPECT_THROW(detail::format_npy({2, 2}, values), InvalidArgument);
}

std::string npy_code(const std::string& bytes) {
  try {
    detail::parse_npy(test::as_bytes(bytes), "a.npy", {});
  } catch (const IoError& error) {
    return error.code();
  }
  return {};
}

std::string npy_of(const std::string& header, const std::string& data) {
  std::string bytes("\x93NUMPY\1\0", 8);
  test::append_bits(bytes, header.size(), 2);
  return bytes + header + data;
}

// Integers and Fortran order mean the same numbers.
TEST(Npy, ReadsIntegersAndFortranOrder) {
  const std::string head = "{'descr': '<i2', 'fortran_order': True, 'shape': (2, 2), }";
  const std::string data("\x01\x00\xFE\xFF\x03\x00\x04\x00", 8);
  const NpyArray array = detail::parse_npy(test::as_bytes(npy_of(head, data)), "a.npy", {});
  const RowMatrixXd expected = (RowMatrixXd(2, 2) << 1, 3, -2, 4).finished();
  EXPECT_EQ(array.values, expected);
}

TEST(Npy, NamesWhatIsWrong) {
  const std::string whole = detail::format_npy(matrix(false));
  for (std::size_t size = 1; size < whole.size(); ++size) {
    EXPECT_EQ(npy_code(whole.substr(0, size)), "E_TRUNCATED") << size;
  }
  EXPECT_EQ(npy_code("PK"), "E_MAGIC");
  EXPECT_EQ(npy_code(whole + "x"), "E_SYNTAX");
  const auto code = [](const std::string& type, const std::string& shape) {
    return npy_code(npy_of(
        "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + shape + "), }", "1234"));
  };
  EXPECT_EQ(code("<f4", "1,"), "");
  EXPECT_EQ(code(">f4", "1,"), "E_HEADER");
  EXPECT_EQ(code("<c8", "1,"), "E_HEADER");
  EXPECT_EQ(code("<f4", "1, 1, 1"), "E_HEADER");
  EXPECT_EQ(code("<f4", ""), "E_HEADER");
  EXPECT_EQ(code("<f4", "-1,"), "E_NUMBER_RANGE");
  EXPECT_EQ(code("<f4", "4000000000, 4000000000"), "E_COUNT_EXCEEDS_FILE");
  EXPECT_EQ(npy_code(npy_of("{'descr': '<f4', 'fortran_order': False, 'shape': (1,), }",
                            std::string("\x01\x00\xA0\x7F", 4))),
            "E_NONFINITE");  // a signalling NaN
  NpyArray bad = matrix(false);
  bad.shape = {3, 2};
  EXPECT_THROW(detail::format_npy(bad), InvalidArgument);
}

class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_(::testing::TempDir() + "dupin-packed-" + name) {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() { std::remove(path_.c_str()); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// NumPy itself must agree, with and without the records of zip64.
TEST(Npz, IsReadByNumPy) {
  const std::string python = "/usr/bin/python3";
  if (std::system((python + " -c 'import numpy' 2>/dev/null").c_str()) != 0) {  // NOLINT
    GTEST_SKIP() << "NumPy is not on this machine";
  }
  const std::vector<NpyArray> arrays = {matrix(false), vector_of(5)};
  for (const std::uint64_t zip64_from : {std::uint64_t{0xFFFFFFFF}, std::uint64_t{1}}) {
    const TemporaryFile file("arrays.npz");
    std::ofstream(file.path(), std::ios::binary) << detail::format_npz(arrays, zip64_from);
    const std::string check =
        "import numpy, zipfile, sys; p = sys.argv[1]; "
        "assert zipfile.ZipFile(p).testzip() is None; d = numpy.load(p); "
        "assert sorted(d.files) == ['F', 'tau'], d.files; "
        "assert d['F'].shape == (2, 3) and d['F'].dtype == '<f8'; "
        "assert (d['F'] == [[1, -2.5, 0.1], [1e-3, 4096, 0]]).all(); "
        "assert d['tau'].shape == (5,) and (d['tau'] == 0.3).all()";
    const std::string command = python + " -c \"" + check + "\" " + file.path();
    EXPECT_EQ(std::system(command.c_str()), 0) << zip64_from;  // NOLINT
  }
}

// Equal arrays give equal bytes: no clock, no path in the archive.
TEST(Npz, IsTheSameEveryTime) {
  const std::vector<NpyArray> arrays = {matrix(true), vector_of(2)};
  EXPECT_EQ(detail::format_npz(arrays), detail::format_npz(arrays));
  const TemporaryFile file("same.npz");
  write_npz(file.path(), arrays);
  std::ifstream stream(file.path(), std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  EXPECT_EQ(bytes.str(), detail::format_npz(arrays));
  EXPECT_THROW(detail::format_npz({matrix(true), matrix(true)}), InvalidArgument);
  NpyArray hostile = matrix(true);
  hostile.name = "../up";
  EXPECT_THROW(detail::format_npz({hostile}), InvalidArgument);
}

TEST(Npy, WritesAndReadsFiles) {
  const TemporaryFile file("array.npy");
  write_npy(file.path(), matrix(false));
  EXPECT_EQ(read_npy(file.path()).values, matrix(false).values);
}

Image decoded(const std::string& bytes) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&header, bytes.data(), bytes.size()), 0);
  header.format = PNG_FORMAT_RGBA;
  Image image{static_cast<int>(header.width), static_cast<int>(header.height),
              std::vector<std::uint8_t>(PNG_IMAGE_SIZE(header))};
  EXPECT_NE(png_image_finish_read(&header, nullptr, image.rgba.data(), 0, nullptr), 0);
  return image;
}

// decode(encode(i)) = i, with alpha and without, for sides that fit no power of two.
TEST(Png, ReadsBackAsTheSamePixels) {
  Rng rng(5);
  for (const bool is_opaque : {false, true}) {
    Image image = make_image(37, 11);
    for (std::size_t i = 0; i < image.rgba.size(); ++i) {
      image.rgba[i] = i % 4 == 3 && is_opaque ? 255 : static_cast<std::uint8_t>(rng.below(256));
    }
    const std::string bytes = format_png(image);
    const Image back = decoded(bytes);
    EXPECT_EQ(back.width, 37);
    EXPECT_EQ(back.height, 11);
    EXPECT_EQ(back.rgba, image.rgba);
    EXPECT_EQ(format_png(image), bytes);
    EXPECT_EQ(bytes.find("tIME"), std::string::npos);
    EXPECT_EQ(static_cast<int>(bytes[25]), is_opaque ? 2 : 6);  // colour type
  }
  EXPECT_THROW(format_png(Image{}), InvalidArgument);
}

}  // namespace
}  // namespace dupin
