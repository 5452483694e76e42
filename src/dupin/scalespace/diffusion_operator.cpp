#include "dupin/scalespace/diffusion_operator.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
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

// Lays out the rows; `weight_of(k)` is the weight of entry k of ring.neighbor, or nullptr for
// uniform rows.
void slice_rows(const Adjacency& ring, const std::vector<double>* weights, DiffusionOperator& op) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  op.num_vertices = ring.num_vertices();
  op.order = row_order(ring);
  op.row_of.resize(op.order.size());
  for (size_t r = 0; r < op.order.size(); ++r)
    op.row_of[static_cast<size_t>(op.order[r])] = static_cast<int32_t>(r);

  const Index num_slices = (op.num_vertices + kLanes - 1) / kLanes;
  const auto dummy = static_cast<int32_t>(num_slices * kLanes);
  // An isolated vertex is its own neighbour: B f = 0 there.
  const auto length = [&](Index r) -> Index {
    return r < op.num_vertices ? std::max(1, ring.valence(op.order[static_cast<size_t>(r)])) : 0;
  };
  op.slice_start.assign(static_cast<size_t>(num_slices) + 1, 0);
  for (Index s = 0; s < num_slices; ++s) {
    Index width = 0;
    for (Index lane = 0; lane < kLanes; ++lane) width = std::max(width, length(s * kLanes + lane));
    op.slice_start[static_cast<size_t>(s) + 1] =
        op.slice_start[static_cast<size_t>(s)] + width * kLanes;
  }
  op.index.assign(static_cast<size_t>(op.slice_start.back()), dummy);
  if (weights != nullptr) op.weight.assign(op.index.size(), 0.0);
  op.off_diagonal.assign(static_cast<size_t>(dummy), 0.0);
  for (Index r = 0; r < op.num_vertices; ++r) {
    const int32_t v = op.order[static_cast<size_t>(r)];
    auto entry = static_cast<size_t>(op.slice_start[static_cast<size_t>(r / kLanes)] + r % kLanes);
    op.off_diagonal[static_cast<size_t>(r)] = 1.0 / static_cast<double>(length(r));
    if (ring.valence(v) == 0) op.index[entry] = static_cast<int32_t>(r);
    for (const int32_t* j = ring.begin(v); j != ring.end(v);
         ++j, entry += static_cast<size_t>(kLanes)) {
      op.index[entry] = op.row_of[static_cast<size_t>(*j)];
      if (weights != nullptr)
        op.weight[entry] = (*weights)[static_cast<size_t>(j - ring.neighbor.data())];
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
    const Index s = r / kLanes;
    double sum = 0.0;
    for (std::int64_t e = slice_start[static_cast<size_t>(s)] + r % kLanes;
         e < slice_start[static_cast<size_t>(s) + 1]; e += kLanes) {
      const int32_t other = index[static_cast<size_t>(e)];
      if (other >= num_vertices) continue;
      const double value = x[order[static_cast<size_t>(other)]];
      sum += weight.empty() ? value : weight[static_cast<size_t>(e)] * value;
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
