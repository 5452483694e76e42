#include <charconv>
#include <cmath>
#include <string_view>

#include "dupin/base/error.h"
#include "dupin/io/little_endian.h"
#include "dupin/io/npy_format.h"

namespace dupin::detail {
namespace {

/// The dictionary at the start of an .npy file (numpy.lib.format), the part that is needed.
struct Header {
  char type = 'f';
  int size = 8;
  bool is_fortran = false;
  std::vector<std::int64_t> shape;
  std::size_t data = 0;  ///< offset of the first value
};

class NpyParser {
 public:
  NpyParser(std::span<const std::uint8_t> bytes, const std::string& name, const ReadLimits& limits)
      : bytes_(bytes), name_(name), limits_(limits) {}

  NpyArray parse() {
    const Header header = parse_header();
    const std::int64_t rows = header.shape[0];
    const std::int64_t cols = header.shape.size() == 2 ? header.shape[1] : 1;
    check_size(header, rows, cols);
    NpyArray array;
    for (const std::int64_t size : header.shape) array.shape.push_back(size);
    array.as_float32 = header.type == 'f' && header.size == 4;
    array.values.resize(rows, cols);
    std::size_t at = header.data;
    const auto step = static_cast<std::size_t>(header.size);
    const std::int64_t outer = header.is_fortran ? cols : rows;
    const std::int64_t inner = header.is_fortran ? rows : cols;
    for (std::int64_t i = 0; i < outer; ++i) {
      for (std::int64_t j = 0; j < inner; ++j, at += step) {
        const double value = value_at(header, at);
        if (!std::isfinite(value))
          fail(Errc::impossible, "E_NONFINITE", "a value is not finite", at);
        array.values(header.is_fortran ? j : i, header.is_fortran ? i : j) = value;
      }
    }
    return array;
  }

 private:
  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                         std::size_t byte) const {
    throw IoError(errc, code, message, Location{name_, 0, static_cast<std::int64_t>(byte)});
  }

  std::uint64_t bits(std::size_t at, int size) const { return load_le(bytes_.data() + at, size); }

  double value_at(const Header& header, std::size_t at) const {
    const std::uint64_t raw = bits(at, header.size);
    if (header.type == 'f') {
      return header.size == 8 ? double_from_bits(raw)
                              : float_from_bits(static_cast<std::uint32_t>(raw));
    }
    if (header.type == 'u') return static_cast<double>(raw);
    return static_cast<double>(signed_from_bits(raw, header.size));
  }

  Header parse_header() const {
    static constexpr std::string_view magic = "\x93NUMPY";
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    if (bytes_.empty()) fail(Errc::malformed, "E_EMPTY", "the file is empty", 0);
    if (!text.starts_with(magic)) {
      fail(Errc::malformed, magic.starts_with(text) ? "E_TRUNCATED" : "E_MAGIC",
           "an .npy file starts with \\x93NUMPY", 0);
    }
    if (text.size() < 12) truncated(text.size());
    if (bytes_[6] < 1 || bytes_[6] > 3) {
      fail(Errc::malformed, "E_HEADER", "an .npy version other than 1, 2 or 3", 6);
    }
    const int width = bytes_[6] == 1 ? 2 : 4;
    const std::size_t start = 8 + static_cast<std::size_t>(width);
    const std::uint64_t length = bits(8, width);
    if (length > bytes_.size() - start) truncated(bytes_.size());
    const std::string_view dictionary = text.substr(start, length);
    Header header;
    header.data = start + length;
    parse_type(value_of(dictionary, "'descr'"), header);
    const std::string_view order = value_of(dictionary, "'fortran_order'");
    header.is_fortran = order.starts_with("True");
    if (!header.is_fortran && !order.starts_with("False")) bad_header("fortran_order");
    parse_shape(value_of(dictionary, "'shape'"), header);
    return header;
  }

