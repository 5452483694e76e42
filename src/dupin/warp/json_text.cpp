#include "dupin/warp/json_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <version>

#include "dupin/base/decimal.h"

#ifndef __cpp_lib_to_chars
#include <iomanip>
#include <locale>
#include <sstream>
#endif

namespace dupin::detail {
namespace {

// Bytes of the UTF-8 sequence that starts at text[i]; 0: none is valid there.
std::size_t sequence_length(std::string_view text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = byte(i);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || i + length > text.size()) return 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(i + k) & 0xC0U) != 0x80) return 0;
  }
  const unsigned char second = byte(i + 1);
  const bool overlong = (lead == 0xE0 && second < 0xA0) || (lead == 0xF0 && second < 0x90);
  const bool beyond = (lead == 0xED && second > 0x9F) || (lead == 0xF4 && second > 0x8F);
  return overlong || beyond ? 0 : length;
}

void append_utf8(std::string& out, std::uint32_t code) {
  const auto put = [&](std::uint32_t byte) { out += static_cast<char>(byte); };
  if (code < 0x80) {
    put(code);
  } else if (code < 0x800) {
    put(0xC0U | code >> 6U);
    put(0x80U | (code & 0x3FU));
  } else if (code < 0x10000) {
    put(0xE0U | code >> 12U);
    put(0x80U | (code >> 6U & 0x3FU));
    put(0x80U | (code & 0x3FU));
  } else {
    put(0xF0U | code >> 18U);
    put(0x80U | (code >> 12U & 0x3FU));
    put(0x80U | (code >> 6U & 0x3FU));
    put(0x80U | (code & 0x3FU));
  }
}

