#include "dupin/warp/loop_nesting.h"

#include <algorithm>
#include <cstdint>
#include <tuple>

#include "dupin/warp/exact_predicates.h"

namespace dupin {
namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

struct Box {
  GridPoint low, high;
  bool holds(GridPoint p) const {
    return p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y;
  }
};

Box box_of(const std::vector<GridPoint>& loop) {
  Box box{loop.front(), loop.front()};
  for (const GridPoint p : loop) {
    box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y)};
    box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y)};
  }
  return box;
}

// A loop with its edges sorted into rows, so that a point meets those near its height only.
class RowedLoop {
 public:
  explicit RowedLoop(const std::vector<GridPoint>& loop) : loop_(loop), low_(loop.front().y) {
    std::int64_t high = low_;
    std::int64_t climbed = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      low_ = std::min<std::int64_t>(low_, loop[i].y);
      high = std::max<std::int64_t>(high, loop[i].y);
      climbed += std::abs(std::int64_t{next(i).y} - loop[i].y);
    }
    // So high that no more than three rows a corner are entered, however the edges run.
    row_height_ = climbed / static_cast<std::int64_t>(loop.size()) + 1;
    begin_.assign(at((high - low_) / row_height_) + 2, 0);
    const auto for_each = [&](const auto& take) {
      for (std::size_t i = 0; i < loop.size(); ++i) {
        const std::size_t first = row(std::min(loop[i].y, next(i).y));
        const std::size_t last = row(std::max(loop[i].y, next(i).y));
        for (std::size_t r = first; r <= last; ++r) take(r, i);
      }
    };
    for_each([&](std::size_t r, std::size_t) { ++begin_[r + 1]; });
    for (std::size_t r = 1; r < begin_.size(); ++r) begin_[r] += begin_[r - 1];
    edge_.resize(begin_.back());
    std::vector<std::size_t> slot(begin_.begin(), begin_.end() - 1);
    for_each([&](std::size_t r, std::size_t i) { edge_[slot[r]++] = i; });
  }

  /// `p` lies in the box of the loop.
  bool holds(GridPoint p) const {
    bool is_inside = false;
    const std::size_t r = row(p.y);
    for (std::size_t k = begin_[r]; k < begin_[r + 1]; ++k) {
      const GridPoint a = loop_[edge_[k]];
      const GridPoint b = next(edge_[k]);
      if ((a.y <= p.y) != (b.y <= p.y) && (orientation(a, b, p) > 0) == (b.y > a.y))
        is_inside = !is_inside;
    }
    return is_inside;
  }

 private:
  GridPoint next(std::size_t i) const { return loop_[i + 1 < loop_.size() ? i + 1 : 0]; }
  std::size_t row(std::int32_t y) const { return at((y - low_) / row_height_); }

  const std::vector<GridPoint>& loop_;
  std::int64_t low_;
  std::int64_t row_height_ = 1;
  std::vector<std::size_t> begin_;  // of each row, into edge_
  std::vector<std::size_t> edge_;
};

// Boxes in cells that are at least as large as they, so that each is in four cells at most and a
// point asks one cell of each size.
class BoxCells {
 public:
  explicit BoxCells(const std::vector<Box>& boxes) {
    for (std::size_t m = 0; m < boxes.size(); ++m) {
      const Box& box = boxes[m];
      const std::int64_t extent =
          std::max(std::int64_t{box.high.x} - box.low.x, std::int64_t{box.high.y} - box.low.y);
      int level = 0;
      while ((std::int64_t{1} << level) < extent) ++level;
      for (std::int32_t x = box.low.x >> level; x <= box.high.x >> level; ++x) {
        for (std::int32_t y = box.low.y >> level; y <= box.high.y >> level; ++y)
          cells_.push_back({level, x, y, m});
      }
    }
    std::sort(cells_.begin(), cells_.end());
    for (const Cell& cell : cells_) {
      if (levels_.empty() || levels_.back() != cell.level) levels_.push_back(cell.level);
    }
  }

  /// Calls take(number) for all boxes whose cell holds `p`, each once.
  template <class Take>
  void near(GridPoint p, const Take& take) const {
    for (const int level : levels_) {
      Cell cell{level, p.x >> level, p.y >> level, 0};
      auto found = std::lower_bound(cells_.begin(), cells_.end(), cell);
      for (; found != cells_.end() && found->place() == cell.place(); ++found) take(found->box);
    }
  }

 private:
  struct Cell {
    int level;
    std::int32_t x, y;
    std::size_t box;
    std::tuple<int, std::int32_t, std::int32_t> place() const { return {level, x, y}; }
    bool operator<(const Cell& other) const {
      return std::tie(level, x, y, box) < std::tie(other.level, other.x, other.y, other.box);
    }
  };
  std::vector<Cell> cells_;
  std::vector<int> levels_;
};

}  // namespace

std::vector<std::vector<std::size_t>> loops_around(
    const std::vector<std::vector<GridPoint>>& loops) {
  std::vector<Box> boxes;
  std::vector<RowedLoop> rowed;
  boxes.reserve(loops.size());
  rowed.reserve(loops.size());
  for (const std::vector<GridPoint>& loop : loops) {
    boxes.push_back(box_of(loop));
    rowed.emplace_back(loop);
  }
  const BoxCells cells(boxes);
  std::vector<std::vector<std::size_t>> around(loops.size());
  for (std::size_t l = 0; l < loops.size(); ++l) {
    const GridPoint p = loops[l].front();
    cells.near(p, [&](std::size_t m) {
      if (m != l && boxes[m].holds(p) && rowed[m].holds(p)) around[l].push_back(m);
    });
    std::sort(around[l].begin(), around[l].end());
  }
  return around;
}

}  // namespace dupin
