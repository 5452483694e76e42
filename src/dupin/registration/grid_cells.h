#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin::detail {

/// Box between the hundredths of every coordinate: a few stray points far away are no part of the
/// object. `points` must not be empty.
struct CoreBox {
  Eigen::RowVector3d low = Eigen::RowVector3d::Zero();   ///< [mu]
  Eigen::RowVector3d high = Eigen::RowVector3d::Zero();  ///< [mu]

  Eigen::RowVector3d size() const { return high - low; }
};
CoreBox core_box(const Points& points);

/// Points by the cells of a cubic grid about the middle of their core box. Points beyond a million
/// cells from it share the outermost ones.
struct GridCells {
  Eigen::Index count = 0;             ///< occupied cells
  std::vector<std::int32_t> cell_of;  ///< #V: number of the cell, by place; -1: left out
  std::vector<float> off_center;      ///< #V: squared distance from the centre, in cells
};

/// Cost: O(V log V).
GridCells grid_cells(const Points& points, double step);

}  // namespace dupin::detail
