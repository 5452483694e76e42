#include "dupin/warp/prepare_outline.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/warp/edge_crossings.h"
#include "dupin/warp/grid_outline.h"
#include "dupin/warp/loop_nesting.h"

namespace dupin {
namespace {

using Eigen::Index;

// Edges a little shorter than the spacing: lattice points at .7 of it make near equilateral
// triangles on them.
constexpr double kEdgePerSpacing = 0.9;
constexpr double kLongestPull = 64.0;    // a quarter of a pixel in outline steps
constexpr double kVerbatim = -1.0;       // a tolerance: keep the corners as they came
constexpr double kLeastTolerance = 0.1;  // below this share of the option: verbatim

std::size_t at(std::int64_t index) { return static_cast<std::size_t>(index); }

double length(GridPoint a, GridPoint b) { return std::hypot(double(b.x) - a.x, double(b.y) - a.y); }

double distance_to_segment(GridPoint p, GridPoint a, GridPoint b) {
  const double dx = double(b.x) - a.x, dy = double(b.y) - a.y;
  const double px = double(p.x) - a.x, py = double(p.y) - a.y;
  const double squared = dx * dx + dy * dy;
  const double t = squared > 0.0 ? std::clamp((px * dx + py * dy) / squared, 0.0, 1.0) : 0.0;
  return std::hypot(px - t * dx, py - t * dy);
}

// A raw loop on the grid [outline steps about the middle] and how closely to follow it.
struct RawLoop {
  std::int32_t source = 0;  // its index in the raw outline
  std::vector<GridPoint> points;
  std::vector<std::int32_t> raw_corner;  // per point: the corner of the raw loop
  std::vector<double> tolerance;         // per point [outline steps]

  std::int32_t size() const { return static_cast<std::int32_t>(points.size()); }
  GridPoint p(std::int64_t i) const { return points[at(i % size())]; }
  double allowed(std::int64_t i) const { return tolerance[at(i % size())]; }
};

// A corner of the result, at `position` along the raw loop (a whole number: on that point).
struct Sample {
  GridPoint p;
  double position;
};

std::int64_t twice_area(const std::vector<GridPoint>& points) {
  std::int64_t sum = 0;
  for (std::size_t i = 1; i + 1 < points.size(); ++i)
    sum += orientation(points[0], points[i], points[i + 1]);
  return sum;
}

// Drops points that repeat their neighbour and spikes that run back on themselves.
void remove_spikes(RawLoop& loop) {
  bool is_clean = false;
  while (!is_clean && loop.size() >= 3) {
    is_clean = true;
    RawLoop kept;
    for (std::int32_t i = 0; i < loop.size(); ++i) {
      const GridPoint here = loop.p(i), after = loop.p(i + 1);
      const GridPoint before =
          kept.points.empty() ? loop.p(i + loop.size() - 1) : kept.points.back();
      if (here == before ||
          (orientation(before, here, after) == 0 && dot(here, before, after) > 0)) {
        is_clean = false;
        continue;
      }
      kept.points.push_back(here);
      kept.raw_corner.push_back(loop.raw_corner[at(i)]);
    }
    loop.points = std::move(kept.points);
    loop.raw_corner = std::move(kept.raw_corner);
  }
}

// Corners at one place move apart, each into the narrow side of its angle: into the shape where two
// pixels touch, out of it where the shape itself is pinched.
std::int64_t pull_apart(std::vector<RawLoop>& loops) {
  struct Corner {
    GridPoint p;
    std::size_t loop;
    std::int32_t index;
  };
  std::vector<Corner> corners;
  for (std::size_t l = 0; l < loops.size(); ++l)
    for (std::int32_t i = 0; i < loops[l].size(); ++i) corners.push_back({loops[l].p(i), l, i});
  std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
    if (a.p.x != b.p.x) return a.p.x < b.p.x;
    if (a.p.y != b.p.y) return a.p.y < b.p.y;
    return a.loop != b.loop ? a.loop < b.loop : a.index < b.index;
  });
  struct Pull {
    Corner corner;
    GridPoint to;
  };
  std::vector<Pull> pulls;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const bool is_shared = (i > 0 && corners[i - 1].p == corners[i].p) ||
                           (i + 1 < corners.size() && corners[i + 1].p == corners[i].p);
    if (!is_shared) continue;
    const RawLoop& loop = loops[corners[i].loop];
    const GridPoint here = corners[i].p;
    const GridPoint before = loop.p(corners[i].index + loop.size() - 1);
    const GridPoint after = loop.p(corners[i].index + 1);
    const double to_before = length(here, before), to_after = length(here, after);
    double x = (double(before.x) - here.x) / to_before + (double(after.x) - here.x) / to_after;
    double y = (double(before.y) - here.y) / to_before + (double(after.y) - here.y) / to_after;
    if (orientation(before, here, after) == 0) {
      x = -(double(after.y) - here.y);
      y = double(after.x) - here.x;
    }
    const double pull =
        std::min({kLongestPull, 0.25 * to_before, 0.25 * to_after}) / std::hypot(x, y);
    pulls.push_back({corners[i],
                     {static_cast<std::int32_t>(here.x + std::llround(pull * x)),
                      static_cast<std::int32_t>(here.y + std::llround(pull * y))}});
  }
  for (const Pull& pull : pulls) loops[pull.corner.loop].points[at(pull.corner.index)] = pull.to;
  return static_cast<std::int64_t>(pulls.size());
}

