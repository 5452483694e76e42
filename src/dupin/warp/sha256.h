#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace dupin {

/// SHA-256 of `bytes` (FIPS 180-4) as 64 lower-case hexadecimal digits. A pure function, also in
/// the browser; not meant for secrets. Cost: O(bytes).
std::string sha256_hex(std::span<const std::uint8_t> bytes);
std::string sha256_hex(std::string_view bytes);

}  // namespace dupin
