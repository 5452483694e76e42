#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dupin/base/warning.h"
#include "dupin/io/read_options.h"

namespace dupin::detail {

enum class PlyType : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

std::int64_t size_of(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::f32;
  bool is_list = false;
  PlyType count_type = PlyType::u8;
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::int64_t line = 0;
  std::vector<PlyProperty> properties;

  /// Position of a property, or -1.
  std::ptrdiff_t find(const char* property) const;
  /// Smallest size of one record: a list without values.
  std::int64_t least_binary_bytes() const;
  std::int64_t least_ascii_bytes() const;
  bool has_lists() const;
};

enum class PlyEncoding { ascii, little_endian, big_endian };

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::ascii;
  std::vector<PlyElement> elements;
  std::size_t body = 0;         ///< offset of the first byte after the header
  std::int64_t first_line = 1;  ///< line of that byte
  bool has_bom = false;
};

/// @throws IoError E_MAGIC, E_HEADER, E_TRUNCATED, E_NUMBER_RANGE, E_LIST_COUNT, E_LINE_TOO_LONG
PlyHeader parse_ply_header(std::span<const std::uint8_t> bytes, const std::string& name,
                           const ReadLimits& limits);

}  // namespace dupin::detail
