#include "dupin/warp/pixel_runs.h"

namespace dupin::detail {
namespace {

std::int32_t root_of(std::vector<std::int32_t>& parent, std::int32_t run) {
  auto at = static_cast<std::size_t>(run);
  while (parent[at] != static_cast<std::int32_t>(at)) {
    parent[at] = parent[static_cast<std::size_t>(parent[at])];
    at = static_cast<std::size_t>(parent[at]);
  }
  return static_cast<std::int32_t>(at);
}

}  // namespace

void join_runs(PixelRuns& runs) {
  std::vector<std::int32_t> parent(runs.runs.size());
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = static_cast<std::int32_t>(i);
  std::vector<bool> is_thick(runs.runs.size(), false);
  for (std::size_t y = 1; y < static_cast<std::size_t>(runs.height); ++y) {
    auto above = static_cast<std::size_t>(runs.row_begin[y - 1]);
    auto below = static_cast<std::size_t>(runs.row_begin[y]);
    const auto above_end = static_cast<std::size_t>(runs.row_begin[y]);
    const auto below_end = static_cast<std::size_t>(runs.row_begin[y + 1]);
    while (above < above_end && below < below_end) {
      const PixelRun& a = runs.runs[above];
      const PixelRun& b = runs.runs[below];
      const std::int32_t shared = std::min(a.end, b.end) - std::max(a.begin, b.begin);
      if (shared > 0) {
        // The smaller index is the root, so a root is the first run of its part.
        const std::int32_t one = root_of(parent, static_cast<std::int32_t>(above));
        const std::int32_t other = root_of(parent, static_cast<std::int32_t>(below));
        parent[static_cast<std::size_t>(std::max(one, other))] = std::min(one, other);
        if (shared > 1) is_thick[below] = true;
      }
      // The run that ends first has met all its neighbours.
      if (a.end < b.end) {
        ++above;
      } else if (b.end < a.end) {
        ++below;
      } else {
        ++above;
        ++below;
      }
    }
  }
  for (std::size_t i = 0; i < parent.size(); ++i) {
    const auto root = static_cast<std::size_t>(root_of(parent, static_cast<std::int32_t>(i)));
    if (root == i) {
      runs.runs[i].part = static_cast<std::int32_t>(runs.parts.size());
      runs.parts.push_back({0, static_cast<std::int32_t>(i), true});
    } else {
      runs.runs[i].part = runs.runs[root].part;
    }
    PixelPart& part = runs.parts[static_cast<std::size_t>(runs.runs[i].part)];
    part.num_pixels += runs.runs[i].end - runs.runs[i].begin;
    if (is_thick[i]) part.is_thin = false;
  }
}

}  // namespace dupin::detail