// Douglas and Peucker from `from` to `to` (> from, cyclic): appends the kept indices after `from`.
void simplify(const RawLoop& loop, std::int64_t from, std::int64_t to,
              std::vector<std::int64_t>& kept) {
  std::vector<std::pair<std::int64_t, std::int64_t>> ranges = {{from, to}};
  while (!ranges.empty()) {
    const auto [first, last] = ranges.back();
    ranges.pop_back();
    double worst = 0.0;
    std::int64_t split = -1;
    bool is_verbatim = true;
    for (std::int64_t i = first + 1; i < last; ++i) {
      is_verbatim = is_verbatim && loop.allowed(i) == kVerbatim;
      const double over =
          distance_to_segment(loop.p(i), loop.p(first), loop.p(last)) - loop.allowed(i);
      if (over > worst) {
        worst = over;
        split = i;
      }
    }
    if (split < 0 || is_verbatim) {
      for (std::int64_t i = first + 1; i < last && is_verbatim; ++i) kept.push_back(i);
      kept.push_back(last);
      continue;
    }
    ranges.emplace_back(split, last);
    ranges.emplace_back(first, split);
  }
}

class Sampler {
 public:
  Sampler(const RawLoop& loop, double edge, double corner_angle_rad)
      : loop_(loop), edge_(edge), corner_angle_(corner_angle_rad) {}

  std::vector<Sample> run() {
    simplify_loop();
    const std::size_t n = kept_.size() - 1;  // the last repeats the first
    std::vector<std::size_t> corners;
    for (std::size_t k = 0; k < n; ++k)
      if (is_corner(k == 0 ? n - 1 : k - 1, k)) corners.push_back(k);
    if (corners.empty()) {
      sample_arc(0, n, 3);
      return std::move(samples_);
    }
    // Turn the polyline so that it starts and ends at a corner.
    const std::size_t shift = corners.front();
    std::vector<std::int64_t> turned;
    for (std::size_t k = 0; k <= n; ++k) {
      const std::size_t from = (k + shift) % n;
      turned.push_back(kept_[from] + (k + shift >= n ? loop_.size() : 0));
    }
    kept_ = std::move(turned);
    measure();
    for (std::size_t c = 0; c < corners.size(); ++c) {
      const std::size_t next = c + 1 < corners.size() ? corners[c + 1] - shift : n;
      sample_arc(corners[c] - shift, next, 1);
    }
    return std::move(samples_);
  }

