#include "dupin/io/lzf.h"

namespace dupin::detail {

// A byte below 32 announces that many plus one literal bytes. Any other is the start of a copy:
// three bits of length (7: one more byte of it follows), then thirteen bits of distance.
bool expand_lzf(std::span<const std::uint8_t> data, std::size_t expanded_size,
                std::vector<std::uint8_t>& output) {
  output.clear();
  output.reserve(expanded_size);
  std::size_t at = 0;
  while (at < data.size()) {
    const std::size_t control = data[at++];
    if (control < 32) {
      const std::size_t length = control + 1;
      if (length > data.size() - at || length > expanded_size - output.size()) return false;
      output.insert(output.end(), data.begin() + static_cast<std::ptrdiff_t>(at),
                    data.begin() + static_cast<std::ptrdiff_t>(at + length));
      at += length;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) {
      if (at == data.size()) return false;
      length += data[at++];
    }
    length += 2;
    if (at == data.size()) return false;
    const std::size_t distance = ((control & 31) << 8 | data[at++]) + 1;
    if (distance > output.size() || length > expanded_size - output.size()) return false;
    // Byte by byte: a copy may overlap what it makes.
    for (std::size_t i = 0; i < length; ++i) output.push_back(output[output.size() - distance]);
  }
  return output.size() == expanded_size;
}

}  // namespace dupin::detail
