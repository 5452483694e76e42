#include "dupin/features/tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dupin/base/parallel.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

struct Extremum {
  int32_t vertex;
  int sign;
};

std::vector<Extremum> extrema_of_level(const SurfaceGraph& graph, const LevelMatrix& loc,
                                       Index level) {
  std::vector<Extremum> found;
  const Adjacency& ring = graph.topology.ring;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    if (graph.is_guarded[static_cast<size_t>(v)] != 0) continue;
    const int sign = ring_extremum(ring, loc, level, v);
    if (sign != 0) found.push_back({static_cast<int32_t>(v), sign});
  }
  return found;
}

// For every extremum of the finer level: which track of the coarser one continues into it.
struct Claim {
  int32_t track = -1;
  double distance = std::numeric_limits<double>::infinity();
  double strength = 0.0;
};

bool beats(const Claim& a, const Claim& b) {
  if (a.distance != b.distance) return a.distance < b.distance;
  if (a.strength != b.strength) return a.strength > b.strength;
  return a.track < b.track;
}

}  // namespace

int32_t climb(const Adjacency& ring, const LevelMatrix& loc, Index level, int sign, int32_t start) {
  const double* row = loc.data() + level * loc.cols();
  int32_t v = start;
  for (;;) {
    int32_t best = v;
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      if (sign * row[*j] > sign * row[best]) best = *j;
    }
    if (best == v) return v;
    v = best;
  }
}

int ring_extremum(const Adjacency& ring, const LevelMatrix& loc, Index level, Index v) {
  if (ring.valence(v) < 3) return 0;
  const double* row = loc.data() + level * loc.cols();
  const int32_t* j = ring.begin(v);
  const double value = row[v];
  if (row[*j] == value) return 0;
  const int sign = value > row[*j] ? 1 : -1;
  for (++j; j != ring.end(v); ++j) {
    if (!(sign * value > sign * row[*j])) return 0;
  }
  return sign;
}

std::vector<Track> follow_extrema(const SurfaceGraph& graph, const ResponseStack& responses,
                                  const std::vector<std::uint8_t>& is_level_live,
                                  const Eigen::VectorXd& tau, int first, int last,
                                  const RunControl& run) {
  const LevelMatrix& loc = *responses.loc;
  std::vector<std::vector<Extremum>> extrema(static_cast<size_t>(last + 1));
  parallel_for(first, last + 1, 1, [&](Index begin, Index end) {
    for (Index l = begin; l < end && !run.cancelled(); ++l) {
      if (is_level_live[static_cast<size_t>(l)] != 0) {
        extrema[static_cast<size_t>(l)] = extrema_of_level(graph, loc, l);
      }
    }
  });

  std::vector<Track> tracks;
  std::vector<int32_t> open;  // tracks that reach the level above
  std::vector<Claim> claims(static_cast<size_t>(loc.cols()));
  for (int l = last; l >= first; --l) {
    if (run.cancelled()) break;
    const std::vector<Extremum>& here = extrema[static_cast<size_t>(l)];
    for (const Extremum& e : here) claims[static_cast<size_t>(e.vertex)] = Claim{};
    const double reach = graph.mean_edge * std::max(2.0, 0.5 * std::sqrt(tau[l]));
    for (const int32_t t : open) {
      const Track& track = tracks[static_cast<size_t>(t)];
      const int32_t from = track.vertex.back();
      const int32_t to = climb(graph.topology.ring, loc, l, track.sign, from);
      const double distance = (graph.points.row(from) - graph.points.row(to)).norm();
      if (distance > reach || graph.is_guarded[static_cast<size_t>(to)] != 0) continue;
      if (ring_extremum(graph.topology.ring, loc, l, to) != track.sign) continue;  // a plateau
      const Claim claim{t, distance, std::abs(responses.at(l + 1, from))};
      Claim& current = claims[static_cast<size_t>(to)];
      if (current.track < 0 || beats(claim, current)) current = claim;
    }
    std::vector<int32_t> next;
    for (const Extremum& e : here) {
      const Claim& claim = claims[static_cast<size_t>(e.vertex)];
      if (claim.track >= 0) {
        tracks[static_cast<size_t>(claim.track)].vertex.push_back(e.vertex);
        next.push_back(claim.track);
      } else {
        next.push_back(static_cast<int32_t>(tracks.size()));
        tracks.push_back({l, e.sign, {e.vertex}});
      }
    }
    open = std::move(next);
    run.report(static_cast<double>(last - l + 1) / static_cast<double>(last - first + 1));
  }
  return tracks;
}

}  // namespace dupin::detail
