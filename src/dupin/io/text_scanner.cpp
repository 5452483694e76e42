#include "dupin/io/text_scanner.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace dupin::detail {
namespace {

// Decimal exponent of the first nonzero digit of a number that std::from_chars found out of range:
// only its sign matters, so 64 bits saturate.
std::int64_t magnitude(const char* p, const char* last) {
  constexpr std::int64_t kFar = std::int64_t{1} << 40;
  std::int64_t position = 0;
  bool has_point = false;
  bool has_digit = false;
  for (; p != last && (is_digit(*p) || *p == '.'); ++p) {
    if (*p == '.') {
      has_point = true;
    } else if (has_digit) {
      if (!has_point) ++position;
    } else {
      has_digit = *p != '0';
      if (has_point) --position;
    }
  }
  std::int64_t exponent = 0;
  bool is_negative = false;
  if (p != last && (*p == 'e' || *p == 'E')) {
    ++p;
    if (p != last && (*p == '-' || *p == '+')) is_negative = *p++ == '-';
    for (; p != last && is_digit(*p); ++p) {
      if (exponent < kFar) exponent = exponent * 10 + static_cast<std::int64_t>(digit_of(*p));
    }
  }
  return position + (is_negative ? -exponent : exponent);
}

#ifdef __SSE2__
// A bit for each of the 16 bytes at `p`, set where it is no decimal digit.
unsigned others16(const char* p) {
  const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
  // Signed bytes: '0'..'9' become -128..-119.
  const __m128i shifted = _mm_add_epi8(bytes, _mm_set1_epi8(static_cast<char>(0x80 - '0')));
  const __m128i is_other = _mm_cmpgt_epi8(shifted, _mm_set1_epi8(-119));
  return static_cast<unsigned>(_mm_movemask_epi8(is_other));
}
#endif

}  // namespace

DecimalStatus parse_decimal_exactly(const char*& cursor, const char* last, double& value) {
  const char* p = cursor;
  if (*p == '+' && (is_digit(p[1]) || p[1] == '.')) ++p;
  const auto [end, error] = std::from_chars(p, last, value);
  if (error == std::errc::invalid_argument) return DecimalStatus::syntax;
  const bool is_negative = *p == '-';
  const char* digits = is_negative ? p + 1 : p;
  const bool is_word = !is_digit(*digits) && *digits != '.';
  if (error == std::errc::result_out_of_range || (!is_word && std::isinf(value))) {
    if (magnitude(digits, end) > 0) return DecimalStatus::range;
    value = is_negative ? -0.0 : 0.0;
  }
  cursor = end;
  return DecimalStatus::ok;
}

TextScanner::TextScanner(std::span<const std::uint8_t> bytes, std::string file,
                         const ReadLimits& limits, TextStyle style, std::int64_t first_line,
                         std::int64_t first_byte)
    : file_(std::move(file)),
      line_(first_line - 1),
      first_byte_(first_byte),
      max_line_bytes_(limits.max_line_bytes) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const bool has_end = !text.empty() && (text.back() == '\n' || text.back() == '\r');
  is_unterminated_ = !text.empty() && !has_end;
  if (!has_end) {
    copy_.reserve(text.size() + 1);
    copy_.append(text).push_back('\n');
    text = copy_;
  }
  begin_ = text.data();
  last_ = begin_ + text.size();
  cursor_ = begin_;
  if (text.starts_with("\xEF\xBB\xBF")) {
    has_bom_ = true;
    cursor_ += 3;
  }
  line_start_ = cursor_;
  for (const char c : {' ', '\t', '\v', '\f'}) kinds_[static_cast<unsigned char>(c)] = blank;
  for (const char c : {'\n', '\r'}) kinds_[static_cast<unsigned char>(c)] = line_end;
  if (style.comment != '\0') kinds_[static_cast<unsigned char>(style.comment)] = comment;
  if (style.comma_separates) kinds_[static_cast<unsigned char>(',')] = blank;
  if (style.has_continuation) kinds_[static_cast<unsigned char>('\\')] = backslash;
}

// The last byte is a line end, so the cursor stays before last_ and can always be read.
bool TextScanner::take_line_end() {
  if (cursor_ - line_start_ > max_line_bytes_) {
    fail(Errc::over_limit, "E_LINE_TOO_LONG",
         "a line of " + std::to_string(cursor_ - line_start_) + " bytes, the limit is " +
             std::to_string(max_line_bytes_),
         "raise it with --max-line-bytes");
  }
  const char* next = cursor_ + 1;
  if (*cursor_ == '\r' && next != last_ && *next == '\n') ++next;
  if (next == last_) return false;
  cursor_ = next;
  line_start_ = cursor_;
  ++line_;
  return true;
}

