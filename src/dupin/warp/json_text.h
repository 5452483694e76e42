#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dupin/base/error.h"

namespace dupin::detail {

/// A value of a JSON text and the line it starts at, so that an error of meaning can say where.
struct JsonValue {
  enum class Kind : std::uint8_t { null, boolean, number, string, array, object };
  Kind kind = Kind::null;
  bool truth = false;
  double number = 0.0;
  std::int64_t line = 1;
  std::string text;
  std::vector<JsonValue> items;    ///< of an array, or the values of an object in order
  std::vector<std::string> names;  ///< (object) one for each item

  const JsonValue* find(std::string_view key) const;  ///< null: no such member
};

struct JsonLimits {
  std::size_t max_bytes = std::size_t{16} << 20U;
  std::int64_t max_values = 300000;  ///< keeps the tree under 64 MB
  int max_depth = 64;
};

/// Parses one JSON text (RFC 8259): UTF-8 without mark, no repeated names in an object, numbers
/// that a double holds. Numbers do not depend on the locale.
/// @throws IoError E_EMPTY, E_SYNTAX, E_TRUNCATED, E_NUMBER_RANGE (malformed), E_NESTING,
///   E_TOO_LARGE (over_limit), with the line. Cost: O(bytes); O(k^2) for k names in one object.
JsonValue parse_json(std::string_view text, const JsonLimits& limits = {});

/// The error of a value at `line`.
IoError json_error(const char* code, const std::string& message, std::int64_t line,
                   const std::string& hint = {});

/// The shortest decimal text that reads back as `value`; plain notation between 1e-5 and 1e15.
/// Minus zero is "0". @param value finite
std::string shortest_decimal(double value);

/// `text` in quotes, with `"`, `\` and control characters escaped. @param text valid UTF-8
std::string quoted(std::string_view text);

/// Whether `text` is valid UTF-8 without control characters.
bool is_plain_text(std::string_view text);

}  // namespace dupin::detail
