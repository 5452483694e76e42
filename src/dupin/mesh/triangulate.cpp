#include "dupin/mesh/triangulate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

using Corners = std::array<int32_t, 3>;

double cross(const RowVector2d& a, const RowVector2d& b, const RowVector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Twice the area under which a corner counts as straight.
double straight(const RowVector2d& a, const RowVector2d& b, const RowVector2d& c) {
  const double longest =
      std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return 2.0 * kDegenerateArea * longest;
}

// Corners that are not strictly convex, bucketed over the bounding box: only they can lie in an
// ear.
class BlockerGrid {
 public:
  BlockerGrid(const std::vector<RowVector2d>& points, const std::vector<int32_t>& blockers) {
    low_ = points[0];
    RowVector2d high = points[0];
    for (const RowVector2d& p : points) {
      low_ = low_.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    side_ = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(blockers.size()))));
    for (Index k = 0; k < 2; ++k) {
      const double extent = high(k) - low_(k);
      cells_per_length_(k) = extent > 0.0 ? side_ / extent : 0.0;
    }
    offset_.assign(static_cast<size_t>(side_ * side_) + 1, 0);
    for (const int32_t i : blockers) ++offset_[cell_of(points[static_cast<size_t>(i)]) + 1];
    for (size_t c = 1; c < offset_.size(); ++c) offset_[c] += offset_[c - 1];
    member_.resize(blockers.size());
    std::vector<int32_t> cursor(offset_.begin(), offset_.end() - 1);
    for (const int32_t i : blockers) {
      member_[static_cast<size_t>(cursor[cell_of(points[static_cast<size_t>(i)])]++)] = i;
    }
  }

  // Whether `test(i)` holds for a member of a cell that the box low..high touches.
  template <typename Test>
  bool any(const RowVector2d& low, const RowVector2d& high, const Test& test) const {
    for (int y = cell(low, 1); y <= cell(high, 1); ++y) {
      const auto row = static_cast<size_t>(y * side_);
      const auto first = offset_[row + static_cast<size_t>(cell(low, 0))];
      const auto last = offset_[row + static_cast<size_t>(cell(high, 0)) + 1];
      for (int32_t k = first; k < last; ++k) {
        if (test(member_[static_cast<size_t>(k)])) return true;
      }
    }
    return false;
  }

 private:
  int cell(const RowVector2d& p, Index axis) const {
    const double position = (p(axis) - low_(axis)) * cells_per_length_(axis);
    return static_cast<int>(std::clamp(position, 0.0, side_ - 1.0));
  }
  size_t cell_of(const RowVector2d& p) const {
    return static_cast<size_t>(cell(p, 1) * side_ + cell(p, 0));
  }

  RowVector2d low_;
  RowVector2d cells_per_length_;
  int side_ = 1;
  std::vector<int32_t> offset_;
  std::vector<int32_t> member_;
};

class EarClipper {
 public:
  explicit EarClipper(std::vector<RowVector2d> points)
      : points_(std::move(points)),
        count_(static_cast<int32_t>(points_.size())),
        remaining_(count_),
        grid_(points_, prepare()) {}

  // Triangles as positions in `points`; true if the polygon turned out to cross itself.
  bool run(std::vector<Corners>& triangles) {
    // A corner whose neighbour has just gone waits for the next round, which keeps triangles of
    // convex polygons fat: every round takes every other corner.
    while (remaining_ > 3) {
      if (clip_round(Containment::closed, triangles)) continue;
      if (clip_round(Containment::open, triangles)) continue;
      add_fan(triangles);
      return true;
    }
    int32_t at = 0;
    while (is_removed_[static_cast<size_t>(at)] != 0) ++at;
    triangles.push_back({at, next(at), next(next(at))});
    return false;
  }

 private:
  // closed: a corner on the rim of an ear blocks it. open: only one inside does, for polygons that
  // touch themselves.
  enum class Containment { closed, open };

