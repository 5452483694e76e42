#pragma once

#include <bit>
#include <cstdint>

namespace dupin::detail {

/// The unsigned number in `size` <= 8 bytes, lowest first.
inline std::uint64_t load_le(const std::uint8_t* bytes, int size) {
  std::uint64_t value = 0;
  for (int i = 0; i < size; ++i) value |= std::uint64_t{bytes[i]} << (8 * i);
  return value;
}

/// The IEEE double with these bits; NaNs come back quiet, because a signalling one would trap
/// wherever it is touched first.
inline double double_from_bits(std::uint64_t bits) {
  constexpr std::uint64_t exponent = 0x7FF0000000000000ULL;
  constexpr std::uint64_t fraction = 0x000FFFFFFFFFFFFFULL;
  if ((bits & exponent) == exponent && (bits & fraction) != 0) bits |= 0x0008000000000000ULL;
  return std::bit_cast<double>(bits);
}

/// The IEEE float with these bits, NaNs quiet.
inline double float_from_bits(std::uint32_t bits) {
  if ((bits & 0x7F800000U) == 0x7F800000U && (bits & 0x007FFFFFU) != 0) bits |= 0x00400000U;
  return static_cast<double>(std::bit_cast<float>(bits));
}

/// The signed number in the lowest `size` <= 8 bytes of `bits`.
inline std::int64_t signed_from_bits(std::uint64_t bits, int size) {
  const int shift = 64 - 8 * size;
  return static_cast<std::int64_t>(bits << shift) >> shift;
}

}  // namespace dupin::detail
