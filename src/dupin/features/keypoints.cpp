#include "dupin/features/keypoints.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/features/tracks.h"

namespace dupin {
namespace {

using detail::ResponseStack;
using Eigen::Index;
using Eigen::VectorXd;
using std::size_t;

void check(const SurfaceGraph& graph, const LevelMatrix& loc, const LevelSchedule& schedule,
           const KeypointOptions& options) {
  validate(schedule);
  const auto range = [](const char* name, auto value, const std::string& legal) {
    throw InvalidArgument(std::string(name) + " is " + std::to_string(value) + ", legal range " +
                          legal);
  };
  if (loc.rows() != schedule.num_levels - 1 || loc.cols() != graph.points.rows()) {
    throw InvalidArgument("loc is " + std::to_string(loc.rows()) + " by " +
                          std::to_string(loc.cols()) + ", expected " +
                          std::to_string(schedule.num_levels - 1) + " by " +
                          std::to_string(graph.points.rows()));
  }
  const int coarsest = schedule.num_levels - 2;
  if (options.rule == KeypointRule::level && (options.level < 1 || options.level > coarsest)) {
    range("level", options.level, "1 to " + std::to_string(coarsest));
  }
  if (options.level < 0) range("level", options.level, "0 to " + std::to_string(coarsest));
  if (options.min_level < 0 || options.min_level > coarsest) {
    range("min_level", options.min_level, "0 to " + std::to_string(coarsest));
  }
  if (options.min_persistence < 1) range("min_persistence", options.min_persistence, ">= 1");
  if (!std::isfinite(options.min_contrast) || options.min_contrast < 0.0)
    range("min_contrast", options.min_contrast, ">= 0");
  if (options.contrast_power < 0 || options.contrast_power > 2)
    range("contrast_power", options.contrast_power, "0 to 2");
  if (!std::isfinite(options.max_edge_ratio) ||
      (options.max_edge_ratio != 0.0 && options.max_edge_ratio < 1.0)) {
    range("max_edge_ratio", options.max_edge_ratio, "0 or >= 1");
  }
  if (options.top < 0) range("top", options.top, ">= 0");
}

// A level whose values are all equal but for rounding has no extrema (plane, perfect sphere).
std::vector<std::uint8_t> live_levels(const LevelMatrix& loc, double signal_scale) {
  std::vector<std::uint8_t> live(static_cast<size_t>(loc.rows()), 0);
  if (loc.cols() == 0) return live;
  parallel_for(0, loc.rows(), 1, [&](Index first, Index last) {
    for (Index l = first; l < last; ++l) {
      const double spread = loc.row(l).maxCoeff() - loc.row(l).minCoeff();
      live[static_cast<size_t>(l)] = spread > 1e-12 * signal_scale ? 1 : 0;
    }
  });
  return live;
}

// Vertex of the parabola through three equidistant magnitudes, in [-1/2, 1/2].
double parabola_offset(double before, double at, double after) {
  const double bend = before - 2.0 * at + after;
  if (!(bend < 0.0)) return 0.0;
  return std::clamp(0.5 * (before - after) / bend, -0.5, 0.5);
}

struct ScaleLaw {
  VectorXd scale;  // L
  bool is_exact;
  double mean_edge;
  VectorXd tau;  // L, exact