  const RowVector2d& p(int32_t i) const { return points_[static_cast<size_t>(i)]; }
  int32_t next(int32_t i) const { return next_[static_cast<size_t>(i)]; }
  int32_t previous(int32_t i) const { return previous_[static_cast<size_t>(i)]; }

  bool is_convex(int32_t i) const {
    const RowVector2d& a = p(previous(i));
    const RowVector2d& c = p(next(i));
    return cross(a, p(i), c) > straight(a, p(i), c);
  }

  std::vector<int32_t> prepare() {
    const auto n = static_cast<size_t>(count_);
    next_.resize(n);
    previous_.resize(n);
    is_removed_.assign(n, 0);
    is_blocker_.assign(n, 0);
    stamp_.assign(n, 0);
    for (int32_t i = 0; i < count_; ++i) {
      next_[static_cast<size_t>(i)] = i + 1 < count_ ? i + 1 : 0;
      previous_[static_cast<size_t>(i)] = i > 0 ? i - 1 : count_ - 1;
    }
    std::vector<int32_t> blockers;
    for (int32_t i = 0; i < count_; ++i) {
      if (is_convex(i)) continue;
      is_blocker_[static_cast<size_t>(i)] = 1;
      blockers.push_back(i);
    }
    return blockers;
  }

  bool blocks(int32_t i, int32_t tip, Containment containment) const {
    if (is_removed_[static_cast<size_t>(i)] != 0 || is_blocker_[static_cast<size_t>(i)] == 0) {
      return false;
    }
    const RowVector2d& a = p(previous(tip));
    const RowVector2d& b = p(tip);
    const RowVector2d& c = p(next(tip));
    const RowVector2d& q = p(i);
    if (q == a || q == b || q == c) return false;
    const double tolerance = straight(a, b, c);
    const double least = containment == Containment::closed ? -tolerance : tolerance;
    return cross(a, b, q) >= least && cross(b, c, q) >= least && cross(c, a, q) >= least;
  }

  bool is_ear(int32_t tip, Containment containment) const {
    if (!is_convex(tip)) return false;
    const RowVector2d& a = p(previous(tip));
    const RowVector2d& b = p(tip);
    const RowVector2d& c = p(next(tip));
    const RowVector2d low = a.cwiseMin(b).cwiseMin(c);
    const RowVector2d high = a.cwiseMax(b).cwiseMax(c);
    return !grid_.any(low, high, [&](int32_t i) { return blocks(i, tip, containment); });
  }

  void requeue(int32_t i) {
    if (is_blocker_[static_cast<size_t>(i)] != 0 && is_convex(i)) {
      is_blocker_[static_cast<size_t>(i)] = 0;
    }
    queue_.emplace_back(i, ++stamp_[static_cast<size_t>(i)]);
  }

  // Clips until no corner in the queue is an ear. Clipping changes the state of the two neighbours
  // only, so nothing else has to be looked at again.
  bool clip_round(Containment containment, std::vector<Corners>& triangles) {
    queue_.clear();
    for (int32_t i = 0; i < count_; ++i) {
      if (is_removed_[static_cast<size_t>(i)] == 0) queue_.emplace_back(i, ++stamp_[size_t(i)]);
    }
    bool has_clipped = false;
    while (!queue_.empty() && remaining_ > 3) {
      const auto [i, stamp] = queue_.front();
      queue_.pop_front();
      if (is_removed_[static_cast<size_t>(i)] != 0 || stamp != stamp_[static_cast<size_t>(i)] ||
          !is_ear(i, containment)) {
        continue;
      }
      const int32_t before = previous(i);
      const int32_t after = next(i);
      triangles.push_back({before, i, after});
      is_removed_[static_cast<size_t>(i)] = 1;
      next_[static_cast<size_t>(before)] = after;
      previous_[static_cast<size_t>(after)] = before;
      --remaining_;
      requeue(before);
      requeue(after);
      has_clipped = true;
    }
    return has_clipped;
  }

