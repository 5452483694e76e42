#include "dupin/io/wrl_lexer.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

namespace dupin::detail {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == ','; }

bool ends_word(char c) {
  switch (c) {
    case '{':
    case '}':
    case '[':
    case ']':
    case '"':
    case '#':
      return true;
    default:
      return is_blank(c);
  }
}

bool is_control(char c) {
  return (static_cast<unsigned char>(c) < 0x20 && !is_blank(c)) || c == 0x7f;
}

/// The exponent's sign tells an underflow from an overflow; without one, a leading "0." does.
bool is_underflow(std::string_view text) {
  const std::size_t e = text.find_first_of("eE");
  if (e != std::string_view::npos) return e + 1 < text.size() && text[e + 1] == '-';
  return text.find_first_not_of("+-0.") > text.find('.');
}

}  // namespace

WrlLexer::WrlLexer(std::span<const std::uint8_t> bytes, std::string file)
    : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), file_(std::move(file)) {}

void WrlLexer::skip_blanks() {
  while (at_ < text_.size()) {
    const char c = text_[at_];
    if (c == '#') {
      while (at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '\r') {
        if (text_[at_] == '\0') fail(Errc::malformed, "E_SYNTAX", "a NUL byte in a text", at_);
        ++at_;
      }
    } else if (is_blank(c)) {
      ++at_;
    } else {
      return;
    }
  }
}

WrlToken WrlLexer::scan_string() {
  const std::size_t start = at_++;
  while (at_ < text_.size() && text_[at_] != '"') {
    if (text_[at_] == '\0') fail(Errc::malformed, "E_SYNTAX", "a NUL byte in a text", at_);
    at_ += text_[at_] == '\\' ? 2U : 1U;
  }
  if (at_ >= text_.size()) {
    fail(Errc::malformed, "E_TRUNCATED", "the file ends inside the string that starts here", start);
  }
  ++at_;
  return {WrlTokenKind::string, text_.substr(start + 1, at_ - start - 2), start};
}

WrlToken WrlLexer::scan() {
  skip_blanks();
  if (at_ >= text_.size()) return {WrlTokenKind::end, {}, text_.size()};
  const std::size_t start = at_;
  const auto single = [&](WrlTokenKind kind) {
    ++at_;
    return WrlToken{kind, text_.substr(start, 1), start};
  };
  switch (text_[at_]) {
    case '{':
      return single(WrlTokenKind::open_brace);
    case '}':
      return single(WrlTokenKind::close_brace);
    case '[':
      return single(WrlTokenKind::open_bracket);
    case ']':
      return single(WrlTokenKind::close_bracket);
    case '"':
      return scan_string();
    default:
      break;
  }
  while (at_ < text_.size() && !ends_word(text_[at_])) {
    if (is_control(text_[at_])) {
      fail(Errc::malformed, "E_SYNTAX", "a control character in a text", at_);
    }
    ++at_;
  }
  return {WrlTokenKind::word, text_.substr(start, at_ - start), start};
}

WrlToken WrlLexer::next() {
  if (has_peeked_) {
    has_peeked_ = false;
    return peeked_;
  }
  return scan();
}

const WrlToken& WrlLexer::peek() {
  if (!has_peeked_) {
    peeked_ = scan();
    has_peeked_ = true;
  }
  return peeked_;
}

void WrlLexer::seek(std::size_t byte) {
  at_ = std::min(byte, text_.size());
  has_peeked_ = false;
}

double WrlLexer::number(const WrlToken& token) const {
  const char* first = token.text.data();
  const char* last = first + token.text.size();
  if (token.kind != WrlTokenKind::word || token.text.empty()) fail_expected("a number", token);
  if (*first == '+') ++first;
  double value = 0.0;
  const auto [end, error] = std::from_chars(first, last, value);
  // "-1.#IND" is no number followed by a comment.
  const std::size_t behind = token.byte + token.text.size();
  const bool is_glued = behind < text_.size() && text_[behind] == '#';
  if (error == std::errc::invalid_argument || end != last || is_glued ||
      (first != token.text.data() && *first == '-')) {
    fail_expected("a number", token);
  }
  if (error == std::errc::result_out_of_range) {
    if (is_underflow(token.text)) return *first == '-' ? -0.0 : 0.0;
    fail(Errc::malformed, "E_NUMBER_RANGE", "the number is too large for a double", token.byte);
  }
  return value;
}

std::int64_t WrlLexer::integer(const WrlToken& token) const {
  const char* first = token.text.data();
  const char* last = first + token.text.size();
  if (token.kind != WrlTokenKind::word || token.text.empty())
    fail_expected("a whole number", token);
  if (*first == '+') ++first;
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(first, last, value);
  if (error == std::errc::invalid_argument || end != last ||
      (first != token.text.data() && *first == '-')) {
    fail_expected("a whole number", token);
  }
  if (error == std::errc::result_out_of_range) {
    return *first == '-' ? std::numeric_limits<std::int64_t>::min()
                         : std::numeric_limits<std::int64_t>::max();
  }
  return value;
}

std::int64_t WrlLexer::line_of(std::size_t byte) const {
  std::int64_t line = 1;
  for (std::size_t i = 0; i < std::min(byte, text_.size()); ++i) {
    const bool is_crlf = text_[i] == '\r' && i + 1 < text_.size() && text_[i + 1] == '\n';
    if (text_[i] == '\n' || (text_[i] == '\r' && !is_crlf)) ++line;
  }
  return line;
}

void WrlLexer::fail(Errc errc, const char* code, const std::string& message,
                    std::size_t byte) const {
  throw IoError(errc, code, message, Location{file_, line_of(byte), -1});
}

void WrlLexer::fail_expected(const char* what, const WrlToken& token) const {
  // A word that touches the end of the file may have been cut: "-" of "-1".
  const bool is_cut =
      token.kind == WrlTokenKind::word && token.byte + token.text.size() == text_.size();
  if (token.kind == WrlTokenKind::end || is_cut) {
    fail(Errc::malformed, "E_TRUNCATED",
         std::string("the file ends where ") + what + " is expected", token.byte);
  }
  fail(Errc::malformed, "E_SYNTAX",
       std::string("expected ") + what + ", found '" + escaped(token.text, 40) + "'", token.byte);
}

}  // namespace dupin::detail
