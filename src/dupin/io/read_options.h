#pragma once

#include <cstdint>
#include <string>

namespace dupin {

/// What a reader may spend. Every limit has a --max-... option in the program.
struct ReadLimits {
  std::int64_t max_file_bytes = std::int64_t{1} << 30;
  std::int64_t max_vertices = 20'000'000;
  std::int64_t max_faces = 40'000'000;
  std::int64_t max_polygon = 10'000;
  std::int64_t max_line_bytes = std::int64_t{1} << 20;
  int max_nesting = 64;
  std::int64_t max_expansion_ratio = 100;
  std::int64_t max_expanded_bytes = std::int64_t{1} << 30;
  std::int64_t max_image_pixels = 64'000'000;
};

struct ReadOptions {
  ReadLimits limits;
  /// Format of standard input where its content does not tell, as an extension does of a file:
  /// "xyz"
  std::string stdin_format = {};
  bool drop_nonfinite = false;  ///< leave NaN and Inf in the points for heal() to drop
  double max_depth_jump =
      0.0;  ///< range grids: longest edge kept [mu]; 0: from the grid (see mesh/range_grid.h)
};

}  // namespace dupin