  void add_fan(std::vector<Corners>& triangles) {
    int32_t hub = 0;
    while (is_removed_[static_cast<size_t>(hub)] != 0) ++hub;
    for (int32_t i = next(hub); next(i) != hub; i = next(i)) triangles.push_back({hub, i, next(i)});
  }

  std::vector<RowVector2d> points_;
  int32_t count_ = 0;
  int32_t remaining_ = 0;
  std::vector<int32_t> next_;
  std::vector<int32_t> previous_;
  std::vector<std::uint8_t> is_removed_;
  std::vector<std::uint8_t> is_blocker_;
  std::vector<int32_t> stamp_;
  std::deque<std::pair<int32_t, int32_t>> queue_;
  BlockerGrid grid_;
};

// Corners about the centre of their box, largest coordinate in [1/4, 1]; empty without extent.
Points normalised(const Points& corners, const std::vector<int32_t>& kept) {
  Points points(static_cast<Index>(kept.size()), 3);
  RowVector3d low = corners.row(kept.front());
  RowVector3d high = low;
  for (Index i = 0; i < points.rows(); ++i) {
    points.row(i) = corners.row(kept[static_cast<size_t>(i)]);
    low = low.cwiseMin(points.row(i));
    high = high.cwiseMax(points.row(i));
  }
  points.rowwise() -= RowVector3d(0.5 * low + 0.5 * high);
  const double size = points.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) return Points(0, 3);
  int exponent = 0;
  std::frexp(size, &exponent);
  for (Index i = 0; i < points.size(); ++i) {
    points.data()[i] = std::ldexp(points.data()[i], -exponent);
  }
  return points;
}

RowVector3d newell(const Points& points) {
  RowVector3d sum(0.0, 0.0, 0.0);
  for (Index i = 0; i < points.rows(); ++i) {
    const RowVector3d a = points.row(i);
    const RowVector3d b = points.row((i + 1) % points.rows());
    sum += a.cross(b);
  }
  return sum;
}

// The shorter diagonal of those that leave two triangles facing like the quad; false if none.
bool split_quad(const Points& q, const RowVector3d& normal, std::vector<Corners>& triangles) {
  const auto faces_along = [&](int32_t a, int32_t b, int32_t c) {
    const RowVector3d pa = q.row(a);
    const RowVector3d pb = q.row(b);
    const RowVector3d pc = q.row(c);
    return (pb - pa).cross(pc - pa).dot(normal) > 0.0 && !is_degenerate(pa, pb, pc);
  };
  const bool first = faces_along(0, 1, 2) && faces_along(0, 2, 3);
  const bool second = faces_along(0, 1, 3) && faces_along(1, 2, 3);
  if (!first && !second) return false;
  const bool first_is_shorter =
      (q.row(2) - q.row(0)).squaredNorm() <= (q.row(3) - q.row(1)).squaredNorm();
  if (first && (first_is_shorter || !second)) {
    triangles = {{0, 1, 2}, {0, 2, 3}};
  } else {
    triangles = {{0, 1, 3}, {1, 2, 3}};
  }
  return true;
}

std::vector<RowVector2d> project(const Points& points, const RowVector3d& normal) {
  // The longest side in the plane gives the first axis: it turns with the polygon.
  RowVector3d axis(0.0, 0.0, 0.0);
  for (Index i = 0; i < points.rows(); ++i) {
    RowVector3d side = points.row((i + 1) % points.rows()) - points.row(i);
    side -= side.dot(normal) * normal;
    if (side.squaredNorm() > axis.squaredNorm()) axis = side;
  }
  axis.normalize();
  const RowVector3d other = normal.cross(axis);
  std::vector<RowVector2d> plane(static_cast<size_t>(points.rows()));
  for (Index i = 0; i < points.rows(); ++i) {
    plane[static_cast<size_t>(i)] = {points.row(i).dot(axis), points.row(i).dot(other)};
  }
  return plane;
}

void fan(int32_t count, std::vector<Corners>& triangles) {
  for (int32_t i = 1; i + 1 < count; ++i) triangles.push_back({0, i, i + 1});
}