void TextScanner::skip_to_line_end() {
  while (kind(cursor_) != line_end) {
    if (*cursor_ == '\0') fail_syntax("NUL byte in a text file");
    ++cursor_;
  }
}

bool TextScanner::find_next_line() {
  if (!is_started_) {
    is_started_ = true;
    ++line_;
  } else {
    if (kind(cursor_) != line_end) skip_to_line_end();
    if (!take_line_end()) return false;
  }
  while (at_line_end()) {
    if (kind(cursor_) != line_end) skip_to_line_end();
    if (!take_line_end()) return false;
  }
  return true;
}

bool TextScanner::take_continuation() {
  if (kind(cursor_) != backslash || kind(cursor_ + 1) != line_end) return false;
  ++cursor_;
  return take_line_end();
}

std::string_view TextScanner::peek_word() {
  if (at_line_end()) return {};
  const char* end = cursor_;
  while (kind(end) == other || kind(end) == backslash) ++end;
  if (end == cursor_) ++end;  // a backslash that joins nothing
  return {cursor_, static_cast<std::size_t>(end - cursor_)};
}

std::string_view TextScanner::word(const char* what) {
  const std::string_view token = peek_word();
  if (token.empty()) fail_expected(what);
  cursor_ += token.size();
  return token;
}

std::string_view TextScanner::rest_of_line() {
  skip_blanks();
  const char* const start = cursor_;
  skip_to_line_end();
  return {start, static_cast<std::size_t>(cursor_ - start)};
}

std::int64_t TextScanner::parse_integer(const char* what, bool saturate, char stop) {
  skip_blanks();
  const char* p = cursor_;
  const bool is_negative = *p == '-';
  if (is_negative || *p == '+') ++p;
  if (!is_digit(*p)) fail_expected(what);
  constexpr std::uint64_t kLimit = std::uint64_t{1} << 63U;
  std::uint64_t value = 0;
  bool overflows = false;
  for (; is_digit(*p); ++p) {
    const unsigned digit = digit_of(*p);
    overflows = overflows || value > (kLimit - digit) / 10U;
    if (!overflows) value = value * 10U + digit;
  }
  overflows = overflows || (!is_negative && value == kLimit);
  if (overflows && !saturate) {
    fail(Errc::malformed, "E_NUMBER_RANGE", std::string(what) + " does not fit 64 bits");
  }
  cursor_ = p;
  if (kind(cursor_) == other && (stop == '\0' || *cursor_ != stop)) fail_expected(what);
  using Limits = std::numeric_limits<std::int64_t>;
  if (overflows) return is_negative ? Limits::min() : Limits::max();
  if (value == kLimit) return Limits::min();
  return is_negative ? -static_cast<std::int64_t>(value) : static_cast<std::int64_t>(value);
}

std::int64_t TextScanner::integer(const char* what) { return parse_integer(what, false, '\0'); }

std::int64_t TextScanner::count(const char* what) {
  skip_blanks();
  const char* const start = cursor_;
  const char* p = start;
  if (*p == '-' || *p == '+') ++p;
  while (is_digit(*p)) ++p;
  if (*p == '.' || *p == 'e' || *p == 'E') {
    fail(Errc::malformed, "E_NUMBER_RANGE",
         std::string(what) + " is not a whole number: '" + escaped(peek_word(), 40) + "'");
  }
  const std::int64_t value = parse_integer(what, false, '\0');
  if (value < 0) {
    fail(Errc::malformed, "E_NUMBER_RANGE",
         std::string(what) + " is negative: " + std::to_string(value));
  }
  return value;
}

