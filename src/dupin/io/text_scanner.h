#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "dupin/base/error.h"
#include "dupin/io/read_options.h"

namespace dupin::detail {

/// How numbers and lines are written in one text format.
struct TextStyle {
  char comment = '\0';            ///< starts a comment that ends with the line; '\0': none
  bool comma_separates = false;   ///< commas are blanks (else "1,5" is E_DECIMAL_COMMA)
  bool has_continuation = false;  ///< a backslash before a line end joins two lines
};

enum class DecimalStatus { ok, syntax, range };

/// Parses the decimal number at `cursor` and moves `cursor` behind it. `*(last - 1)` must be a line
/// end: it stops every loop. The value is std::from_chars's to the bit; beyond its range, numbers
/// that are too small become a zero of their sign and numbers that are too large are
/// DecimalStatus::range. Also takes a leading '+', "nan" and "inf".
DecimalStatus parse_decimal(const char*& cursor, const char* last, double& value);

/// The part of parse_decimal() that std::from_chars has to do.
DecimalStatus parse_decimal_exactly(const char*& cursor, const char* last, double& value);

inline constexpr double kPowersOfTen[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                          1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                          1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/// Walks over a text line by line and token by token. Lines end with LF, CRLF or CR. A byte order
/// mark at the start is skipped. Nothing here depends on the locale.
///
/// All errors are IoError with file and line: E_SYNTAX (with column), E_DECIMAL_COMMA,
/// E_NUMBER_RANGE (Errc::malformed), E_TRUNCATED when the text ends where a token must be,
/// E_LINE_TOO_LONG (Errc::over_limit).
///
///   while (scanner.next_line()) {
///     const std::string_view key = scanner.word("a keyword");
///     if (key == "v") x = scanner.number("x") ...
///     scanner.expect_line_end();
///   }
class TextScanner {
 public:
  /// `bytes` must outlive the scanner. A text without a final line end is copied once, so that
  /// every inner loop is stopped by a line end and needs no check of bounds.
  /// `first_line` and `first_byte` are where `bytes` start in the file.
  TextScanner(std::span<const std::uint8_t> bytes, std::string file, const ReadLimits& limits,
              TextStyle style = {}, std::int64_t first_line = 1, std::int64_t first_byte = 0);
  TextScanner(const TextScanner&) = delete;
  TextScanner& operator=(const TextScanner&) = delete;

  bool has_bom() const { return has_bom_; }
  /// The text does not end with a line end: its last token may have been cut.
  bool is_unterminated() const { return is_unterminated_; }

  /// Goes to the next line that holds more than blanks and comments, leaving the rest of the
  /// current one unread. False at the end of the text; every token is missing from then on.
  bool next_line() {
    // The common step: from a plain line end to a token.
    if (*cursor_ == '\n' && is_started_ && cursor_ + 1 != last_ && kind(cursor_ + 1) == other &&
        cursor_ - line_start_ <= max_line_bytes_) {
      line_start_ = ++cursor_;
      ++line_;
      return true;
    }
    return find_next_line();
  }

  /// Skips blanks; true if nothing but a comment is left on this line.
  bool at_line_end();
  /// Next token of this line, up to a blank, comment or line end.
  std::string_view word(const char* what);
  /// The next token without taking it; empty at the end of the line.
  std::string_view peek_word();
  /// The rest of this line without its end, comments included.
  std::string_view rest_of_line();
  /// A real number; may be NaN or infinite only if the text says so.
  double number(const char* what);
  /// number() and index() `count` times, faster: the cursor stays in a register.
  void numbers(double* out, int count, const char* what);
  void indices(std::int64_t* out, int count, const char* what);
  /// Takes the next lines for as long as they are plainly "3 A B C", at most `count` of them, A to
  /// C below `num_vertices`; the first line that is anything else is left to next_line().
  /// @param out room for 3 `count` indices
  /// @returns the lines taken; 0 on processors without SSE2
  std::int64_t triangle_lines(std::int32_t* out, std::int64_t count, std::int64_t num_vertices);
  /// A whole number; E_NUMBER_RANGE beyond 64 bits, E_SYNTAX for a fraction.
  std::int64_t integer(const char* what);
  /// A whole number that is to be checked against a range: beyond 64 bits it is the nearest limit.
  /// Stops at `stop` too (for "7/1/3"), which the caller takes with take().
  std::int64_t index(const char* what, char stop = '\0');
  /// A count: E_NUMBER_RANGE if negative, fractional or beyond 64 bits.
  std::int64_t count(const char* what);
  /// Takes the character `c` if it is next, without skipping blanks.
  bool take(char c) {
    if (*cursor_ != c) return false;
    ++cursor_;
    return true;
  }
  /// E_SYNTAX if anything but a comment is left on this line.
  void expect_line_end() {
    if (kind(cursor_) != line_end) check_line_end();
  }

  std::int64_t line() const { return line_; }                  ///< 1-based; 0 before the first
  std::int64_t byte() const;                                   ///< offset in the input
  std::int64_t bytes_left() const { return last_ - cursor_; }  ///< from the cursor to the end

  /// What is being read, for messages: " (vertex 52 of 162)"; name is null when there is nothing to
  /// say, count 0 when it is not known.
  struct Element {
    const char* name = nullptr;
    std::int64_t index = 0;
    std::int64_t count = 0;
  };
  Element element;

  /// Throws IoError at the current line.
  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                         const std::string& hint = {}) const;
  [[noreturn]] void fail_syntax(const std::string& message) const;
  /// E_SYNTAX, E_DECIMAL_COMMA or E_TRUNCATED, whichever the text at the cursor deserves.
  [[noreturn]] void fail_expected(const char* what) const;

 private:
  enum Kind : std::uint8_t { other = 0, blank = 1, line_end = 2, comment = 3, backslash = 4 };

  Kind kind(const char* at) const { return kinds_[static_cast<unsigned char>(*at)]; }
  bool find_next_line();
  void check_line_end();
  void skip_blanks();
  bool take_continuation();
  void skip_to_line_end();
  bool take_line_end();
  bool is_last_line() const;
  void check_number_end(const char* what) const;
  std::int64_t parse_integer(const char* what, bool saturate, char stop);
  std::int64_t column() const;

  std::array<Kind, 256> kinds_{};
  std::string copy_;
  std::string file_;
  const char* begin_ = nullptr;
  const char* cursor_ = nullptr;
  const char* line_start_ = nullptr;
  const char* last_ = nullptr;
  std::int64_t line_ = 0;
  std::int64_t first_byte_ = 0;
  std::int64_t max_line_bytes_ = 0;
  bool is_started_ = false;
  bool has_bom_ = false;
  bool is_unterminated_ = false;
};

inline unsigned digit_of(char c) { return static_cast<unsigned>(c) - unsigned{'0'}; }
inline bool is_digit(char c) { return digit_of(c) < 10U; }

/// The value of the `length` (1 to 8) decimal digits that start the eight bytes `digits`, of which
/// the digits' high bits have been taken away. Little endian.
inline std::uint64_t value_of_digits(std::uint64_t digits, int length) {
  // The digits to the top, zeros before them; then pairs, fours and eights.
  digits <<= static_cast<unsigned>(64 - 8 * length);
  digits = digits * 10U + (digits >> 8U);
  return ((digits & 0x000000FF000000FFU) * 0x000F424000000064U +
          ((digits >> 16U) & 0x000000FF000000FFU) * 0x0000271000000001U) >>
         32U;
}

/// Takes the decimal digits at `p` into `value` (modulo 2^64), eight at a time and without a branch
/// a digit: the length of a number is what a processor cannot predict.
inline void take_digits(const char*& p, const char* last, std::uint64_t& value) {
  if constexpr (std::endian::native == std::endian::little) {
    constexpr std::uint64_t kPowers[] = {1,      10,      100,      1000,     10000,
                                         100000, 1000000, 10000000, 100000000};
    while (last - p >= 8) {
      std::uint64_t digits = 0;
      std::memcpy(&digits, p, sizeof(digits));
      digits ^= 0x3030303030303030U;
      const std::uint64_t others = ((digits + 0x7676767676767676U) | digits) & 0x8080808080808080U;
      const int length = others == 0 ? 8 : std::countr_zero(others) / 8;
      if (length == 0) return;
      value = value * kPowers[length] + value_of_digits(digits, length);
      p += length;
      if (length < 8) return;
    }
  }
  while (is_digit(*p)) value = value * 10U + digit_of(*p++);
}

// Clinger's exact case: an integer of at most 53 bits times or over a power of ten of at most 22.
inline DecimalStatus parse_decimal(const char*& cursor, const char* last, double& value) {
  const char* p = cursor;
  const bool is_negative = *p == '-';
  p += static_cast<int>(is_negative) | static_cast<int>(*p == '+');
  std::uint64_t mantissa = 0;
  const char* const first_digit = p;
  while (is_digit(*p)) mantissa = mantissa * 10U + digit_of(*p++);
  std::ptrdiff_t num_digits = p - first_digit;
  std::ptrdiff_t exponent = 0;
  if (*p == '.') {
    const char* const first_decimal = ++p;
    take_digits(p, last, mantissa);
    exponent = first_decimal - p;
    num_digits -= exponent;
  }
  if (*p == 'e' || *p == 'E') {
    const char* q = p + 1;
    const bool is_small = *q == '-';
    if (is_small || *q == '+') ++q;
    const char* const first_exponent = q;
    std::ptrdiff_t written = 0;
    while (is_digit(*q) && q - first_exponent < 4) written = written * 10 + (*q++ - '0');
    if (q == first_exponent || is_digit(*q)) return parse_decimal_exactly(cursor, last, value);
    exponent += is_small ? -written : written;
    p = q;
  }
  if (num_digits == 0 || num_digits > 19 || mantissa > (std::uint64_t{1} << 53U) ||
      exponent < -22 || exponent > 22) {
    return parse_decimal_exactly(cursor, last, value);
  }
  const auto integer = static_cast<double>(static_cast<std::int64_t>(mantissa));
  const double magnitude =
      exponent < 0 ? integer / kPowersOfTen[-exponent] : integer * kPowersOfTen[exponent];
  value = std::bit_cast<double>(std::bit_cast<std::uint64_t>(magnitude) |
                                static_cast<std::uint64_t>(is_negative) << 63U);
  cursor = p;
  return DecimalStatus::ok;
}

inline void TextScanner::skip_blanks() {
  while (kind(cursor_) == blank) ++cursor_;
  if (kind(cursor_) == backslash) {
    while (take_continuation()) {
      while (kind(cursor_) == blank) ++cursor_;
    }
  }
}

inline bool TextScanner::at_line_end() {
  skip_blanks();
  const Kind here = kind(cursor_);
  return here == line_end || here == comment;
}

inline double TextScanner::number(const char* what) {
  skip_blanks();
  double value = 0.0;
  const DecimalStatus status = parse_decimal(cursor_, last_, value);
  if (status == DecimalStatus::range) {
    fail(Errc::malformed, "E_NUMBER_RANGE", std::string(what) + " is too large for a double");
  }
  if (status != DecimalStatus::ok) fail_expected(what);
  // A comment needs a blank before it here: "-1.#IND" is no number.
  const Kind here = kind(cursor_);
  if (here != blank && here != line_end) check_number_end(what);
  return value;
}

inline std::int64_t TextScanner::index(const char* what, char stop) {
  skip_blanks();
  // Up to eighteen digits without a sign: nearly every index there is.
  const char* p = cursor_;
  std::uint64_t value = 0;
  take_digits(p, last_, value);
  const Kind here = kind(p);
  if (p != cursor_ && p - cursor_ <= 18 && (here == blank || here == line_end)) {
    cursor_ = p;
    return static_cast<std::int64_t>(value);
  }
  return parse_integer(what, true, stop);
}

inline void TextScanner::numbers(double* out, int count, const char* what) {
  const char* p = cursor_;
  for (int i = 0; i < count; ++i) {
    while (kind(p) == blank) ++p;
    const char* end = p;
    double value = 0.0;
    if (parse_decimal(end, last_, value) != DecimalStatus::ok ||
        (kind(end) != blank && kind(end) != line_end)) {
      cursor_ = p;
      value = number(what);
      end = cursor_;
    }
    out[i] = value;
    p = end;
  }
  cursor_ = p;
}

inline void TextScanner::indices(std::int64_t* out, int count, const char* what) {
  const char* p = cursor_;
  for (int i = 0; i < count; ++i) {
    while (kind(p) == blank) ++p;
    const char* end = p;
    std::uint64_t value = 0;
    take_digits(end, last_, value);
    if (end != p && end - p <= 18 && (kind(end) == blank || kind(end) == line_end)) {
      out[i] = static_cast<std::int64_t>(value);
    } else {
      cursor_ = p;
      out[i] = index(what);
      end = cursor_;
    }
    p = end;
  }
  cursor_ = p;
}

}  // namespace dupin::detail
