#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dupin::detail {

/// Expands LZF data (the format of liblzf) to exactly `expanded_size` bytes. False if the data are
/// damaged, end early, or make another number of bytes.
bool expand_lzf(std::span<const std::uint8_t> data, std::size_t expanded_size,
                std::vector<std::uint8_t>& output);

}  // namespace dupin::detail
