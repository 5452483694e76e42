#include "dupin/base/decimal.h"

#include <charconv>
#include <cmath>
#include <version>

#ifndef __cpp_lib_to_chars
#include <iomanip>
#include <locale>
#include <sstream>
#endif

namespace dupin {

#ifdef __cpp_lib_to_chars

bool parse_decimal(const char*& at, const char* end, double& value) {
  const auto [next, error] = std::from_chars(at, end, value);
  at = next;
  return error == std::errc() && std::isfinite(value);
}

std::string fixed_decimal(double value, int decimals) {
  std::string text(400 + static_cast<std::size_t>(decimals), '\0');
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value,
                                          std::chars_format::fixed, decimals);
  if (error != std::errc()) return "?";
  text.resize(static_cast<std::size_t>(end - text.data()));
  return text;
}

#else

bool parse_decimal(const char*& at, const char* end, double& value) {
  std::istringstream stream(std::string(at, end));
  stream.imbue(std::locale::classic());
  stream >> std::noskipws >> value;
  if (stream.fail() || !std::isfinite(value)) return false;
  at = stream.eof() ? end : at + stream.tellg();
  return true;
}

std::string fixed_decimal(double value, int decimals) {
  std::ostringstream stream;
  stream.imbue(std::locale::classic());
  stream << std::fixed << std::setprecision(decimals) << value;
  return stream.str();
}

#endif

}  // namespace dupin
