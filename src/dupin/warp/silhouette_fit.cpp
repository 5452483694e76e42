#include "dupin/warp/silhouette_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"
#include "dupin/warp/settle_contour.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

// Where the line at y crosses the loops, rising.
std::vector<double> crossings(const Outline& outline, double y) {
  std::vector<double> xs;
  for (const Points2& loop : outline.loops) {
    for (Index i = 0; i < loop.rows(); ++i) {
      const auto from = loop.row(i);
      const auto to = loop.row((i + 1) % loop.rows());
      if ((from.y() <= y) == (to.y() <= y)) continue;
      xs.push_back(from.x() + (y - from.y()) / (to.y() - from.y()) * (to.x() - from.x()));
    }
  }
  std::sort(xs.begin(), xs.end());
  return xs;
}

double length_of(const std::vector<double>& xs) {
  double sum = 0.0;
  for (std::size_t k = 0; k + 1 < xs.size(); k += 2) sum += xs[k + 1] - xs[k];
  return sum;
}

double common_length(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0, k = 0; i + 1 < a.size() && k + 1 < b.size();) {
    const double low = std::max(a[i], b[k]);
    const double high = std::min(a[i + 1], b[k + 1]);
    if (high > low) sum += high - low;
    if (a[i + 1] < b[k + 1]) {
      i += 2;
    } else {
      k += 2;
    }
  }
  return sum;
}

void require_options(const SilhouetteFitOptions& options) {
  const auto outside = [](double value, double low, double high) {
    return !std::isfinite(value) || value < low || value > high;
  };
  if (outside(options.tolerance, 1e-4, 1.0)) throw InvalidArgument("tolerance is not in [1e-4, 1]");
  if (options.max_pins < 4 || options.max_pins > 10000)
    throw InvalidArgument("max_pins is not in [4, 10000]");
  if (outside(options.min_confidence, 0.0, 1.0))
    throw InvalidArgument("min_confidence is not in [0, 1]");
}

// The source contour and where it comes to lie on the silhouette, at equal steps.
struct Track {
  Eigen::VectorXd arcs;
  Points2 shift;  // from the source to the silhouette
  double length = 0.0;
};

Track track_of(const Points2& source, const Points2& silhouette, const ContourMatch& match,
               double height) {
  constexpr Index kSamples = 2048;
  const ResampledLoop samples = resample_loop(source, kSamples);
  Track track;
  track.arcs = samples.arcs;
  track.length = samples.length;
  track.shift.resize(kSamples, 2);
  if (match.is_reversed) {
    for (Index i = 0; i < kSamples; ++i)
      track.shift.row(i) =
          point_at_arc(silhouette, map_arc(match, samples.arcs(i))) - samples.points.row(i);
    return track;
  }
  const Eigen::VectorXd on_silhouette =
      detail::settle_contour(source, samples.points, samples.arcs, silhouette, match, height);
  for (Index i = 0; i < kSamples; ++i)
    track.shift.row(i) = point_at_arc(silhouette, on_silhouette(i)) - samples.points.row(i);
  return track;
}

// The sample between two pins at which the line between them is farthest off, or -1 within
// tolerance.
Index worst_between(const Track& track, Index from, Index to, double tolerance) {
  const Index count = track.arcs.size();
  Index worst = -1;
  double most = tolerance;
  for (Index i = from + 1; i < to; ++i) {
    const double t = static_cast<double>(i - from) / static_cast<double>(to - from);
    const RowVector2d line =
        (1.0 - t) * track.shift.row(from % count) + t * track.shift.row(to % count);
    const double off = (track.shift.row(i % count) - line).norm();
    if (off > most) {
      most = off;
      worst = i;
    }
  }
  return worst;
}

std::vector<Index> pin_samples(const Track& track, const ExteriorPoints& exterior, double tolerance,
                               Index max_pins) {
  const Index count = track.arcs.size();
  std::vector<Index> chosen;
  for (const ExteriorPoint& point : exterior.points) {
    const double place = point.arc / track.length * static_cast<double>(count);
    chosen.push_back(static_cast<Index>(std::lround(place)) % count);
  }
  // A contour without corners starts with thirds.
  while (chosen.size() < 3) chosen.push_back(static_cast<Index>(chosen.size()) * count / 3);
  for (bool changed = true; changed;) {
    changed = false;
    std::sort(chosen.begin(), chosen.end());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    std::vector<Index> added;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const bool is_last = k + 1 == chosen.size();
      const Index to = is_last ? chosen.front() + count : chosen[k + 1];
      const Index worst = worst_between(track, chosen[k], to, tolerance);
      if (worst >= 0 && static_cast<Index>(chosen.size() + added.size()) < max_pins)
        added.push_back(worst % count);
    }
    changed = !added.empty();
    chosen.insert(chosen.end(), added.begin(), added.end());
  }
  return chosen;
}

}  // namespace