#ifdef __SSE2__
// The separators of a line are found by one comparison of its bytes, so that the three numbers are
// read side by side; one after another each would wait for the length of the one before.
std::int64_t TextScanner::triangle_lines(std::int32_t* out, std::int64_t count,
                                         std::int64_t num_vertices) {
  constexpr std::ptrdiff_t kWindow = 32;
  if (!is_started_ || max_line_bytes_ < kWindow) return 0;
  const auto most = static_cast<std::uint64_t>(num_vertices);
  const char* cursor = cursor_;
  std::int64_t taken = 0;
  // Eight more bytes, because a number is loaded as eight from its first digit on.
  while (taken < count && *cursor == '\n' && last_ - cursor > kWindow + 8) {
    const char* const line = cursor + 1;
    unsigned others = others16(line) | others16(line + 16) << 16U;
    if (line[0] != '3' || line[1] != ' ' || (others & 1U) != 0U) break;
    others &= others - 1U;  // the blank behind the 3
    int begin = 2;
    bool is_plain = true;
    for (int corner = 0; corner < 3; ++corner) {
      const int end = others == 0U ? begin : std::countr_zero(others);
      const int length = end - begin;
      is_plain = is_plain && length >= 1 && length <= 8 && line[end] == (corner < 2 ? ' ' : '\n');
      if (!is_plain) break;
      std::uint64_t digits = 0;
      std::memcpy(&digits, line + begin, sizeof(digits));
      const std::uint64_t value = value_of_digits(digits ^ 0x3030303030303030U, length);
      is_plain = value < most;
      out[corner] = static_cast<std::int32_t>(value);
      others &= others - 1U;
      begin = end + 1;
    }
    if (!is_plain) break;
    out += 3;
    ++taken;
    line_start_ = line;
    cursor = line + begin - 1;
  }
  cursor_ = cursor;
  line_ += taken;
  return taken;
}
#else
std::int64_t TextScanner::triangle_lines(std::int32_t*, std::int64_t, std::int64_t) { return 0; }
#endif

void TextScanner::check_line_end() {
  if (at_line_end()) return;
  if (*cursor_ == '\0') fail_syntax("NUL byte in a text file");
  fail_syntax("unexpected '" + escaped(peek_word(), 40) + "'");
}

std::int64_t TextScanner::byte() const { return first_byte_ + (cursor_ - begin_); }

std::int64_t TextScanner::column() const { return cursor_ - line_start_ + 1; }

bool TextScanner::is_last_line() const {
  for (const char* p = cursor_; p != last_; ++p) {
    if (kind(p) != line_end && kind(p) != blank) return false;
  }
  return true;
}

void TextScanner::fail(Errc errc, const char* code, const std::string& message,
                       const std::string& hint) const {
  std::string where;
  if (element.name != nullptr) {
    where = std::string(" (") + element.name + " " + std::to_string(element.index);
    if (element.count > 0) where += " of " + std::to_string(element.count);
    where += ")";
  }
  throw IoError(errc, code, message + where, {file_, line_, byte()}, hint);
}

void TextScanner::fail_syntax(const std::string& message) const {
  fail(Errc::malformed, "E_SYNTAX", message + ", column " + std::to_string(column()));
}

void TextScanner::check_number_end(const char* what) const {
  const bool joins_lines = kind(cursor_) == backslash && kind(cursor_ + 1) == line_end;
  if (!joins_lines) fail_expected(what);
}

void TextScanner::fail_expected(const char* what) const {
  const char* start = cursor_;
  const auto is_in_token = [&](const char* p) { return kind(p) != blank && kind(p) != line_end; };
  if (is_in_token(cursor_)) {
    while (start != line_start_ && is_in_token(start - 1)) --start;
  }
  const char* end = cursor_;
  if (start != cursor_ || kind(cursor_) != comment) {
    while (is_in_token(end)) ++end;
  }
  const std::string_view token(start, static_cast<std::size_t>(end - start));
  const std::string expected = std::string("expected ") + what;
  if (token.empty() || (is_unterminated_ && end + 1 == last_ &&
                        token.find_first_not_of("0123456789+-.eE") == std::string_view::npos)) {
    if (is_last_line() || !token.empty()) {
      fail(Errc::malformed, "E_TRUNCATED", expected + ", but the file ends here");
    }
    fail_syntax(expected + ", but the line ends here");
  }
  if (token.find('\0') != std::string_view::npos) fail_syntax("NUL byte in a text file");
  for (std::size_t i = 1; i + 1 < token.size(); ++i) {
    if (token[i] == ',' && is_digit(token[i - 1]) && is_digit(token[i + 1])) {
      fail(Errc::malformed, "E_DECIMAL_COMMA",
           "a decimal comma in '" + escaped(token, 40) + "'; numbers take a point",
           "write the file with a locale whose decimal sign is the point");
    }
  }
  fail_syntax(expected + ", found '" + escaped(token, 40) + "'");
}

}  // namespace dupin::detail