class Parser {
 public:
  Parser(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  JsonValue parse() {
    if (text_.size() > limits_.max_bytes)
      throw over_limit("E_TOO_LARGE", std::to_string(text_.size()) + " bytes, the limit is " +
                                          std::to_string(limits_.max_bytes));
    if (text_.empty()) throw json_error("E_EMPTY", "no bytes", 0);
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // the mark that some editors put first
    JsonValue value = parse_value(0);
    skip_space();
    if (at_ < text_.size()) throw unexpected("the end");
    return value;
  }

 private:
  IoError over_limit(const char* code, const std::string& message) const {
    return {Errc::over_limit, code, message, {.file = {}, .line = line_, .byte = -1}};
  }

  IoError unexpected(const std::string& wanted) const {
    if (at_ >= text_.size())
      return json_error("E_TRUNCATED", "the text ends where " + wanted + " is due", line_);
    return json_error(
        "E_SYNTAX", "\"" + escaped(text_.substr(at_, 1)) + "\" where " + wanted + " is due", line_);
  }

  void skip_space() {
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c == '\n') ++line_;
      if (c != ' ' && c != '\t' && c != '\n' && c != '\r') return;
    }
  }

  bool take(char c) {
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }

  JsonValue parse_value(int depth) {
    if (depth > limits_.max_depth)
      throw over_limit("E_NESTING", "nested deeper than " + std::to_string(limits_.max_depth));
    if (++num_values_ > limits_.max_values)
      throw over_limit("E_TOO_LARGE",
                       "more than " + std::to_string(limits_.max_values) + " values");
    skip_space();
    JsonValue value;
    value.line = line_;
    if (take('{')) {
      parse_members(value, depth);
    } else if (take('[')) {
      parse_items(value, depth);
    } else if (at_ < text_.size() && text_[at_] == '"') {
      value.kind = JsonValue::Kind::string;
      value.text = parse_string();
    } else if (take_word("true")) {
      value.kind = JsonValue::Kind::boolean;
      value.truth = true;
    } else if (take_word("false")) {
      value.kind = JsonValue::Kind::boolean;
    } else if (!take_word("null")) {
      value.kind = JsonValue::Kind::number;
      value.number = parse_number();
    }
    return value;
  }

  bool take_word(std::string_view word) {
    if (text_.substr(at_, word.size()) == word) {
      at_ += word.size();
      return true;
    }
    if (at_ < text_.size() && text_[at_] == word[0]) {
      const bool ends = text_.size() - at_ < word.size() &&
                        text_.substr(at_) == word.substr(0, text_.size() - at_);
      if (ends) at_ = text_.size();
      throw unexpected(std::string(word));
    }
    return false;
  }

  void parse_items(JsonValue& value, int depth) {
    value.kind = JsonValue::Kind::array;
    skip_space();
    if (take(']')) return;
    do {
      value.items.push_back(parse_value(depth + 1));
      skip_space();
    } while (take(','));
    if (!take(']')) throw unexpected("\",\" or \"]\"");
  }

  void parse_members(JsonValue& value, int depth) {
    value.kind = JsonValue::Kind::object;
    skip_space();
    if (take('}')) return;
    do {
      skip_space();
      if (at_ >= text_.size() || text_[at_] != '"') throw unexpected("a name in quotes");
      std::string name = parse_string();
      if (value.items.size() >= 1000) throw over_limit("E_TOO_LARGE", "more than 1000 names");
      if (value.find(name) != nullptr)
        throw json_error("E_SYNTAX", "the name \"" + escaped(name) + "\" comes twice", line_);
      skip_space();
      if (!take(':')) throw unexpected("\":\"");
      JsonValue member = parse_value(depth + 1);
      value.names.push_back(std::move(name));
      value.items.push_back(std::move(member));
      skip_space();
    } while (take(','));
    if (!take('}')) throw unexpected("\",\" or \"}\"");
  }

  std::string parse_string() {
    std::string result;
    ++at_;
    for (;;) {
      if (at_ >= text_.size()) throw unexpected("a closing quote");
      if (take('"')) return result;
      if (take('\\')) {
        parse_escape(result);
        continue;
      }
      const std::size_t length = sequence_length(text_, at_);
      if (length == 0) throw json_error("E_SYNTAX", "a string is not UTF-8", line_);
      if (static_cast<unsigned char>(text_[at_]) < 0x20)
        throw json_error("E_SYNTAX", "a control character in a string", line_);
      result += text_.substr(at_, length);
      at_ += length;
    }
  }

  void parse_escape(std::string& result) {
    constexpr std::string_view kLetters = "\"\\/bfnrt";
    constexpr std::string_view kMeaning = "\"\\/\b\f\n\r\t";
    if (at_ >= text_.size()) throw unexpected("an escape");
    const std::size_t letter = kLetters.find(text_[at_]);
    if (letter != std::string_view::npos) {
      result += kMeaning[letter];
      ++at_;
      return;
    }
    if (!take('u')) throw unexpected("an escape");
    std::uint32_t code = parse_hex4();
    if (code >= 0xD800 && code < 0xDC00) {
      if (!take('\\') || !take('u')) throw unexpected("the second half of a pair");
      const std::uint32_t low = parse_hex4();
      if (low < 0xDC00 || low > 0xDFFF)
        throw json_error("E_SYNTAX", "half of a surrogate pair", line_);
      code = 0x10000 + ((code - 0xD800) << 10U) + (low - 0xDC00);
    } else if (code >= 0xDC00 && code < 0xE000) {
      throw json_error("E_SYNTAX", "half of a surrogate pair", line_);
    }
    append_utf8(result, code);
  }

  std::uint32_t parse_hex4() {
    std::uint32_t code = 0;
    for (int k = 0; k < 4; ++k, ++at_) {
      if (at_ >= text_.size()) throw unexpected("a hexadecimal digit");
      const char c = text_[at_];
      std::uint32_t digit = 16;
      if (c >= '0' && c <= '9') digit = static_cast<std::uint32_t>(c - '0');
      if (c >= 'a' && c <= 'f') digit = static_cast<std::uint32_t>(c - 'a' + 10);
      if (c >= 'A' && c <= 'F') digit = static_cast<std::uint32_t>(c - 'A' + 10);
      if (digit == 16) throw unexpected("a hexadecimal digit");
      code = 16 * code + digit;
    }
    return code;
  }

  bool take_digits() {
    const std::size_t start = at_;
    while (at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9') ++at_;
    return at_ > start;
  }

  double parse_number() {
    const std::size_t start = at_;
    take('-');
    if (!take('0') && !take_digits()) throw unexpected("a value");
    if (take('.') && !take_digits()) throw unexpected("a digit");
    if (take('e') || take('E')) {
      if (!take('+')) take('-');
      if (!take_digits()) throw unexpected("a digit");
    }
    const std::string token(text_.substr(start, at_ - start));
    const char* at = token.data();
    double value = 0.0;
    if (!parse_decimal(at, token.data() + token.size(), value) || at != token.data() + token.size())
      throw json_error("E_NUMBER_RANGE", escaped(token) + " is not a double", line_);
    return value;
  }

  std::string_view text_;
  const JsonLimits& limits_;
  std::size_t at_ = 0;
  std::int64_t line_ = 1;
  std::int64_t num_values_ = 0;
};

