#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin {

/// The picture of a range camera: one point a pixel, some of them invalid. Pixel (row, col) is
/// entry row * cols + col of `points` and `is_valid`.
struct RangeGrid {
  Eigen::Index rows = 0;
  Eigen::Index cols = 0;
  Points points;                       ///< rows * cols by 3 [mu]; anything where invalid
  std::vector<std::uint8_t> is_valid;  ///< rows * cols
};

/// Options of triangulate_range_grid().
struct RangeGridOptions {
  double max_depth_jump = 0.0;  ///< longest edge kept [mu], > 0; 0: 5 x the median length of the
                                ///< edges between valid neighbours in a row or column
};

/// The surface that `grid` samples. Vertices are the valid pixels, in row order, all of them, also
/// those that no triangle uses. Each 2 x 2 cell of valid pixels is split along its shorter
/// diagonal (the one from its first pixel on a tie), a cell with three gives one triangle; a
/// triangle is kept when its longest edge is at most the depth jump, because a longer one bridges
/// two surfaces. All triangles have one orientation in the grid, the one in which their areas
/// projected along z sum to a positive number: the scanner looks along -z.
///
/// @throws InvalidArgument if rows * cols does not fit the arrays or 32 bits, a valid point is not
///   finite, or an option is outside its range
/// Cost: O(rows * cols), about 40 bytes a pixel.
PolygonMesh triangulate_range_grid(const RangeGrid& grid, const RangeGridOptions& options = {});

}  // namespace dupin
