#include "dupin/scalespace/diffusion_operator.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

// Rows longer than this are sliced together, after all others: one hub must not pad seven short
// rows.
constexpr int32_t kLongRow = 16;
// Rows are sorted by length inside windows of this size only, so that neighbours in space stay
// neighbours in memory.
constexpr Index kWindow = 256;

// Breadth-first order: neighbours get near numbers. Only for input whose numbering is scrambled.
std::vector<int32_t> breadth_first_order(const Adjacency& ring) {
  const Index num_vertices = ring.num_vertices();
  std::vector<int32_t> order;
  order.reserve(static_cast<size_t>(num_vertices));
  std::vector<std::uint8_t> seen(static_cast<size_t>(num_vertices), 0);
  for (Index seed = 0; seed < num_vertices; ++seed) {
    if (seen[static_cast<size_t>(seed)] != 0) continue;
    seen[static_cast<size_t>(seed)] = 1;
    size_t head = order.size();
    order.push_back(static_cast<int32_t>(seed));
    for (; head < order.size(); ++head) {
      for (const int32_t* j = ring.begin(order[head]); j != ring.end(order[head]); ++j) {
        if (seen[static_cast<size_t>(*j)] != 0) continue;
        seen[static_cast<size_t>(*j)] = 1;
        order.push_back(*j);
      }
    }
  }
  return order;
}

bool is_scrambled(const Adjacency& ring) {
  if (ring.neighbor.empty()) return false;
  double gap = 0.0;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j)
      gap += static_cast<double>(std::abs(*j - v));
  }
  return gap / static_cast<double>(ring.neighbor.size()) >
         0.1 * static_cast<double>(ring.num_vertices());
}

std::vector<int32_t> row_order(const Adjacency& ring) {
  std::vector<int32_t> order;
  if (is_scrambled(ring)) {
    order = breadth_first_order(ring);
  } else {
    order.resize(static_cast<size_t>(ring.num_vertices()));
    std::iota(order.begin(), order.end(), 0);
  }
  const auto longer = [&](int32_t a, int32_t b) { return ring.valence(a) > ring.valence(b); };
  const auto first_long = std::stable_partition(
      order.begin(), order.end(), [&](int32_t v) { return ring.valence(v) <= kLongRow; });
  for (auto first = order.begin(); first != first_long;) {
    const auto last = first + std::min<std::ptrdiff_t>(kWindow, first_long - first);
    std::stable_sort(first, last, longer);
    first = last;
  }
  std::stable_sort(first_long, order.end(), longer);
  return order;
}

// The rows of one slice, and whether it can be compact.
struct Slice {
  Index width = 0;
  int32_t lowest = 0;
  bool is_compact = false;
};

// An isolated vertex is its own neighbour: B f = 0 there.
Index row_length(const Adjacency& ring, const DiffusionOperator& op, Index r) {
  return r < op.num_vertices ? std::max(1, ring.valence(op.order[static_cast<size_t>(r)])) : 0;
}

// Calls action(j, neighbour row, entry of ring.neighbor or -1) for the neighbours of row r.
template <class Action>
void for_each_neighbor(const Adjacency& ring, const DiffusionOperator& op, Index r,
                       Action&& action) {
  if (r >= op.num_vertices) return;
  const int32_t v = op.order[static_cast<size_t>(r)];
  if (ring.valence(v) == 0) action(Index{0}, static_cast<int32_t>(r), std::ptrdiff_t{-1});
  for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
    action(j - ring.begin(v), op.row_of[static_cast<size_t>(*j)], j - ring.neighbor.data());
  }
}

Slice examine(const Adjacency& ring, const DiffusionOperator& op, Index s, bool allow_compact) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  Slice slice;
  Index shortest = row_length(ring, op, s * kLanes);
  int32_t lowest = std::numeric_limits<int32_t>::max();
  int32_t highest = 0;
  for (Index r = s * kLanes; r < (s + 1) * kLanes; ++r) {
    slice.width = std::max(slice.width, row_length(ring, op, r));
    shortest = std::min(shortest, row_length(ring, op, r));
    for_each_neighbor(ring, op, r, [&](Index, int32_t row, std::ptrdiff_t) {
      lowest = std::min(lowest, row);
      highest = std::max(highest, row);
    });
  }
  slice.lowest = lowest;
  slice.is_compact = allow_compact && shortest == slice.width && highest - lowest <= 0xFFFF;
  return slice;
}

