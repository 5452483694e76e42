#pragma once

// Parts of a binary picture as runs of pixels, and the loops around them.

#include <algorithm>
#include <cstdint>
#include <vector>

namespace dupin::detail {

/// Inside pixels [begin, end) of one row.
struct PixelRun {
  std::int32_t begin = 0;
  std::int32_t end = 0;
  std::int32_t part = 0;  ///< of PixelRuns::parts
};

/// A 4-connected part.
struct PixelPart {
  std::int64_t num_pixels = 0;
  std::int32_t first_run = 0;
  bool is_thin = true;  ///< no block of 2 by 2 pixels is inside
};

struct PixelRuns {
  int width = 0;
  int height = 0;
  std::vector<PixelRun> runs;
  std::vector<std::int32_t> row_begin;  ///< height + 1: first run of each row
  std::vector<PixelPart> parts;         ///< in the order of their first pixels
};

/// Joins runs of neighbouring rows; `runs` and `row_begin` are there, the rest is filled in.
void join_runs(PixelRuns& runs);

/// The run that holds inside pixel (x, y).
inline std::int32_t run_at(const PixelRuns& runs, std::int32_t x, std::int32_t y) {
  const auto* const first = runs.runs.data() + runs.row_begin[static_cast<std::size_t>(y)];
  const auto* const last = runs.runs.data() + runs.row_begin[static_cast<std::size_t>(y) + 1];
  const auto* const after = std::upper_bound(
      first, last, x, [](std::int32_t value, const PixelRun& run) { return value < run.begin; });
  return static_cast<std::int32_t>(after - runs.runs.data()) - 1;
}

/// One side of an inside pixel behind which lies an outside pixel, passed with the inside on the
/// right as the picture is looked at.
struct BorderStep {
  std::int32_t x = 0;  ///< inside pixel
  std::int32_t y = 0;
  int side = 0;  ///< 0 left (going up), 1 top (going right), 2 right (down), 3 bottom (left)
};

inline constexpr int kOutwardX[4] = {-1, 0, 1, 0};
inline constexpr int kOutwardY[4] = {0, -1, 0, 1};

/// The step after `step` on its loop. Diagonal contacts are passed so that the inside pixels stay
/// apart. `is_inside(x, y)` must hold for pixels beyond the picture too.
template <class IsInside>
BorderStep next_step(const BorderStep& step, const IsInside& is_inside) {
  // Straight on lies the inside pixel one further along the side, or, if the pixel outward of that
  // is inside too, the border turns left.
  const int along_x = kOutwardX[(step.side + 1) % 4];
  const int along_y = kOutwardY[(step.side + 1) % 4];
  const std::int32_t ahead_x = step.x + along_x;
  const std::int32_t ahead_y = step.y + along_y;
  if (!is_inside(ahead_x, ahead_y)) return {step.x, step.y, (step.side + 1) % 4};
  const std::int32_t left_x = ahead_x + kOutwardX[step.side];
  const std::int32_t left_y = ahead_y + kOutwardY[step.side];
  if (!is_inside(left_x, left_y)) return {ahead_x, ahead_y, step.side};
  return {left_x, left_y, (step.side + 3) % 4};
}

}  // namespace dupin::detail
