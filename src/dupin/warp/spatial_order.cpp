#include "dupin/warp/spatial_order.h"

#include <algorithm>

namespace dupin {
namespace {

constexpr std::uint32_t kHilbertBits = 16;

// Distance along Hilbert's curve over cells of 2^16 by 2^16.
std::uint32_t hilbert_index(std::uint32_t x, std::uint32_t y) {
  std::uint32_t index = 0;
  for (std::uint32_t s = 1u << (kHilbertBits - 1); s > 0; s >>= 1) {
    const std::uint32_t rx = (x & s) != 0 ? 1u : 0u, ry = (y & s) != 0 ? 1u : 0u;
    index = (index << 2) | ((3u * rx) ^ ry);
    if (ry == 0) {
      if (rx == 1) {
        x = ~x;
        y = ~y;
      }
      std::swap(x, y);
    }
  }
  return index;
}

// Of N points the last round holds half, the one before a quarter, and so on: round = number of
// leading zeros of a hash, most first.
std::uint64_t round_of(std::uint32_t index) {
  std::uint32_t hash = index * 0x9E3779B9u;
  hash ^= hash >> 16;
  hash *= 0x85EBCA6Bu;
  hash ^= hash >> 13;
  std::uint64_t zeros = 0;
  while (zeros < 15 && (hash & (1u << zeros)) == 0) ++zeros;
  return 15 - zeros;
}

}  // namespace

std::vector<std::int32_t> spatial_order(const std::vector<GridPoint>& points, GridPoint low,
                                        GridPoint high) {
  struct Entry {
    std::uint64_t key;
    std::int32_t index;
  };
  const std::int64_t extent =
      std::max<std::int64_t>({1, std::int64_t{high.x} - low.x, std::int64_t{high.y} - low.y});
  const auto cell = [&](std::int32_t value, std::int32_t least) {
    return static_cast<std::uint32_t>(((std::int64_t{value} - least) * 65535) / extent);
  };
  std::vector<Entry> entries(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t place = hilbert_index(cell(points[i].x, low.x), cell(points[i].y, low.y));
    entries[i] = {round_of(static_cast<std::uint32_t>(i)) << 32 | place,
                  static_cast<std::int32_t>(i)};
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return a.key != b.key ? a.key < b.key : a.index < b.index;
  });
  std::vector<std::int32_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = entries[i].index;
  return order;
}

}  // namespace dupin