Overlap compute_overlap(const Outline& a, const Outline& b, int lines) {
  validate(a);
  validate(b);
  if (lines < 16 || lines > 1000000) throw InvalidArgument("lines is not in [16, 1e6]");
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();
  for (const Outline* outline : {&a, &b}) {
    for (const Points2& loop : outline->loops) {
      low = std::min(low, loop.col(1).minCoeff());
      high = std::max(high, loop.col(1).maxCoeff());
    }
  }
  Overlap overlap;
  if (!(high > low)) return overlap;
  const double step = (high - low) / lines;
  for (int line = 0; line < lines; ++line) {
    const double y = low + (line + 0.5) * step;
    const std::vector<double> in_a = crossings(a, y);
    const std::vector<double> in_b = crossings(b, y);
    overlap.area_a += step * length_of(in_a);
    overlap.area_b += step * length_of(in_b);
    overlap.intersection += step * common_length(in_a, in_b);
  }
  const double whole = overlap.area_a + overlap.area_b - overlap.intersection;
  if (whole > 0.0) overlap.iou = overlap.intersection / whole;
  return overlap;
}

Overlap compute_overlap(const Points2& a, const Points2& b, int lines) {
  return compute_overlap(Outline{{a}, {0}}, Outline{{b}, {0}}, lines);
}

Points2 move_loop(const Points2& loop, const Eigen::VectorXd& arcs,
                  const std::vector<WarpPin>& pins) {
  const auto count = static_cast<Index>(pins.size());
  if (count == 0 || arcs.size() != count)
    throw InvalidArgument("as many arc lengths as pins are needed, and at least one");
  const double length = loop_length(loop);
  const auto shift = [&](Index k) -> RowVector2d {
    const WarpPin& pin = pins[static_cast<std::size_t>(k)];
    return pin.target - pin.source;
  };
  Points2 moved(loop.rows(), 2);
  double arc = 0.0;
  for (Index i = 0; i < loop.rows(); ++i) {
    const auto* next = std::upper_bound(arcs.data(), arcs.data() + count, arc);
    const Index after = (next - arcs.data()) % count;
    const Index before = (after + count - 1) % count;
    double span = arcs(after) - arcs(before);
    if (span <= 0.0) span += length;
    double way = arc - arcs(before);
    if (way < 0.0) way += length;
    const double t = std::clamp(way / span, 0.0, 1.0);
    moved.row(i) = loop.row(i) + (1.0 - t) * shift(before) + t * shift(after);
    arc += (loop.row((i + 1) % loop.rows()) - loop.row(i)).norm();
  }
  return moved;
}

SilhouetteFit fit_silhouette(const Points2& source, const Points2& silhouette,
                             const SilhouetteFitOptions& options, RunControl run) {
  require_options(options);
  const ExteriorPoints exterior = find_exterior_points(source, options.exterior);
  SilhouetteFit fit;
  fit.match = match_contours(source, silhouette, options.match, run.stage(0.0, 0.5));
  if (fit.match.status != Status::ok || run.cancelled()) {
    fit.status = Status::cancelled;
    return fit;
  }
  const auto is_sure = [&](const KeyMatch& key) {
    return key.confidence >= options.min_confidence;
  };
  if (std::count_if(fit.match.keys.begin(), fit.match.keys.end(), is_sure) >= 2)
    std::erase_if(fit.match.keys, [&](const KeyMatch& key) { return !is_sure(key); });

  const double height = silhouette.col(1).maxCoeff() - silhouette.col(1).minCoeff();
  const Track track = track_of(source, silhouette, fit.match, height);
  const std::vector<Index> chosen =
      pin_samples(track, exterior, options.tolerance * height, options.max_pins);
  fit.arcs.resize(static_cast<Index>(chosen.size()));
  fit.confidence.resize(fit.arcs.size());
  for (Index k = 0; k < fit.arcs.size(); ++k) {
    const Index sample = chosen[static_cast<std::size_t>(k)];
    fit.arcs(k) = track.arcs(sample);
    fit.confidence(k) = confidence_at(fit.match, fit.arcs(k));
    WarpPin pin;
    pin.kind = PinKind::exterior;
    pin.source = point_at_arc(source, fit.arcs(k));
    pin.target = pin.source + track.shift.row(sample);
    fit.pins.push_back(pin);
  }
  fit.before = compute_overlap(source, silhouette);
  fit.fitted = compute_overlap(move_loop(source, fit.arcs, fit.pins), silhouette);
  run.report(1.0);
  return fit;
}

}  // namespace dupin