 private:
  void simplify_loop() {
    // Start at the corner least in x, then y: independent of where the loop starts.
    std::int64_t start = 0, far = 0;
    for (std::int64_t i = 1; i < loop_.size(); ++i) {
      const GridPoint a = loop_.p(i), b = loop_.p(start);
      if (a.x < b.x || (a.x == b.x && a.y < b.y)) start = i;
    }
    for (std::int64_t i = start; i < start + loop_.size(); ++i)
      if (length(loop_.p(start), loop_.p(i)) > length(loop_.p(start), loop_.p(far))) far = i;
    if (far < start) far += loop_.size();
    kept_ = {start};
    simplify(loop_, start, far, kept_);
    simplify(loop_, far, start + loop_.size(), kept_);
    measure();
  }

  void measure() {
    along_.assign(kept_.size(), 0.0);
    for (std::size_t k = 1; k < kept_.size(); ++k)
      along_[k] = along_[k - 1] + length(loop_.p(kept_[k - 1]), loop_.p(kept_[k]));
  }

  bool is_corner(std::size_t before, std::size_t k) const {
    if (loop_.allowed(kept_[k]) == kVerbatim) return true;
    const GridPoint a = loop_.p(kept_[before]), b = loop_.p(kept_[k]), c = loop_.p(kept_[k + 1]);
    const double turn =
        std::atan2(static_cast<double>(orientation(a, b, c)), static_cast<double>(-dot(b, a, c)));
    return std::abs(turn) > corner_angle_;
  }

  // A point of the simplified polyline between its corners `first` and `last`, by arc length.
  Sample sample_at(double arc, std::size_t first, std::size_t last) const {
    const auto found = std::lower_bound(along_.begin() + static_cast<std::ptrdiff_t>(first) + 1,
                                        along_.begin() + static_cast<std::ptrdiff_t>(last), arc);
    const std::size_t k = static_cast<std::size_t>(found - along_.begin()) - 1;
    const GridPoint a = loop_.p(kept_[k]), b = loop_.p(kept_[k + 1]);
    const double piece = along_[k + 1] - along_[k];
    const double t = piece > 0.0 ? std::clamp((arc - along_[k]) / piece, 0.0, 1.0) : 0.0;
    return {{static_cast<std::int32_t>(std::llround(a.x + t * (double(b.x) - a.x))),
             static_cast<std::int32_t>(std::llround(a.y + t * (double(b.y) - a.y)))},
            static_cast<double>(kept_[k]) + t * static_cast<double>(kept_[k + 1] - kept_[k])};
  }

  // Appends evenly spaced samples from corner `first` (included) to `last` (left out).
  void sample_arc(std::size_t first, std::size_t last, std::int64_t least) {
    const double whole = along_[last] - along_[first];
    std::int64_t count = std::max<std::int64_t>(least, std::llround(whole / edge_));
    if (is_verbatim(first, last)) count = 1;
    for (std::int64_t i = 0; i < count; ++i) {
      const auto arc = [&](std::int64_t j) {
        return along_[first] + whole * static_cast<double>(j) / static_cast<double>(count);
      };
      sample_edge(arc(i), arc(i + 1), first, last);
    }
  }

  bool is_verbatim(std::size_t first, std::size_t last) const {
    return last == first + 1 && loop_.allowed(kept_[first]) == kVerbatim &&
           loop_.allowed(kept_[last]) == kVerbatim;
  }

  // The sample at `from`, and those that the bends up to `to` ask for.
  void sample_edge(double from, double to, std::size_t first, std::size_t last) {
    const Sample a = sample_at(from, first, last), b = sample_at(to, first, last);
    double allowed = HUGE_VAL, worst = 0.0;
    std::size_t between = 0;
    for (std::size_t k = after(from, first); k < last && along_[k] < to; ++k) {
      ++between;
      allowed = std::min(allowed, loop_.allowed(kept_[k]));
      worst = std::max(worst, distance_to_segment(loop_.p(kept_[k]), a.p, b.p));
    }
    if (between == 0 || worst <= allowed) {
      samples_.push_back(a);
      return;
    }
    if (to - from > 512.0) {  // 2 px
      const double middle = 0.5 * (from + to);
      sample_edge(from, middle, first, last);
      sample_edge(middle, to, first, last);
      return;
    }
    samples_.push_back(a);
    for (std::size_t k = after(from, first); k < last && along_[k] < to; ++k)
      samples_.push_back({loop_.p(kept_[k]), static_cast<double>(kept_[k])});
  }