  [[noreturn]] void truncated(std::size_t byte) const {
    fail(Errc::malformed, "E_TRUNCATED", "the file ends too early", byte);
  }
  [[noreturn]] void bad_header(const std::string& what) const {
    fail(Errc::malformed, "E_HEADER", "the .npy header lacks a usable " + what, 10);
  }

  std::string_view value_of(std::string_view dictionary, std::string_view key) const {
    const std::size_t at = dictionary.find(key);
    const std::size_t colon = at == std::string_view::npos ? at : dictionary.find(':', at);
    if (colon == std::string_view::npos) bad_header(std::string(key));
    const std::size_t start = dictionary.find_first_not_of(' ', colon + 1);
    if (start == std::string_view::npos) bad_header(std::string(key));
    return dictionary.substr(start);
  }

  void parse_type(std::string_view text, Header& header) const {
    if (text.size() < 5 || (text[0] != '\'' && text[0] != '"') || text[4] != text[0]) {
      bad_header("number type");
    }
    const bool is_byte = text[3] == '1';
    header.type = text[2];
    header.size = text[3] - '0';
    const bool is_known = header.type == 'f' ? header.size == 4 || header.size == 8
                                             : (header.type == 'i' || header.type == 'u') &&
                                                   (header.size == 1 || header.size == 2 ||
                                                    header.size == 4 || header.size == 8);
    if (!is_known || (text[1] != '<' && !(is_byte && text[1] == '|'))) bad_header("number type");
  }

  void parse_shape(std::string_view text, Header& header) const {
    if (text[0] != '(') bad_header("shape");
    const char* at = text.data() + 1;
    const char* last = text.data() + text.size();
    while (true) {
      while (at != last && (*at == ' ' || *at == ',')) ++at;
      if (at == last) bad_header("shape");
      if (*at == ')') break;
      std::int64_t size = 0;
      const auto [end, error] = std::from_chars(at, last, size);
      if (error == std::errc::result_out_of_range || size < 0) {
        fail(Errc::malformed, "E_NUMBER_RANGE", "the shape holds a number out of range", 10);
      }
      if (error != std::errc()) bad_header("shape");
      header.shape.push_back(size);
      if (header.shape.size() > 2) break;
      at = end;
    }
    if (header.shape.empty() || header.shape.size() > 2) bad_header("shape of 1 or 2 dimensions");
  }

  void check_size(const Header& header, std::int64_t rows, std::int64_t cols) const {
    const auto left = static_cast<std::int64_t>(bytes_.size() - header.data);
    const std::int64_t room = left / header.size;
    // Division, not multiplication: rows * cols may overflow.
    if (cols > 0 && rows > 0 && rows > room / cols) {
      const bool is_wild = rows > limits_.max_file_bytes / cols;
      fail(is_wild ? Errc::over_limit : Errc::malformed,
           is_wild ? "E_COUNT_EXCEEDS_FILE" : "E_TRUNCATED",
           "header claims " + std::to_string(rows) + " x " + std::to_string(cols) + " values, " +
               std::to_string(left) + " bytes follow",
           header.data);
    }
    if (rows * cols * header.size != left) {
      fail(Errc::malformed, "E_SYNTAX", "data follow the last value",
           header.data + static_cast<std::size_t>(rows * cols * header.size));
    }
    if ((rows == 0 || cols == 0) &&
        (rows > limits_.max_file_bytes || cols > limits_.max_file_bytes)) {
      fail(Errc::over_limit, "E_TOO_LARGE", "an empty array with a huge side", 10);
    }
  }

  std::span<const std::uint8_t> bytes_;
  const std::string& name_;
  const ReadLimits& limits_;
};

}  // namespace

NpyArray parse_npy(std::span<const std::uint8_t> bytes, const std::string& name,
                   const ReadLimits& limits) {
  return NpyParser(bytes, name, limits).parse();
}

}  // namespace dupin::detail
