#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

namespace dupin::detail {

template <class T>
using Bits = std::conditional_t<
    sizeof(T) == 1, std::uint8_t,
    std::conditional_t<sizeof(T) == 2, std::uint16_t,
                       std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;

inline std::uint8_t swapped(std::uint8_t bits) { return bits; }
inline std::uint16_t swapped(std::uint16_t bits) { return __builtin_bswap16(bits); }
inline std::uint32_t swapped(std::uint32_t bits) { return __builtin_bswap32(bits); }
inline std::uint64_t swapped(std::uint64_t bits) { return __builtin_bswap64(bits); }

template <class T, bool kSwap>
T load(const std::uint8_t* at) {
  Bits<T> bits{};
  std::memcpy(&bits, at, sizeof(T));
  if constexpr (kSwap) bits = swapped(bits);
  return std::bit_cast<T>(bits);
}

/// A T at `at`, of the other byte order if kSwap, as a double.
/// A signalling NaN becomes a quiet one bit by bit: converting it would raise the invalid flag.
template <class T, bool kSwap>
double load_real(const std::uint8_t* at) {
  const T value = load<T, kSwap>(at);
  if constexpr (std::is_floating_point_v<T>) {
    constexpr int kMantissa = std::numeric_limits<T>::digits - 1;
    const Bits<T> bits = std::bit_cast<Bits<T>>(value);
    const Bits<T> infinity = std::bit_cast<Bits<T>>(std::numeric_limits<T>::infinity());
    if ((bits & infinity) == infinity && (bits << (sizeof(T) * 8 - kMantissa)) != 0) {
      return std::numeric_limits<double>::quiet_NaN();
    }
  }
  return static_cast<double>(value);
}

}  // namespace dupin::detail
