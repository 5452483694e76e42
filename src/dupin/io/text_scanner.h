#pragma once

#include <array>
#include <cstdint>
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
  bool next_line();

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
  void expect_line_end();

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
  // Up to eight digits without a sign: nearly every index there is.
  const char* p = cursor_;
  std::int64_t value = 0;
  unsigned digit = 0;
  while ((digit = static_cast<unsigned>(*p) - unsigned{'0'}) < 10U && p - cursor_ < 9) {
    value = value * 10 + static_cast<std::int64_t>(digit);
    ++p;
  }
  const Kind here = kind(p);
  if (p != cursor_ && (here == blank || here == line_end)) {
    cursor_ = p;
    return value;
  }
  return parse_integer(what, true, stop);
}

}  // namespace dupin::detail
