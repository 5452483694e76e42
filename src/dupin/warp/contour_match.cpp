#include "dupin/warp/contour_match.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"
#include "dupin/warp/contour_keys.h"
#include "dupin/warp/exterior_points.h"

namespace dupin {
namespace {

using Eigen::Index;

void require_options(const ContourMatchOptions& options) {
  if (!std::isfinite(options.upright) || options.upright < 0.0 || options.upright > 100.0)
    throw InvalidArgument("upright is not in [0, 100]");
  if (options.num_samples < 64 || options.num_samples > 8192)
    throw InvalidArgument("num_samples is not in [64, 8192]");
  if (!std::isfinite(options.detail) || options.detail < 24.0 || options.detail > 512.0 ||
      options.detail > static_cast<double>(options.num_samples))
    throw InvalidArgument("detail is not in [24, 512] or above num_samples");
  if (options.max_keys < 4 || options.max_keys > 200)
    throw InvalidArgument("max_keys is not in [4, 200]");
}

double wrapped(double value, double period) { return value - period * std::floor(value / period); }

// The loop with positive area; its arc length a is length - a of a loop that was turned round.
Points2 turned_positive(const Points2& loop, bool& was_turned) {
  was_turned = signed_area(loop) < 0.0;
  return was_turned ? Points2(loop.colwise().reverse()) : loop;
}

struct Oriented {
  Points2 loop;
  bool is_turned = false;
  double length = 0.0;
  // Reversing the rows starts the loop at its last corner.
  double shift = 0.0;