// d.ddde+xx with the fewest digits that read back as `value`.
std::string shortest_scientific(double value) {
#ifdef __cpp_lib_to_chars
  char buffer[64];
  const auto [end, error] =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::scientific);
  return error == std::errc() ? std::string(buffer, end) : std::string();
#else
  std::string text;
  for (int digits = 0; digits <= 17; ++digits) {
    std::ostringstream stream;
    stream.imbue(std::locale::classic());
    stream << std::scientific << std::setprecision(digits) << value;
    text = stream.str();
    const char* at = text.data();
    double back = 0.0;
    if (parse_decimal(at, text.data() + text.size(), back) && back == value) break;
  }
  return text;
#endif
}

}  // namespace

const JsonValue* JsonValue::find(std::string_view key) const {
  const auto found = std::find(names.begin(), names.end(), key);
  return found == names.end() ? nullptr : &items[static_cast<std::size_t>(found - names.begin())];
}

IoError json_error(const char* code, const std::string& message, std::int64_t line,
                   const std::string& hint) {
  return {Errc::malformed, code, message, {.file = {}, .line = line, .byte = -1}, hint};
}

JsonValue parse_json(std::string_view text, const JsonLimits& limits) {
  return Parser(text, limits).parse();
}

std::string shortest_decimal(double value) {
  if (value == 0.0) return "0";
  const std::string scientific = shortest_scientific(std::abs(value));
  const std::size_t mark = scientific.find('e');
  std::string digits;
  for (const char c : scientific.substr(0, mark)) {
    if (c != '.') digits += c;
  }
  const char* at = scientific.data() + mark + (scientific[mark + 1] == '+' ? 2 : 1);
  int exponent = 0;
  std::from_chars(at, scientific.data() + scientific.size(), exponent);

  std::string text = value < 0.0 ? "-" : "";
  if (exponent < -5 || exponent >= 15) {
    text += digits.substr(0, 1);
    if (digits.size() > 1) text += "." + digits.substr(1);
    return text + "e" + std::to_string(exponent);
  }
  if (exponent < 0)
    return text + "0." + std::string(static_cast<std::size_t>(-exponent - 1), '0') + digits;
  const auto whole = static_cast<std::size_t>(exponent) + 1;
  if (digits.size() <= whole) return text + digits + std::string(whole - digits.size(), '0');
  return text + digits.substr(0, whole) + "." + digits.substr(whole);
}

std::string quoted(std::string_view text) {
  constexpr char kHex[] = "0123456789abcdef";
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (byte < 0x20) {
      result += "\\u00";
      result += kHex[byte >> 4U];
      result += kHex[byte & 15U];
    } else {
      result += c;
    }
  }
  return result + "\"";
}

bool is_plain_text(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = sequence_length(text, i);
    if (length == 0) return false;
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte < 0x20 || byte == 0x7F) return false;
    if (byte == 0xC2 && static_cast<unsigned char>(text[i + 1]) < 0xA0) return false;  // C1
    i += length;
  }
  return true;
}

}  // namespace dupin::detail
