#include "dupin/warp/hexagonal_lattice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dupin {
namespace {

struct Interval {
  double low, high;
};

// What of row y lies within `radius` of the segment: the set is convex, so it is one interval, with
// its ends on the two discs or on the long sides of the strip between them.
bool near_segment(const GridSegment& s, double radius, double y, Interval& found) {
  found = {HUGE_VAL, -HUGE_VAL};
  const auto add_disc = [&](GridPoint c) {
    const double rest = radius * radius - (y - c.y) * (y - c.y);
    if (rest < 0.0) return;
    found.low = std::min(found.low, c.x - std::sqrt(rest));
    found.high = std::max(found.high, c.x + std::sqrt(rest));
  };
  add_disc(s.from);
  add_disc(s.to);
  const double dx = double(s.to.x) - s.from.x, dy = double(s.to.y) - s.from.y;
  const double length = std::hypot(dx, dy);
  if (dy != 0.0 && length > 0.0) {
    for (const double side : {-radius, radius}) {
      const double x0 = s.from.x - side * dy / length, y0 = s.from.y + side * dx / length;
      const double t = (y - y0) / dy;
      if (t < 0.0 || t > 1.0) continue;
      found.low = std::min(found.low, x0 + t * dx);
      found.high = std::max(found.high, x0 + t * dx);
    }
  }
  return found.low <= found.high;
}

class RowEvents {
 public:
  RowEvents(double bottom, double step) : bottom_(bottom), step_(step) {}

  double y(std::int64_t row) const {
    return bottom_ + std::round(static_cast<double>(row) * step_);
  }
  std::int64_t first_row(double low) const {
    return std::max<std::int64_t>(0, std::llround(std::floor((low - bottom_) / step_)));
  }
  std::int64_t last_row(double high) const {
    return std::llround(std::ceil((high - bottom_) / step_));
  }

  struct Event {
    std::int64_t row;
    bool is_crossing;
    Interval at;
  };
  std::vector<Event> events;

 private:
  double bottom_, step_;
};

}  // namespace

std::vector<GridPoint> hexagonal_lattice(const std::vector<GridSegment>& outline,
                                         const std::vector<GridPoint>& pins, double spacing,
                                         double clearance, double pin_clearance) {
  std::vector<GridPoint> points;
  if (outline.empty()) return points;
  std::int32_t left = outline.front().from.x, bottom = outline.front().from.y;
  for (const GridSegment& s : outline) {
    left = std::min(left, s.from.x);
    bottom = std::min(bottom, s.from.y);
  }
  RowEvents rows(bottom, spacing * std::numbers::sqrt3 / 2.0);
  for (const GridSegment& s : outline) {
    const double low = std::min(s.from.y, s.to.y), high = std::max(s.from.y, s.to.y);
    for (std::int64_t row = rows.first_row(low - clearance); row <= rows.last_row(high + clearance);
         ++row) {
      const double y = rows.y(row);
      Interval near{};
      if (near_segment(s, clearance, y, near)) rows.events.push_back({row, false, near});
      if ((s.from.y <= y) != (s.to.y <= y)) {
        const double t = (y - s.from.y) / (double(s.to.y) - s.from.y);
        const double x = s.from.x + t * (double(s.to.x) - s.from.x);
        rows.events.push_back({row, true, {x, x}});
      }
    }
  }
  for (const GridPoint pin : pins) {
    for (std::int64_t row = rows.first_row(pin.y - pin_clearance);
         row <= rows.last_row(pin.y + pin_clearance); ++row) {
      Interval near{};
      if (near_segment({pin, pin}, pin_clearance, rows.y(row), near))
        rows.events.push_back({row, false, near});
    }
  }
  std::sort(rows.events.begin(), rows.events.end(), [](const auto& a, const auto& b) {
    if (a.row != b.row) return a.row < b.row;
    if (a.is_crossing != b.is_crossing) return a.is_crossing;
    if (a.at.low != b.at.low) return a.at.low < b.at.low;
    return a.at.high < b.at.high;
  });
  for (std::size_t i = 0; i < rows.events.size();) {
    const std::int64_t row = rows.events[i].row;
    const std::size_t crossings = i;
    while (i < rows.events.size() && rows.events[i].row == row && rows.events[i].is_crossing) ++i;
    std::size_t blocked = i;
    while (i < rows.events.size() && rows.events[i].row == row) ++i;
    const double start = left + (row % 2 == 0 ? 0.0 : 0.5 * spacing);
    double reached = -HUGE_VAL;
    for (std::size_t c = crossings;
         c + 1 < rows.events.size() && rows.events[c].is_crossing && rows.events[c].row == row;
         c += 2) {
      const double exit = rows.events[c + 1].at.low;
      auto column = std::llround(std::ceil((rows.events[c].at.low - start) / spacing));
      for (;; ++column) {
        const double x = start + std::round(static_cast<double>(column) * spacing);
        if (x >= exit) break;
        for (; blocked < i && rows.events[blocked].at.low <= x; ++blocked)
          reached = std::max(reached, rows.events[blocked].at.high);
        if (x > reached)
          points.push_back(
              {static_cast<std::int32_t>(std::floor(x)), static_cast<std::int32_t>(rows.y(row))});
      }
    }
  }
  return points;
}

}  // namespace dupin