  // The first corner of the polyline after `first` that lies beyond `arc`.
  std::size_t after(double arc, std::size_t first) const {
    return static_cast<std::size_t>(
        std::upper_bound(along_.begin() + static_cast<std::ptrdiff_t>(first) + 1, along_.end(),
                         arc) -
        along_.begin());
  }

  const RawLoop& loop_;
  double edge_, corner_angle_;
  std::vector<std::int64_t> kept_;  // indices into the raw loop, growing past its size
  std::vector<double> along_;       // arc length at each
  std::vector<Sample> samples_;
};

class Preparer {
 public:
  Preparer(const Outline& raw, const OutlineOptions& options) : raw_(raw), options_(options) {
    find_frame();
    read_loops();
  }

  PreparedOutline run(const RunControl& control) {
    PreparedOutline result;
    const std::int64_t pulled = pull_apart(loops_);
    if (pulled > 0)
      result.warnings.add("W_OUTLINE_PULLED", "the outline",
                          "corners at one place were pulled apart by up to 1/4 px", pulled);
    result.warnings.append(warnings_);
    std::vector<std::vector<GridPoint>> raw_points;
    for (const RawLoop& loop : loops_) raw_points.push_back(loop.points);
    around_ = loops_around(raw_points);
    samples_.resize(loops_.size());
    std::vector<char> is_stale(loops_.size(), 1);
    std::int64_t repaired = 0;
    while (true) {
      if (control.cancelled()) {
        result.status = Status::cancelled;
        return result;
      }
      for (std::size_t l = 0; l < loops_.size(); ++l)
        if (is_stale[l] != 0) draw(l);
      is_stale.assign(loops_.size(), 0);
      std::int64_t conflicts = tighten_conflicts(is_stale);
      if (conflicts == 0) conflicts = tighten_strays(is_stale);
      if (conflicts == 0) break;
      repaired += conflicts;
    }
    if (repaired > 0)
      result.warnings.add("W_OUTLINE_REPAIRED", "the outline",
                          "edges that met after simplification were drawn again", repaired);
    for (std::size_t l = 0; l < loops_.size(); ++l) {
      Points2 points(static_cast<Index>(samples_[l].size()), 2);
      for (std::size_t i = 0; i < samples_[l].size(); ++i) {
        points(static_cast<Index>(i), 0) =
            static_cast<double>(samples_[l][i].p.x + middle_[0]) * kOutlineStep;
        points(static_cast<Index>(i), 1) =
            static_cast<double>(samples_[l][i].p.y + middle_[1]) * kOutlineStep;
      }
      result.outline.loops.push_back(std::move(points));
      result.outline.component.push_back(raw_.component[at(loops_[l].source)]);
    }
    return result;
  }

 private:
  std::int64_t steps(double value) const {
    if (!(std::abs(value) <= 1 << 24))
      throw Error(Errc::over_limit, "E_TOO_LARGE", "an outline more than 2^24 px from the origin");
    return std::llround(value / kOutlineStep);
  }