// Ears of a large polygon; true if it crosses itself.
bool clip_ears(const Points& points, const RowVector3d& normal, std::vector<Corners>& triangles) {
  const std::vector<RowVector2d> plane = project(points, normal);
  bool is_crossed = EarClipper(plane).run(triangles);
  double polygon = 0.0;
  for (size_t i = 0; i < plane.size(); ++i) {
    const RowVector2d& a = plane[i];
    const RowVector2d& b = plane[(i + 1) % plane.size()];
    polygon += a.x() * b.y() - a.y() * b.x();
  }
  double covered = 0.0;
  for (const Corners& t : triangles) {
    covered += std::abs(cross(plane[static_cast<size_t>(t[0])], plane[static_cast<size_t>(t[1])],
                              plane[static_cast<size_t>(t[2])]));
  }
  // n terms of size 1 with rounding 1e-16 each.
  const double slack = 1e-14 * static_cast<double>(plane.size());
  is_crossed = is_crossed || std::abs(covered - polygon) > 1e-9 * polygon + slack;
  return is_crossed;
}

}  // namespace

bool is_degenerate(const RowVector3d& a, const RowVector3d& b, const RowVector3d& c) {
  RowVector3d ab = b - a;
  RowVector3d ac = c - a;
  RowVector3d bc = c - b;
  const double size =
      std::max({ab.cwiseAbs().maxCoeff(), ac.cwiseAbs().maxCoeff(), bc.cwiseAbs().maxCoeff()});
  if (!(size > 0.0)) return true;
  // Fourth powers of lengths are safe in between.
  if (size < 0x1.0p-200 || size > 0x1.0p200) {
    int exponent = 0;
    std::frexp(size, &exponent);
    for (Index k = 0; k < 3; ++k) {
      ab(k) = std::ldexp(ab(k), -exponent);
      ac(k) = std::ldexp(ac(k), -exponent);
      bc(k) = std::ldexp(bc(k), -exponent);
    }
  }
  const double longest = std::max({ab.squaredNorm(), ac.squaredNorm(), bc.squaredNorm()});
  return ab.cross(ac).norm() <= 2.0 * kDegenerateArea * longest;
}

PolygonTriangles triangulate_polygon(const Points& corners) {
  std::vector<int32_t> kept;
  for (Index i = 0; i < corners.rows(); ++i) {
    if (kept.empty() || corners.row(i) != corners.row(kept.back())) {
      kept.push_back(static_cast<int32_t>(i));
    }
  }
  while (kept.size() > 1 && corners.row(kept.front()) == corners.row(kept.back())) kept.pop_back();
  PolygonTriangles result;
  if (kept.size() < 3) return result;
  const Points points = normalised(corners, kept);
  if (points.rows() == 0) return result;

  std::vector<Corners>& triangles = result.triangles;
  const auto count = static_cast<int32_t>(kept.size());
  const RowVector3d area_vector = newell(points);
  const RowVector3d extent = points.colwise().maxCoeff() - points.colwise().minCoeff();
  if (count == 3) {
    triangles.push_back({0, 1, 2});
  } else if (area_vector.norm() <= 2.0 * kDegenerateArea * extent.squaredNorm()) {
    // Either on one line, and every triangle goes below, or an eight whose halves cancel.
    fan(count, triangles);
    result.is_crossed = true;
  } else if (count == 4) {
    if (!split_quad(points, area_vector, triangles)) {
      fan(count, triangles);
      result.is_crossed = true;
    }
  } else {
    result.is_crossed = clip_ears(points, area_vector.normalized(), triangles);
  }

  const auto has_no_area = [&](const Corners& t) {
    return is_degenerate(points.row(t[0]), points.row(t[1]), points.row(t[2]));
  };
  triangles.erase(std::remove_if(triangles.begin(), triangles.end(), has_no_area), triangles.end());
  if (triangles.empty()) result.is_crossed = false;
  for (Corners& t : triangles) {
    for (int32_t& corner : t) corner = kept[static_cast<size_t>(corner)];
  }
  return result;
}

}  // namespace dupin
