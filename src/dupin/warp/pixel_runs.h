#pragma once

// Parts of a binary picture as runs of pixels, and the loops around them.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dupin::detail {

/// Inside pixels [begin, end) of one row.
struct PixelRun {
  std::int32_t begin = 0;
  std::int32_t end = 0;
};

/// A 4-connected part.
struct PixelPart {
  std::int32_t num_pixels = 0;  ///< at most 32768^2
  bool is_thin = true;          ///< no block of 2 by 2 pixels is inside
};

/// Which part each run of a picture belongs to. The runs themselves are found again in the rows
/// when they are wanted: of a noisy picture they would take as much memory as the picture.
struct PixelParts {
  std::vector<std::int32_t> row_begin;  ///< height + 1: number of the first run of each row
  std::vector<std::int32_t> of_run;     ///< part of each run
  std::vector<PixelPart> parts;         ///< in the order of their first pixels
};

/// Joins the runs of one row after the other to parts (union-find).
class PartJoiner {
 public:
  explicit PartJoiner(std::int32_t height);
  void add_row(const std::vector<PixelRun>& row);
  /// All parts, still without their sizes.
  PixelParts finish();

 private:
  PixelParts result_;  // of_run: an earlier run of the same part, or the run itself
  std::vector<PixelRun> above_;
  std::vector<bool> is_thick_;  // by run
};

/// A bit for every pixel.
class PixelBits {
 public:
  PixelBits(std::int32_t width, std::int32_t height)
      : width_(width), bits_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}
  bool holds(std::int32_t x, std::int32_t y) const { return bits_[place(x, y)]; }
  /// False if it was set before.
  bool set(std::int32_t x, std::int32_t y) {
    if (bits_[place(x, y)]) return false;
    bits_[place(x, y)] = true;
    return true;
  }

 private:
  std::size_t place(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  std::int32_t width_;
  std::vector<bool> bits_;
};

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