  // Scale at a fractional level: geometric between levels, whose steps are geometric.
  static double at(const VectorXd& scale, double level) {
    const auto l = static_cast<Index>(std::floor(level));
    const double part = level - static_cast<double>(l);
    if (part == 0.0 || l + 1 >= scale.size()) return scale[l];
    if (scale[l] <= 0.0) return part * scale[l + 1];
    return scale[l] * std::pow(scale[l + 1] / scale[l], part);
  }
  double radius(double s) const { return (is_exact ? std::sqrt(s) : s) * mean_edge; }
};

Keypoint make_keypoint(const ResponseStack& responses, const ScaleLaw& law, Index vertex, int level,
                       double offset, int sign) {
  Keypoint point;
  point.vertex = static_cast<std::int32_t>(vertex);
  point.scale_vertex = point.vertex;
  point.level = level;
  point.position_level = level;
  point.tau = ScaleLaw::at(law.tau, level + offset);
  point.t = ScaleLaw::at(law.scale, level + offset);
  point.radius = law.radius(point.t);
  point.response = responses.at(level, vertex);
  point.kind = sign > 0 ? KeypointKind::maximum : KeypointKind::minimum;
  return point;
}

std::vector<Keypoint> level_keypoints(const SurfaceGraph& graph, const ResponseStack& responses,
                                      const ScaleLaw& law, const std::vector<std::uint8_t>& live,
                                      const KeypointOptions& options) {
  std::vector<Keypoint> found;
  if (live[static_cast<size_t>(options.level)] == 0) return found;
  for (Index v = 0; v < graph.points.rows(); ++v) {
    if (graph.is_guarded[static_cast<size_t>(v)] != 0) continue;
    const int sign = detail::ring_extremum(graph.topology.ring, *responses.loc, options.level, v);
    if (sign != 0) found.push_back(make_keypoint(responses, law, v, options.level, 0.0, sign));
  }
  return found;
}

// Strictly larger (times sign) than the ring and the vertex itself at a neighbouring level.
bool beats_level(const SurfaceGraph& graph, const ResponseStack& responses, Index v, Index level,
                 int sign, double value) {
  if (!(sign * value > sign * responses.at(level, v))) return false;
  const Adjacency& ring = graph.topology.ring;
  return std::all_of(ring.begin(v), ring.end(v),
                     [&](std::int32_t j) { return sign * value > sign * responses.at(level, j); });
}

std::vector<Keypoint> space_scale_keypoints(const SurfaceGraph& graph,
                                            const ResponseStack& responses, const ScaleLaw& law,
                                            const std::vector<std::uint8_t>& live, int finest,
                                            const RunControl& run) {
  const Index num_loc = responses.loc->rows();
  std::vector<std::vector<Keypoint>> by_level(static_cast<size_t>(num_loc));
  parallel_for(finest, num_loc - 1, 1, [&](Index first, Index last) {
    for (Index l = first; l < last && !run.cancelled(); ++l) {
      if (live[static_cast<size_t>(l)] == 0) continue;
      for (Index v = 0; v < graph.points.rows(); ++v) {
        if (graph.is_guarded[static_cast<size_t>(v)] != 0) continue;
        const int sign = detail::ring_extremum(graph.topology.ring, *responses.loc, l, v);
        if (sign == 0) continue;
        const double value = responses.at(l, v);
        if (!beats_level(graph, responses, v, l - 1, sign, value) ||
            !beats_level(graph, responses, v, l + 1, sign, value)) {
          continue;
        }
        const double offset = parabola_offset(sign * responses.at(l - 1, v), sign * value,
                                              sign * responses.at(l + 1, v));
        by_level[static_cast<size_t>(l)].push_back(
            make_keypoint(responses, law, v, static_cast<int>(l), offset, sign));
        by_level[static_cast<size_t>(l)].back().is_scale_peak = true;
      }
    }
  });
  std::vector<Keypoint> found;
  for (const auto& part : by_level) found.insert(found.end(), part.begin(), part.end());
  return found;
}

std::vector<Keypoint> persistent_keypoints(const SurfaceGraph& graph,
                                           const ResponseStack& responses, const ScaleLaw& law,
                                           const VectorXd& tau,
                                           const std::vector<std::uint8_t>& live,
                                           const KeypointOptions& options, int finest,
                                           const RunControl& run) {
  const int last = static_cast<int>(responses.loc->rows()) - 1;
  std::vector<Keypoint> found;
  for (const detail::Track& track :
       detail::follow_extrema(graph, responses, live, tau, finest, last, run)) {
    const int length = static_cast<int>(track.vertex.size());
    if (length < std::min(options.min_persistence, last - finest + 1)) continue;
    const auto magnitude = [&](int i) {
      return track.sign * responses.at(track.coarsest - i, track.vertex[static_cast<size_t>(i)]);
    };
    // Highest level whose response exceeds those of both neighbours along the track (5.5.2); else
    // the coarsest.
    int chosen = 0;
    double offset = 0.0;
    for (int i = 1; i + 1 < length; ++i) {
      if (magnitude(i) > magnitude(i - 1) && magnitude(i) > magnitude(i + 1)) {
        chosen = i;
        offset = parabola_offset(magnitude(i + 1), magnitude(i), magnitude(i - 1));
        break;
      }
    }
    const int scale_level = track.coarsest - chosen;
    Keypoint point = make_keypoint(responses, law, track.vertex[static_cast<size_t>(chosen)],
                                   scale_level, offset, track.sign);
    point.persistence = length;
    point.is_scale_peak = chosen > 0;
    // Extrema move least at `options.level` (measured under noise), but more than kCoarser levels
    // above its own scale a structure has merged with its neighbours.
    constexpr int kCoarser = 6;
    const int steady =
        options.level == 0 ? scale_level : std::min(options.level, scale_level + kCoarser);
    const int read =
        track.coarsest - std::clamp(steady, track.coarsest - length + 1, track.coarsest);
    point.vertex = track.vertex[static_cast<size_t>(read)];
    point.position_level = track.coarsest - read;
    found.push_back(point);
  }
  return found;
}

void filter(const SurfaceGraph& graph, const LevelMatrix& loc, const KeypointOptions& options,
            std::vector<Keypoint>& points) {
  if (options.min_contrast > 0.0) {
    std::erase_if(points, [&](const Keypoint& p) {
      return std::abs(p.response) * std::pow(p.radius, options.contrast_power) <
             options.min_contrast;
    });
  }
  if (options.max_edge_ratio > 0.0) {
    for (Keypoint& p : points)
      p.edge_ratio = detail::edge_ratio(graph, loc, p.level, p.scale_vertex);
    std::erase_if(points,
                  [&](const Keypoint& p) { return !(p.edge_ratio <= options.max_edge_ratio); });
  }
  std::sort(points.begin(), points.end(), [](const Keypoint& a, const Keypoint& b) {
    const double ra = std::abs(a.response);
    const double rb = std::abs(b.response);
    if (ra != rb) return ra > rb;
    return std::pair(a.vertex, a.level) < std::pair(b.vertex, b.level);
  });
  if (options.top > 0 && static_cast<Index>(points.size()) > options.top) {
    points.resize(static_cast<size_t>(options.top));
  }
}

}  // namespace

int finest_level(const LevelSchedule& schedule, const KeypointOptions& options) {
  if (options.rule == KeypointRule::level) return options.level;
  const int first = options.rule == KeypointRule::space_scale ? 2 : 1;
  if (options.min_level > 0) return std::max(options.min_level, first);
  return options.rule == KeypointRule::persistent ? std::max(1, 12 * schedule.num_levels / 35)
                                                  : first;
}

VectorXd response_factors(const LevelSchedule& schedule, ScaleMeasure measure) {
  if (measure == ScaleMeasure::variance) {
    throw InvalidArgument("the measure `variance` has no scale at level 1",
                          "exact, thesis or spectral");
  }
  const VectorXd scale = level_scales(schedule, measure);
  const VectorXd steps = time_steps(schedule);
  VectorXd factor(steps.size());
  for (Index l = 0; l < factor.size(); ++l) {
    // LoC holds (F^{l+1} - F^l) / lambda_l.
    factor[l] = measure == ScaleMeasure::exact
                    ? scale[l]
                    : 2.0 * scale[l] * steps[l] / (scale[l + 1] - scale[l]);
  }
  return factor;
}

KeypointSet find_keypoints(const SurfaceGraph& graph, const LevelMatrix& loc,
                           const LevelSchedule& schedule, double signal_scale,
                           const KeypointOptions& options, RunControl run) {
  check(graph, loc, schedule, options);
  KeypointSet set;
  if (run.cancelled()) {
    set.status = Status::cancelled;
    return set;
  }
  const ResponseStack responses{&loc, response_factors(schedule, options.measure)};
  const ScaleLaw law{level_scales(schedule, options.measure),
                     options.measure == ScaleMeasure::exact, graph.mean_edge,
                     level_scales(schedule, ScaleMeasure::exact)};
  const std::vector<std::uint8_t> live = live_levels(loc, signal_scale);
  const int finest = finest_level(schedule, options);
  switch (options.rule) {
    case KeypointRule::level:
      set.keypoints = level_keypoints(graph, responses, law, live, options);
      break;
    case KeypointRule::space_scale:
      set.keypoints = space_scale_keypoints(graph, responses, law, live, finest, run);
      break;
    case KeypointRule::persistent:
      set.keypoints =
          persistent_keypoints(graph, responses, law, law.tau, live, options, finest, run);
      break;
  }
  if (run.cancelled()) {
    set.status = Status::cancelled;
    set.keypoints.clear();
    return set;
  }
  filter(graph, loc, options, set.keypoints);
  run.report(1.0);
  return set;
}

}  // namespace dupin