// Lays out the rows, with `weights` aligned with ring.neighbor or nullptr for the umbrella
// operator.
void slice_rows(const Adjacency& ring, const std::vector<double>* weights, DiffusionOperator& op) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  op.num_vertices = ring.num_vertices();
  op.order = row_order(ring);
  op.row_of.resize(op.order.size());
  for (size_t r = 0; r < op.order.size(); ++r)
    op.row_of[static_cast<size_t>(op.order[r])] = static_cast<int32_t>(r);

  const Index num_slices = (op.num_vertices + kLanes - 1) / kLanes;
  const auto dummy = static_cast<int32_t>(num_slices * kLanes);
  op.off_diagonal.assign(static_cast<size_t>(dummy), 0.0);
  for (Index s = 0; s < num_slices; ++s) {
    const Slice slice = examine(ring, op, s, weights == nullptr);
    const size_t start = slice.is_compact ? op.compact_index.size() : op.index.size();
    const auto entries = static_cast<size_t>(slice.width * kLanes);
    op.slice_start.push_back(static_cast<std::int64_t>(start));
    op.slice_width.push_back(static_cast<int32_t>(slice.width));
    op.slice_base.push_back(slice.is_compact ? slice.lowest : -1);
    if (slice.is_compact) {
      op.compact_index.resize(start + entries);
    } else {
      op.index.resize(start + entries, dummy);
      if (weights != nullptr) op.weight.resize(start + entries, 0.0);
    }
    for (Index r = s * kLanes; r < std::min((s + 1) * kLanes, op.num_vertices); ++r) {
      op.off_diagonal[static_cast<size_t>(r)] = 1.0 / static_cast<double>(row_length(ring, op, r));
      for_each_neighbor(ring, op, r, [&](Index j, int32_t row, std::ptrdiff_t k) {
        const size_t entry = start + static_cast<size_t>(j * kLanes + r % kLanes);
        if (slice.is_compact) {
          op.compact_index[entry] = static_cast<std::uint16_t>(row - slice.lowest);
        } else {
          op.index[entry] = row;
          if (weights != nullptr && k >= 0) op.weight[entry] = (*weights)[static_cast<size_t>(k)];
        }
      });
    }
  }
}

double umbrella_bound(const Adjacency& ring, const MeshTopology& topology) {
  if (topology.num_nonmanifold_edges > 0) return 2.0;
  double bound = 1.0;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    if (ring.valence(v) == 0) continue;
    int32_t boundary = 0;
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      boundary += topology.edge_faces[static_cast<size_t>(j - ring.neighbor.data())] == 1 ? 1 : 0;
    }
    const double faces = topology.vertex_faces[static_cast<size_t>(v)] + boundary;
    bound = std::max(bound, 1.0 + faces / (2.0 * ring.valence(v)));
  }
  return std::min(bound, 2.0);
}

}  // namespace

Eigen::VectorXd DiffusionOperator::apply(const Eigen::VectorXd& x) const {
  Eigen::VectorXd y(num_vertices);
  for (Index r = 0; r < num_vertices; ++r) {
    const auto s = static_cast<size_t>(r / kLanes);
    double sum = 0.0;
    for (Index j = 0; j < slice_width[s]; ++j) {
      const auto entry = static_cast<size_t>(slice_start[s] + j * kLanes + r % kLanes);
      const int32_t other =
          slice_base[s] >= 0 ? slice_base[s] + compact_index[entry] : index[entry];
      if (other >= num_vertices) continue;
      const double value = x[order[static_cast<size_t>(other)]];
      sum += weight.empty() ? value : weight[entry] * value;
    }
    if (weight.empty()) sum *= off_diagonal[static_cast<size_t>(r)];
    const int32_t v = order[static_cast<size_t>(r)];
    y[v] = (diagonal.empty() ? 1.0 : diagonal[static_cast<size_t>(r)]) * x[v] - sum;
  }
  return y;
}

DiffusionOperator umbrella_operator(const Adjacency& ring, const MeshTopology* topology) {
  DiffusionOperator op;
  slice_rows(ring, nullptr, op);
  op.mass.resize(op.num_vertices);
  for (Index v = 0; v < op.num_vertices; ++v) op.mass[v] = std::max(1, ring.valence(v));
  if (topology != nullptr) {
    if (topology->ring.num_vertices() != op.num_vertices) {
      throw InvalidArgument("topology has " + std::to_string(topology->ring.num_vertices()) +
                            " vertices, the ring has " + std::to_string(op.num_vertices));
    }
    op.spectrum_bound = umbrella_bound(ring, *topology);
  }
  return op;
}

DiffusionOperator cotan_operator(const Adjacency& ring, const CotanWeights& weights, double edge) {
  if (weights.mass.size() != ring.num_vertices() || weights.weight.size() != ring.neighbor.size()) {
    throw InvalidArgument("weights belong to another mesh: " + std::to_string(weights.mass.size()) +
                          " masses for " + std::to_string(ring.num_vertices()) + " vertices");
  }
  if (!std::isfinite(edge) || edge <= 0.0)
    throw InvalidArgument("edge is " + std::to_string(edge) + ", must be > 0");
  const double unit = 0.25 * edge * edge;
  std::vector<double> scaled(weights.weight.size());
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(ring.num_vertices());
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      const auto k = static_cast<size_t>(j - ring.neighbor.data());
      scaled[k] = unit * weights.weight[k] / weights.mass[v];
      diagonal[v] += scaled[k];
    }
  }
  DiffusionOperator op;
  slice_rows(ring, &scaled, op);
  op.mass = weights.mass;
  op.diagonal.assign(static_cast<size_t>(op.num_rows_padded()), 0.0);
  double bound = 0.0;
  for (Index v = 0; v < op.num_vertices; ++v) {
    op.diagonal[static_cast<size_t>(op.row_of[static_cast<size_t>(v)])] = diagonal[v];
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      bound = std::max(bound, diagonal[v] + diagonal[*j]);
    }
  }
  // A hair more than the bound: the rounding of its own sums must not push an eigenvalue outside.
  op.spectrum_bound = bound > 0.0 ? bound * (1.0 + 1e-12) : 1.0;
  return op;
}

}  // namespace dupin
