#include "dupin/base/error.h"

#include <utility>

namespace dupin {
namespace {

// Length of the valid UTF-8 sequence that starts at text[i], or 0.
std::size_t utf8_length(std::string_view text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = byte(i);
  std::size_t length = 0;
  if (lead >= 0xC2 && lead <= 0xDF) length = 2;
  if (lead >= 0xE0 && lead <= 0xEF) length = 3;
  if (lead >= 0xF0 && lead <= 0xF4) length = 4;
  if (length == 0 || i + length > text.size()) return 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(i + k) & 0xC0) != 0x80) return 0;
  }
  const unsigned char second = byte(i + 1);
  if (lead == 0xE0 && second < 0xA0) return 0;  // overlong
  if (lead == 0xED && second > 0x9F) return 0;  // surrogate
  if (lead == 0xF0 && second < 0x90) return 0;  // overlong
  if (lead == 0xF4 && second > 0x8F) return 0;  // beyond U+10FFFF
  if (lead == 0xC2 && second < 0xA0) return 0;  // C1 control characters drive terminals
  return length;
}

}  // namespace

std::string escaped(std::string_view text, std::size_t max_bytes) {
  constexpr char kHex[] = "0123456789abcdef";
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    if (i >= max_bytes) {
      result += "...";
      break;
    }
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte >= 0x20 && byte < 0x7F && byte != '\\') {
      result += text[i++];
    } else if (const std::size_t length = utf8_length(text, i); length > 0) {
      result += text.substr(i, length);
      i += length;
    } else {
      result += "\\x";
      result += kHex[byte >> 4U];
      result += kHex[byte & 15U];
      ++i;
    }
  }
  return result;
}

Error::Error(Errc errc, std::string code, const std::string& message, Location location,
             std::string hint)
    : std::runtime_error(message),
      errc_(errc),
      code_(std::move(code)),
      location_(std::move(location)),
      hint_(std::move(hint)) {}

std::string Error::diagnostic() const {
  std::string result;
  if (!location_.file.empty()) {
    result += escaped(location_.file, 4096);
    if (location_.line > 0) {
      result += ":" + std::to_string(location_.line);
    } else if (location_.byte >= 0) {
      constexpr char kHex[] = "0123456789abcdef";
      std::string digits;
      auto rest = static_cast<std::uint64_t>(location_.byte);
      do {
        digits.insert(digits.begin(), kHex[rest & 15U]);
        rest >>= 4U;
      } while (rest != 0);
      result += "@0x" + digits;
    }
    result += ": ";
  }
  return result + code_ + ": " + what();
}

InvalidArgument::InvalidArgument(const std::string& message, std::string hint)
    : Error(Errc::usage, "E_OPTION", message, {}, std::move(hint)) {}

AnalysisError::AnalysisError(std::string code, const std::string& message, std::string hint)
    : Error(Errc::impossible, std::move(code), message, {}, std::move(hint)) {}

}  // namespace dupin
