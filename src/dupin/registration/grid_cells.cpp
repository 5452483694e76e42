#include "dupin/registration/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dupin::detail {

using Eigen::Index;
using Eigen::RowVector3d;
using std::size_t;

CoreBox core_box(const Points& points) {
  CoreBox box;
  std::vector<double> values(static_cast<size_t>(points.rows()));
  const auto hundredth = static_cast<std::ptrdiff_t>(values.size() / 100);
  for (Index k = 0; k < 3; ++k) {
    for (Index i = 0; i < points.rows(); ++i) values[static_cast<size_t>(i)] = points(i, k);
    const auto low = values.begin() + hundredth;
    const auto high = values.end() - 1 - hundredth;
    std::nth_element(values.begin(), low, values.end());
    box.low[k] = *low;
    std::nth_element(values.begin(), high, values.end());
    box.high[k] = *high;
  }
  return box;
}

GridCells grid_cells(const Points& points, double step) {
  constexpr double kCells = 2097152.0;  // 21 bits an axis
  GridCells cells;
  if (points.rows() == 0) return cells;
  const CoreBox box = core_box(points);
  const RowVector3d origin = 0.5 * (box.low + box.high);
  std::vector<std::pair<std::uint64_t, std::int32_t>> keys(static_cast<size_t>(points.rows()));
  cells.off_center.resize(keys.size());
  for (Index i = 0; i < points.rows(); ++i) {
    std::uint64_t key = 0;
    double away = 0.0;
    for (Index k = 0; k < 3; ++k) {
      const double at =
          std::clamp((points(i, k) - origin[k]) / step + 0.5 * kCells, 0.0, kCells - 1.0);
      const double cell = std::floor(at);
      key = key << 21U | static_cast<std::uint64_t>(cell);
      away += (at - cell - 0.5) * (at - cell - 0.5);
    }
    keys[static_cast<size_t>(i)] = {key, static_cast<std::int32_t>(i)};
    cells.off_center[static_cast<size_t>(i)] = static_cast<float>(away);
  }
  std::sort(keys.begin(), keys.end());
  cells.cell_of.resize(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    if (i == 0 || keys[i].first != keys[i - 1].first) ++cells.count;
    cells.cell_of[static_cast<size_t>(keys[i].second)] = static_cast<std::int32_t>(cells.count - 1);
  }
  return cells;
}

}  // namespace dupin::detail