  void find_frame() {
    std::int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
    for (const Points2& loop : raw_.loops) {
      for (Index axis = 0; axis < 2; ++axis) {
        low[axis] = std::min(low[axis], steps(loop.col(axis).minCoeff()));
        high[axis] = std::max(high[axis], steps(loop.col(axis).maxCoeff()));
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      if (!raw_.loops.empty() && high[axis] - low[axis] > (std::int64_t{32768} << kOutlineBits))
        throw Error(Errc::over_limit, "E_TOO_LARGE",
                    "the outline is wider or higher than 32768 px");
      middle_[axis] = raw_.loops.empty() ? 0 : low[axis];
    }
  }

  void read_loops() {
    std::vector<std::int32_t> gone;
    for (std::size_t l = 0; l < raw_.loops.size(); ++l) {
      RawLoop loop;
      loop.source = static_cast<std::int32_t>(l);
      for (Index i = 0; i < raw_.loops[l].rows(); ++i) {
        loop.points.push_back({static_cast<std::int32_t>(steps(raw_.loops[l](i, 0)) - middle_[0]),
                               static_cast<std::int32_t>(steps(raw_.loops[l](i, 1)) - middle_[1])});
        loop.raw_corner.push_back(static_cast<std::int32_t>(i));
      }
      const bool is_outer = signed_area(raw_.loops[l]) > 0.0;
      remove_spikes(loop);
      if (loop.size() < 3 || twice_area(loop.points) == 0) {
        drop(loop.source, "loops without an area were dropped");
        if (is_outer) gone.push_back(raw_.component[l]);
        continue;
      }
      loop.tolerance.assign(loop.points.size(), options_.tolerance_px > 0.0
                                                    ? options_.tolerance_px / kOutlineStep
                                                    : kVerbatim);
      loops_.push_back(std::move(loop));
    }
    // A hole of what is gone has nothing left to be a hole of.
    std::erase_if(loops_, [&](const RawLoop& loop) {
      const bool is_orphan =
          std::find(gone.begin(), gone.end(), raw_.component[at(loop.source)]) != gone.end();
      if (is_orphan) drop(loop.source, "loops without an area were dropped");
      return is_orphan;
    });
    if (loops_.empty()) throw AnalysisError("E_EMPTY_SHAPE", "no loop of the outline has an area");
  }

  void drop(std::int32_t loop, const std::string& why) {
    warnings_.add("W_OUTLINE_DROPPED", "loop " + std::to_string(loop), why);
  }

  // Samples of loop l, closer to it if they turn it over or leave no triangle.
  void draw(std::size_t l) {
    RawLoop& loop = loops_[l];
    const bool is_outer = twice_area(loop.points) > 0;
    while (true) {
      std::vector<Sample> samples =
          Sampler(loop, kEdgePerSpacing * options_.spacing_px / kOutlineStep,
                  options_.corner_angle_deg * std::numbers::pi / 180.0)
              .run();
      std::vector<GridPoint> points;
      samples_[l].clear();
      for (const Sample& s : samples) {
        if (!points.empty() && (points.back() == s.p)) continue;
        points.push_back(s.p);
        samples_[l].push_back(s);
      }
      while (points.size() > 1 && points.back() == points.front()) {
        points.pop_back();
        samples_[l].pop_back();
      }
      const std::int64_t area = twice_area(points);
      if (points.size() >= 3 && area != 0 && (area > 0) == is_outer) return;
      if (!tighten(loop, 0, loop.size()))
        throw AnalysisError("E_OUTLINE_CROSSED",
                            "loop " + std::to_string(loop.source) + " lies on itself");
    }
  }

  // Less tolerance from raw point `first` to `last`, cyclic; false if there was none left.
  bool tighten(RawLoop& loop, std::int64_t first, std::int64_t last) const {
    bool has_changed = false;
    for (std::int64_t i = first; i <= std::min<std::int64_t>(last, first + loop.size() - 1); ++i) {
      double& tolerance = loop.tolerance[at(i % loop.size())];
      if (tolerance == kVerbatim) continue;
      has_changed = true;
      tolerance *= 0.5;
      if (tolerance < kLeastTolerance * options_.tolerance_px / kOutlineStep) tolerance = kVerbatim;
    }
    return has_changed;
  }

  std::int64_t tighten_conflicts(std::vector<char>& is_stale) {
    std::vector<GridSegment> segments;
    std::vector<std::int32_t> next, loop_of, first;
    for (std::size_t l = 0; l < samples_.size(); ++l) {
      first.push_back(static_cast<std::int32_t>(segments.size()));
      const std::size_t n = samples_[l].size();
      for (std::size_t i = 0; i < n; ++i) {
        segments.push_back({samples_[l][i].p, samples_[l][(i + 1) % n].p});
        next.push_back(first.back() + static_cast<std::int32_t>((i + 1) % n));
        loop_of.push_back(static_cast<std::int32_t>(l));
      }
    }
    const auto crossings = find_edge_crossings(segments, next);
    for (const auto& [a, b] : crossings) {
      bool has_changed = false;
      for (const std::int32_t s : {a, b}) {
        const std::size_t l = at(loop_of[at(s)]);
        const auto [low, high] = raw_range(l, s - first[l]);
        const bool changed = tighten(loops_[l], low, high);
        if (changed) is_stale[l] = 1;
        has_changed = has_changed || changed;
      }
      // Both edges as they came: unless another crossing of this round has just changed them, the
      // raw outline itself is at fault.
      if (!has_changed && is_stale[at(loop_of[at(a)])] == 0 && is_stale[at(loop_of[at(b)])] == 0)
        refuse(loop_of[at(a)], a - first[at(loop_of[at(a)])], loop_of[at(b)],
               b - first[at(loop_of[at(b)])]);
    }
    return static_cast<std::int64_t>(crossings.size());
  }

  // Loops that have hopped over another follow the raw outline more closely, or the other does.
  std::int64_t tighten_strays(std::vector<char>& is_stale) {
    std::vector<std::vector<GridPoint>> drawn(samples_.size());
    for (std::size_t l = 0; l < samples_.size(); ++l)
      for (const Sample& s : samples_[l]) drawn[l].push_back(s.p);
    const auto now = loops_around(drawn);
    std::int64_t count = 0;
    for (std::size_t l = 0; l < now.size(); ++l) {
      std::vector<std::size_t> others;
      std::set_symmetric_difference(now[l].begin(), now[l].end(), around_[l].begin(),
                                    around_[l].end(), std::back_inserter(others));
      for (const std::size_t m : others) {
        for (const std::size_t k : {l, m}) {
          if (!tighten(loops_[k], 0, loops_[k].size())) continue;
          is_stale[k] = 1;
          ++count;
          break;
        }
      }
    }
    return count;
  }

  // The raw points that edge `edge` of drawn loop l stands for.
  std::pair<std::int64_t, std::int64_t> raw_range(std::size_t l, std::int32_t edge) const {
    const std::vector<Sample>& samples = samples_[l];
    const double from = samples[at(edge)].position;
    double to = samples[(at(edge) + 1) % samples.size()].position;
    while (to < from) to += loops_[l].size();
    return {static_cast<std::int64_t>(std::floor(from)), static_cast<std::int64_t>(std::ceil(to))};
  }

  [[noreturn]] void refuse(std::int32_t la, std::int32_t ea, std::int32_t lb,
                           std::int32_t eb) const {
    const auto name = [&](std::int32_t l, std::int32_t e) {
      const RawLoop& loop = loops_[at(l)];
      const std::int64_t raw = raw_range(at(l), e).first % loop.size();
      return edge_name(loop.source, loop.raw_corner[at(raw)]);
    };
    const GridPoint p = samples_[at(la)][at(ea)].p;
    throw AnalysisError("E_OUTLINE_CROSSED",
                        name(la, ea) + " crosses or touches " + name(lb, eb) +
                            near_place(static_cast<double>(p.x + middle_[0]) * kOutlineStep,
                                       static_cast<double>(p.y + middle_[1]) * kOutlineStep),
                        "draw the outline without crossings");
  }

  const Outline& raw_;
  OutlineOptions options_;
  std::int64_t middle_[2] = {0, 0};  // outline steps of what is zero in the grid
  std::vector<RawLoop> loops_;
  std::vector<std::vector<Sample>> samples_;
  std::vector<std::vector<std::size_t>> around_;  // per raw loop, the loops around it
  WarningList warnings_;
};

void check(const OutlineOptions& options) {
  const auto is_within = [](double value, double low, double high) {
    return std::isfinite(value) && value >= low && value <= high;
  };
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) throw InvalidArgument(what);
  };
  require(is_within(options.spacing_px, 0.5, 16384.0), "spacing_px is outside [0.5, 16384]");
  require(is_within(options.tolerance_px, 0.0, 64.0), "tolerance_px is outside [0, 64]");
  require(is_within(options.corner_angle_deg, 0.0, 180.0), "corner_angle_deg is outside [0, 180]");
}

}  // namespace

PreparedOutline prepare_outline(const Outline& raw, const OutlineOptions& options, RunControl run) {
  check(options);
  validate(raw);
  return Preparer(raw, options).run(run);
}

}  // namespace dupin