  explicit Oriented(const Points2& given) {
    loop = turned_positive(given, is_turned);
    length = loop_length(given);
    if (is_turned) shift = (given.row(0) - given.row(given.rows() - 1)).norm();
  }
  double given_arc(double arc) const {
    return is_turned ? wrapped(length - shift - arc, length) : arc;
  }
};

struct Segment {
  const KeyMatch* before = nullptr;
  const KeyMatch* after = nullptr;
  double t = 0.0;          // share of the way from before to after
  double span_from = 0.0;  // arc on the first loop
  double span_to = 0.0;    // signed arc on the second loop
};

Segment segment_at(const ContourMatch& match, double arc_from) {
  const double arc = wrapped(arc_from, match.length_from);
  const auto next =
      std::upper_bound(match.keys.begin(), match.keys.end(), arc,
                       [](double value, const KeyMatch& key) { return value < key.arc_from; });
  Segment segment;
  segment.after = next == match.keys.end() ? &match.keys.front() : &*next;
  segment.before = next == match.keys.begin() ? &match.keys.back() : &*(next - 1);
  double span = wrapped(segment.after->arc_from - segment.before->arc_from, match.length_from);
  if (span <= 0.0) span = match.length_from;
  segment.span_from = span;
  segment.t = wrapped(arc - segment.before->arc_from, match.length_from) / span;
  const double sign = match.is_reversed ? -1.0 : 1.0;
  double to = wrapped(sign * (segment.after->arc_to - segment.before->arc_to), match.length_to);
  if (segment.before == segment.after) to = match.length_to;
  segment.span_to = sign * to;
  return segment;
}

ContourMatch match_one(const Oriented& from, const Points2& to_given, bool mirror,
                       const ContourMatchOptions& options, const RunControl& run) {
  Points2 image = to_given;
  if (mirror) image.col(0) *= -1.0;
  const Oriented to(image);
  const auto keys_from = detail::contour_keys(from.loop, options);
  const auto keys_to = detail::contour_keys(to.loop, options);
  if (keys_from.empty() || keys_to.empty())
    throw AnalysisError("E_DEGENERATE", "a contour without a corner can be matched in any turn",
                        "give pins by hand, or use contours that are not round");
  const detail::KeyAlignment alignment =
      detail::align_keys(keys_from, keys_to, options.upright, run);
  ContourMatch match;
  match.length_from = from.length;
  match.length_to = to.length;
  match.is_mirrored = mirror;
  match.is_reversed = from.is_turned != to.is_turned;
  match.cost = alignment.cost;
  for (const detail::KeyPair& pair : alignment.pairs) {
    const detail::ContourKey& a = keys_from[static_cast<std::size_t>(pair.a)];
    const detail::ContourKey& b = keys_to[static_cast<std::size_t>(pair.b)];
    match.keys.push_back({from.given_arc(a.arc), to.given_arc(b.arc), pair.posterior,
                          std::hypot(a.deviation * to.length / from.length, b.deviation)});
  }
  std::sort(match.keys.begin(), match.keys.end(),
            [](const KeyMatch& a, const KeyMatch& b) { return a.arc_from < b.arc_from; });
  for (std::size_t i = 0; i < match.keys.size(); ++i) {
    const KeyMatch& key = match.keys[i];
    const KeyMatch& next = match.keys[(i + 1) % match.keys.size()];
    double span = wrapped(next.arc_from - key.arc_from, match.length_from);
    if (match.keys.size() == 1) span = match.length_from;
    match.confidence += span / match.length_from * std::min(key.confidence, next.confidence);
  }
  return match;
}

}  // namespace

namespace detail {

std::vector<ContourKey> contour_keys(const Points2& loop, const ContourMatchOptions& options) {
  ExteriorPointOptions wanted;
  wanted.detail = options.detail;
  wanted.num_samples = options.num_samples;
  const ExteriorPoints found = find_exterior_points(loop, wanted);
  const double sigma = static_cast<double>(options.num_samples) / options.detail;
  const ResampledLoop samples =
      resample_loop_smoothly(loop, options.num_samples, std::max(1.0, 0.25 * sigma));
  std::array<Eigen::VectorXd, 3> turning;
  Eigen::VectorXd heading(options.num_samples);
  for (std::size_t k = 0; k < 3; ++k) {
    const double scale = sigma * std::pow(2.0, static_cast<double>(k));
    const ContourCurvature c = compute_contour_curvature(samples.points, samples.spacing, scale);
    turning[k] = 2.0 * std::sqrt(std::numbers::pi) * scale * samples.spacing * c.curvature;
    if (k > 0) continue;
    double angle = std::atan2(c.tangents(0, 1), c.tangents(0, 0));
    for (Index i = 0; i < options.num_samples; ++i) {
      const double next = std::atan2(c.tangents(i, 1), c.tangents(i, 0));
      angle += std::remainder(next - angle, 2.0 * std::numbers::pi);
      heading(i) = angle;
    }
  }
  // A corner of the turning p is a bump of the width of the kernel: what else bends the contour, by
  // u at most places, shifts its top by u / p of that width.
  Eigen::VectorXd sizes = turning[0].cwiseAbs();
  std::nth_element(sizes.data(), sizes.data() + sizes.size() / 2, sizes.data() + sizes.size());
  const double shift = std::numbers::sqrt2 * found.sigma_px * 1.4826 * sizes(sizes.size() / 2);
  std::vector<ContourKey> keys;
  for (const ExteriorPoint& point : found.points) {
    const auto* after =
        std::upper_bound(samples.arcs.data(), samples.arcs.data() + samples.arcs.size(), point.arc);
    const Index i = std::max<Index>(0, after - samples.arcs.data() - 1);
    ContourKey key;
    key.arc = point.arc;
    key.share = static_cast<double>(i) / static_cast<double>(options.num_samples);
    for (std::size_t k = 0; k < 3; ++k) key.turning[k] = turning[k](i);
    key.heading = heading(i);
    key.prominence = point.prominence;
    key.deviation = shift / point.prominence;
    keys.push_back(key);
  }
  const auto limit = static_cast<std::size_t>(options.max_keys);
  if (keys.size() > limit) {
    std::vector<double> prominences;
    for (const ContourKey& key : keys) prominences.push_back(key.prominence);
    std::sort(prominences.rbegin(), prominences.rend());
    const double least = prominences[limit - 1];
    std::erase_if(keys, [&](const ContourKey& key) { return key.prominence < least; });
  }
  return keys;
}

}  // namespace detail

ContourMatch match_contours(const Points2& from, const Points2& to,
                            const ContourMatchOptions& options, RunControl run) {
  require_options(options);
  const Oriented first(from);
  ContourMatch best = match_one(first, to, false, options, run);
  if (options.allow_mirrored && !run.cancelled()) {
    const ContourMatch other = match_one(first, to, true, options, run);
    if (other.cost < best.cost) best = other;
  }
  if (run.cancelled()) {
    best = ContourMatch();
    best.status = Status::cancelled;
  }
  return best;
}

double map_arc(const ContourMatch& match, double arc_from) {
  if (match.keys.empty()) throw InvalidArgument("the match has no key points");
  const Segment segment = segment_at(match, arc_from);
  return wrapped(segment.before->arc_to + segment.t * segment.span_to, match.length_to);
}

MatchedRun matched_run(const ContourMatch& match, double arc_from) {
  if (match.keys.empty()) throw InvalidArgument("the match has no key points");
  const Segment segment = segment_at(match, arc_from);
  return {segment.t * segment.span_from, (1.0 - segment.t) * segment.span_from,
          std::abs(segment.span_to) / segment.span_from,
          (1.0 - segment.t) * segment.before->deviation + segment.t * segment.after->deviation};
}

double confidence_at(const ContourMatch& match, double arc_from) {
  if (match.keys.empty()) throw InvalidArgument("the match has no key points");
  const Segment segment = segment_at(match, arc_from);
  return (1.0 - segment.t) * segment.before->confidence + segment.t * segment.after->confidence;
}

}  // namespace dupin
