#include "dupin/warp/edge_crossings.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace dupin {
namespace {

int sign(std::int64_t value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

bool lies_between(GridPoint p, const GridSegment& s) {
  return orientation(s.from, s.to, p) == 0 && dot(p, s.from, s.to) <= 0;
}

bool meet(const GridSegment& a, const GridSegment& b) {
  const int a_from = sign(orientation(b.from, b.to, a.from)),
            a_to = sign(orientation(b.from, b.to, a.to));
  const int b_from = sign(orientation(a.from, a.to, b.from)),
            b_to = sign(orientation(a.from, a.to, b.to));
  if (a_from * a_to < 0 && b_from * b_to < 0) return true;
  return lies_between(a.from, b) || lies_between(a.to, b) || lies_between(b.from, a) ||
         lies_between(b.to, a);
}

// `second` starts where `first` ends.
bool overlap(const GridSegment& first, const GridSegment& second) {
  return orientation(first.from, first.to, second.to) == 0 &&
         dot(first.to, first.from, second.to) > 0;
}

struct Entry {
  std::uint64_t cell;
  std::int32_t segment;
};

std::vector<Entry> bucket(const std::vector<GridSegment>& segments) {
  double extent = 0.0;
  std::int32_t left = INT32_MAX, bottom = INT32_MAX;
  for (const GridSegment& s : segments) {
    extent += std::abs(double(s.to.x) - s.from.x) + std::abs(double(s.to.y) - s.from.y);
    left = std::min({left, s.from.x, s.to.x});
    bottom = std::min({bottom, s.from.y, s.to.y});
  }
  const double size = std::max(1.0, extent / static_cast<double>(segments.size()));
  const auto cell_of = [&](double value, std::int32_t least) {
    return static_cast<std::int64_t>(std::floor((value - least) / size));
  };
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    GridSegment s = segments[i];
    if (s.from.y > s.to.y) std::swap(s.from, s.to);
    const std::int64_t top = cell_of(s.to.y, bottom);
    const double slope =
        s.to.y == s.from.y ? 0.0 : (double(s.to.x) - s.from.x) / (double(s.to.y) - s.from.y);
    for (std::int64_t row = cell_of(s.from.y, bottom); row <= top; ++row) {
      // The part of the segment in this row of cells, a step wider on both sides against rounding.
      const double low = std::max<double>(s.from.y, bottom + static_cast<double>(row) * size);
      const double high = std::min<double>(s.to.y, bottom + static_cast<double>(row + 1) * size);
      double x0 = s.from.x, x1 = s.to.x;
      if (slope != 0.0) {
        x0 = s.from.x + slope * (low - s.from.y);
        x1 = s.from.x + slope * (high - s.from.y);
      }
      if (x0 > x1) std::swap(x0, x1);
      const std::int64_t last = cell_of(x1 + 1.0, left);
      for (std::int64_t column = std::max<std::int64_t>(0, cell_of(x0 - 1.0, left)); column <= last;
           ++column)
        entries.push_back(
            {static_cast<std::uint64_t>(row) << 32 | static_cast<std::uint64_t>(column),
             static_cast<std::int32_t>(i)});
    }
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.segment < b.segment;
  });
  return entries;
}

}  // namespace

std::vector<std::pair<std::int32_t, std::int32_t>> find_edge_crossings(
    const std::vector<GridSegment>& segments, const std::vector<std::int32_t>& next) {
  std::vector<std::pair<std::int32_t, std::int32_t>> found;
  if (segments.empty()) return found;
  const std::vector<Entry> entries = bucket(segments);
  for (std::size_t first = 0; first < entries.size();) {
    std::size_t end = first;
    while (end < entries.size() && entries[end].cell == entries[first].cell) ++end;
    for (std::size_t i = first; i < end; ++i) {
      for (std::size_t j = i + 1; j < end; ++j) {
        const std::int32_t a = entries[i].segment, b = entries[j].segment;
        const auto index = [](std::int32_t k) { return static_cast<std::size_t>(k); };
        const GridSegment &sa = segments[index(a)], &sb = segments[index(b)];
        const bool a_then_b = next[index(a)] == b, b_then_a = next[index(b)] == a;
        const bool is_hit = a_then_b || b_then_a
                                ? (a_then_b && overlap(sa, sb)) || (b_then_a && overlap(sb, sa))
                                : meet(sa, sb);
        if (is_hit) found.emplace_back(a, b);
      }
    }
    first = end;
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace dupin
