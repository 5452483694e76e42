#include "dupin/crest/line_assembly.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace dupin::detail {

using Eigen::RowVector3d;
using std::size_t;

namespace {

constexpr double kLeastCosine = 0.7;     // of a line's direction to that of the gap it crosses
constexpr double kAlongsideEdges = 1.0;  // shorter gaps have no direction of their own
constexpr double kTangentEdges = 4.0;    // over which the direction of an end is taken

bool is_closed(const Chain& chain) {
  return chain.size() > 3 && chain.front().edge.a == chain.back().edge.a &&
         chain.front().edge.b == chain.back().edge.b;
}

// The parts above `low` and away from umbilics. A ring is opened where it is weak.
void split_at_weak(const Chain& chain, const CrestOptions& options, std::vector<Chain>& parts) {
  const auto is_weak = [&](const CrestPoint& p) {
    return !(p.strength >= options.low && p.anisotropy >= options.min_anisotropy);
  };
  const auto weak = std::find_if(chain.begin(), chain.end(), is_weak);
  if (weak == chain.end()) {
    parts.push_back(chain);
    return;
  }
  Chain open = chain;
  if (is_closed(chain)) {
    open.pop_back();
    std::rotate(open.begin(), open.begin() + (weak - chain.begin()), open.end());
  }
  Chain part;
  for (const CrestPoint& p : open) {
    if (!is_weak(p)) {
      part.push_back(p);
      continue;
    }
    if (part.size() > 1) parts.push_back(part);
    part.clear();
  }
  if (part.size() > 1) parts.push_back(part);
}

// An end of a chain and where it points.
struct End {
  size_t chain = 0;
  bool is_back = false;
  RowVector3d position;
  RowVector3d outward;
  size_t id() const { return 2 * chain + (is_back ? 1 : 0); }
};

End end_of(const Chain& chain, size_t index, bool is_back, double mean_edge) {
  const auto at = [&](size_t i) -> const RowVector3d& {
    return (is_back ? chain[chain.size() - 1 - i] : chain[i]).position;
  };
  size_t back = 1;
  while (back + 1 < chain.size() && (at(back) - at(0)).norm() < kTangentEdges * mean_edge) ++back;
  End end{index, is_back, at(0), at(0) - at(back)};
  const double length = end.outward.norm();
  if (length > 0.0) end.outward /= length;
  return end;
}

// Pairs of ends that continue each other, nearest first: partner of every end, or -1.
std::vector<std::ptrdiff_t> find_joins(const std::vector<Chain>& chains, double mean_edge,
                                       double max_gap) {
  std::vector<End> ends;
  for (size_t i = 0; i < chains.size(); ++i) {
    if (is_closed(chains[i])) continue;
    ends.push_back(end_of(chains[i], i, false, mean_edge));
    ends.push_back(end_of(chains[i], i, true, mean_edge));
  }
  std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) {
    return std::tuple(a.position[0], a.id()) < std::tuple(b.position[0], b.id());
  });
  std::vector<std::tuple<double, size_t, size_t>> pairs;
  for (size_t i = 0; i < ends.size(); ++i) {
    for (size_t j = i + 1; j < ends.size(); ++j) {
      if (ends[j].position[0] - ends[i].position[0] > max_gap) break;
      const RowVector3d gap = ends[j].position - ends[i].position;
      const double distance = gap.norm();
      if (distance > max_gap) continue;
      const double facing = -ends[i].outward.dot(ends[j].outward);
      // The two ends of a short piece face away from each other, and lie near: only the way
      // between them tells that it does not go round.
      const bool is_same_chain = ends[i].id() / 2 == ends[j].id() / 2;
      const double along =
          distance > kAlongsideEdges * mean_edge || (is_same_chain && distance > 0.0)
              ? std::min(ends[i].outward.dot(gap), -ends[j].outward.dot(gap)) / distance
              : 1.0;
      if (std::min(facing, along) < kLeastCosine) continue;
      pairs.emplace_back(distance, std::min(ends[i].id(), ends[j].id()),
                         std::max(ends[i].id(), ends[j].id()));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<std::ptrdiff_t> partner(2 * chains.size(), -1);
  for (const auto& [distance, a, b] : pairs) {
    if (partner[a] >= 0 || partner[b] >= 0) continue;
    partner[a] = static_cast<std::ptrdiff_t>(b);
    partner[b] = static_cast<std::ptrdiff_t>(a);
  }
  return partner;
}

std::vector<Chain> join(const std::vector<Chain>& chains, double mean_edge, double max_gap) {
  const std::vector<std::ptrdiff_t> partner = find_joins(chains, mean_edge, max_gap);
  std::vector<std::uint8_t> is_used(chains.size(), 0);
  std::vector<Chain> joined;
  const auto follow = [&](size_t first_end) {
    Chain line;
    size_t end = first_end;  // the one by which a chain is entered
    for (;;) {
      const size_t index = end / 2;
      is_used[index] = 1;
      if (end % 2 == 0) {
        line.insert(line.end(), chains[index].begin(), chains[index].end());
      } else {
        line.insert(line.end(), chains[index].rbegin(), chains[index].rend());
      }
      const std::ptrdiff_t next = partner[end ^ 1U];
      if (next < 0) break;
      end = static_cast<size_t>(next);
      if (is_used[end / 2] != 0) {
        line.push_back(line.front());  // a ring
        break;
      }
    }
    joined.push_back(std::move(line));
  };
  for (const bool is_ring : {false, true}) {
    for (size_t i = 0; i < chains.size(); ++i) {
      for (size_t side = 0; side < 2; ++side) {
        if (is_used[i] == 0 && (is_ring || partner[2 * i + side] < 0)) follow(2 * i + side);
      }
    }
  }
  return joined;
}

CrestLine make_line(Chain chain, CrestKind kind) {
  CrestLine line;
  line.kind = kind;
  line.is_closed = is_closed(chain);
  for (size_t i = 1; i < chain.size(); ++i) {
    const CrestPoint& a = chain[i - 1];
    const CrestPoint& b = chain[i];
    const double length = (b.position - a.position).norm();
    line.length += length;
    line.strength += 0.5 * length * (a.strength + b.strength);
    line.mean_scale += 0.5 * length * (a.radius + b.radius);
    line.sharpness += 0.5 * length * (a.sharpness + b.sharpness);
  }
  if (line.length > 0.0) {
    line.strength /= line.length;
    line.mean_scale /= line.length;
    line.sharpness /= line.length;
  }
  line.points = std::move(chain);
  return line;
}

}  // namespace

double plane_noise(double tau, double sigma, double mean_edge) {
  if (!(tau > 0.0) || !(mean_edge > 0.0)) return 0.0;
  return std::sqrt(0.4135 / (tau * tau * tau)) * sigma / (mean_edge * mean_edge);
}

void assemble_lines(const std::vector<Chain>& chains, CrestKind kind, double mean_edge,
                    const CrestOptions& options, std::vector<CrestLine>& lines) {
  std::vector<Chain> parts;
  for (const Chain& chain : chains) split_at_weak(chain, options, parts);
  for (Chain& chain : join(parts, mean_edge, options.max_gap * mean_edge)) {
    const bool is_strong = std::any_of(chain.begin(), chain.end(), [&](const CrestPoint& p) {
      return p.strength >= options.high;
    });
    if (!is_strong) continue;
    CrestLine line = make_line(std::move(chain), kind);
    if (line.length > 0.0 && line.length >= options.min_length * mean_edge &&
        line.sharpness >= options.min_sharpness)
      lines.push_back(std::move(line));
  }
}

}  // namespace dupin::detail
