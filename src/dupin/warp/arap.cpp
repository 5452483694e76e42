#include "dupin/warp/arap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "dupin/base/error.h"
#include "dupin/base/instruction_set.h"
#include "dupin/base/parallel.h"

#ifdef DUPIN_X86
#include <emmintrin.h>
#endif

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::VectorXd;

constexpr Index kGrain = 1024;     // vertices a task; sums are added in blocks of it
constexpr double kNoTurn = 1e-12;  // of the largest that it can be: a cell that says no direction

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// x and y in one register of every machine: what is summed over neighbours, is summed for both.
using Pair = double __attribute__((vector_size(16)));

Pair swapped(Pair v) { return Pair{v[1], v[0]}; }

Pair root(Pair v) {
#ifdef DUPIN_X86
  return _mm_sqrt_pd(v);
#else
  return Pair{std::sqrt(v[0]), std::sqrt(v[1])};
#endif
}

std::uint32_t spread_bits(std::uint32_t x) {
  x = (x | (x << 8U)) & 0x00FF00FFU;
  x = (x | (x << 4U)) & 0x0F0F0F0FU;
  x = (x | (x << 2U)) & 0x33333333U;
  return (x | (x << 1U)) & 0x55555555U;
}

// Neighbours in the plane become neighbours in memory, whatever order the mesher chose.
Eigen::VectorXi morton_order(const Points2& points) {
  const Index count = points.rows();
  Eigen::VectorXi order(count);
  std::iota(order.data(), order.data() + count, 0);
  if (count == 0) return order;
  const RowVector2d low = points.colwise().minCoeff();
  const double extent = (points.colwise().maxCoeff() - low).maxCoeff();
  const double scale = extent > 0.0 ? 65535.0 / extent : 0.0;
  std::vector<std::uint32_t> code(at(count));
  for (Index v = 0; v < count; ++v) {
    const auto x = static_cast<std::uint32_t>(scale * (points(v, 0) - low.x()));
    const auto y = static_cast<std::uint32_t>(scale * (points(v, 1) - low.y()));
    code[at(v)] = spread_bits(x & 0xFFFFU) | (spread_bits(y & 0xFFFFU) << 1U);
  }
  std::stable_sort(order.data(), order.data() + count,
                   [&](int a, int b) { return code[at(a)] < code[at(b)]; });
  return order;
}

// Position of neighbour k in the ring of v.
std::size_t slot(const Adjacency& ring, Index v, std::int32_t k) {
  const std::int32_t* found = std::lower_bound(ring.begin(v), ring.end(v), k);
  return static_cast<std::size_t>(found - ring.neighbor.data());
}

}  // namespace

// All of a vertex in one cache line: the loops gather neighbours.
struct alignas(64) ArapSystem::Node {
  Pair p;
  Pair q;
  Pair turn;  // cosine and sine, times w
  double w;
  double unused;
};

EdgeWeighting edge_weights(const PlanarMesh& mesh, const PlanarGraph& graph, EdgeWeights kind) {
  const Adjacency& ring = graph.topology.ring;
  EdgeWeighting result;
  result.weight.assign(ring.neighbor.size(), kind == EdgeWeights::uniform ? 1.0 : 0.0);
  if (kind == EdgeWeights::uniform) return result;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const double area = std::abs(2.0 * signed_area(mesh, f));
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t c = mesh.triangles(f, k);
      const std::int32_t a = mesh.triangles(f, (k + 1) % 3);
      const std::int32_t b = mesh.triangles(f, (k + 2) % 3);
      const RowVector2d ca = mesh.points.row(a) - mesh.points.row(c);
      const RowVector2d cb = mesh.points.row(b) - mesh.points.row(c);
      const double least_area = kLeastCotangent * ca.norm() * cb.norm();
      if (a == b || least_area == 0.0) continue;
      const double half = 0.5 * ca.dot(cb) / std::max(area, least_area);
      result.weight[slot(ring, a, b)] += half;
      result.weight[slot(ring, b, a)] += half;
    }
  }
  Index clamped = 0;
  for (double& weight : result.weight) {
    if (weight >= kLeastCotangent) continue;
    weight = kLeastCotangent;
    ++clamped;
  }
  result.num_clamped = clamped / 2;
  return result;
}

ArapSystem::ArapSystem(const PlanarMesh& mesh, const PlanarGraph& graph,
                       const std::vector<double>& weights, const VectorXd& vertex_weights,
                       const LinearConstraints& constraints, const RunControl& run)
    : triangles_(mesh.triangles), plain_rest_(mesh.points), constraints_(constraints) {
  const Adjacency& ring = graph.topology.ring;
  const Index num_vertices = mesh.points.rows();
  order_ = morton_order(mesh.points);
  Eigen::VectorXi new_index(num_vertices);
  for (Index i = 0; i < num_vertices; ++i) new_index[order_[i]] = static_cast<int>(i);
  rest_.resize(num_vertices, 2);
  vertex_weight_.resize(num_vertices);
  offset_.push_back(0);
  neighbor_.reserve(ring.neighbor.size());
  edge_weight_.reserve(ring.neighbor.size());
  for (Index i = 0; i < num_vertices; ++i) {
    const Index v = order_[i];
    rest_.row(i) = mesh.points.row(v);
    vertex_weight_[i] = vertex_weights[v];
    for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k) {
      neighbor_.push_back(new_index[*k]);
      edge_weight_.push_back(weights[at(k - ring.neighbor.data())]);
      if (edge_weight_.back() != 1.0) is_uniform_ = false;
    }
    offset_.push_back(static_cast<std::int32_t>(neighbor_.size()));
  }
  size_.setZero(num_vertices);
  for (Index i = 0; i < num_vertices; ++i) {
    for (std::int32_t k = offset_[at(i)]; k < offset_[at(i) + 1]; ++k)
      size_[i] += edge_weight_[at(k)] * (rest_.row(neighbor_[at(k)]) - rest_.row(i)).squaredNorm();
  }

  place_of_vertex_.setConstant(num_vertices, -1);
  int num_free = 0;
  const auto is_free = [&](Index v) {
    return constraints_.role(v) == LinearConstraints::Role::free && ring.valence(v) > 0;
  };
  for (Index v = 0; v < num_vertices; ++v) {
    if (is_free(v)) place_of_vertex_[v] = num_free++;
  }
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(at(3 * graph.topology.num_edges));
  const auto add = [&](Index row, Index column, double value) {
    if (row >= column) entries.emplace_back(static_cast<int>(row), static_cast<int>(column), value);
  };
  std::vector<LinearConstraints::Term> terms;
  for (Index v = 0; v < num_vertices; ++v) {
    for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k) {
      if (*k < v) continue;
      const double weight =
          weights[at(k - ring.neighbor.data())] * (vertex_weights[v] + vertex_weights[*k]);
      terms = constraints_.displacement(v);
      for (const auto& term : constraints_.displacement(*k))
        terms.push_back({term.vertex, -term.weight});
      for (const auto& a : terms) {
        for (const auto& b : terms)
          add(place_of_vertex_[a.vertex], place_of_vertex_[b.vertex], weight * a.weight * b.weight);
      }
    }
  }
  Eigen::SparseMatrix<double> lower(num_free, num_free);
  lower.setFromTriplets(entries.begin(), entries.end());
  factor_ = PairFactor(lower, run);
  for (Index v = 0; v < num_vertices; ++v) {
    if (place_of_vertex_[v] >= 0) place_of_vertex_[v] = factor_.place()[place_of_vertex_[v]];
  }
  place_.resize(num_vertices);
  for (Index i = 0; i < num_vertices; ++i) place_[i] = place_of_vertex_[order_[i]];

  face_edge_weight_.setZero(triangles_.rows(), 3);
  for (Index f = 0; f < triangles_.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = triangles_(f, (k + 1) % 3);
      const std::int32_t b = triangles_(f, (k + 2) % 3);
      if (a == b) continue;
      const std::size_t edge = slot(ring, a, b);
      face_edge_weight_(f, k) = weights[edge] * (vertex_weights[a] + vertex_weights[b]) /
                                static_cast<double>(graph.topology.edge_faces[edge]);
    }
  }
}

void ArapSystem::load(const Points2& q, std::vector<Node>& nodes) const {
  nodes.resize(at(q.rows()));
  parallel_for(0, q.rows(), kGrain, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      Node& node = nodes[at(i)];
      node.p = Pair{rest_(i, 0), rest_(i, 1)};
      node.q = Pair{q(order_[i], 0), q(order_[i], 1)};
      node.w = vertex_weight_[i];
    }
  });
}

// Eq. 7.16 as complex numbers: R_n is the direction of sum w conj(p-hat) q-hat. The sums of a few
// vertices come first and the roots after them, two at a time: one root would wait for another.
template <bool kUniform>
void ArapSystem::rotate_range(std::vector<Node>& nodes, Index first, Index last) const {
  constexpr Index kBatch = 32;
  std::array<Pair, kBatch> direction{};
  std::array<double, kBatch> square{};
  for (Index begin = first; begin < last; begin += kBatch) {
    const Index count = std::min(kBatch, last - begin);
    for (Index k = 0; k < count; ++k) {
      const Index n = begin + k;
      const Pair here_p = nodes[at(n)].p;
      const Pair here_q = nodes[at(n)].q;
      Pair along{};   // of px qx and py qy
      Pair across{};  // of px qy and py qx
      Pair qq{};
      for (std::int32_t i = offset_[at(n)]; i < offset_[at(n) + 1]; ++i) {
        const Node& other = nodes[at(neighbor_[at(i)])];
        const double w = kUniform ? 1.0 : edge_weight_[at(i)];
        const Pair q = other.q - here_q;
        const Pair p = kUniform ? other.p - here_p : w * (other.p - here_p);
        qq += kUniform ? q * q : w * (q * q);
        along += p * q;
        across += p * swapped(q);
      }
      const double x = along[0] + along[1];
      const double y = across[0] - across[1];
      const double length = x * x + y * y;
      const bool is_turned =
          length > kNoTurn * kNoTurn * size_[n] * (qq[0] + qq[1]) && length != 0.0;
      direction[at(k)] = is_turned ? Pair{x, y} : Pair{1.0, 0.0};
      square[at(k)] = is_turned ? length : 1.0;
    }
    for (Index k = 0; k < count; k += 2) {
      const Index other = std::min(k + 1, count - 1);
      const Pair w{nodes[at(begin + k)].w, nodes[at(begin + other)].w};
      const Pair scale = w / root(Pair{square[at(k)], square[at(other)]});
      nodes[at(begin + k)].turn = scale[0] * direction[at(k)];
      nodes[at(begin + other)].turn = scale[k < other ? 1 : 0] * direction[at(other)];
    }
  }
}

void ArapSystem::rotate(std::vector<Node>& nodes) const {
  parallel_for(0, static_cast<Index>(nodes.size()), kGrain, [&](Index first, Index last) {
    if (is_uniform_)
      rotate_range<true>(nodes, first, last);
    else
      rotate_range<false>(nodes, first, last);
  });
}

// h - L q of Eq. 7.19 to 7.22, gathered as differences: zero, not a difference of large numbers,
// where the shape is rigid.
template <bool kUniform, bool kGradient>
double ArapSystem::residual_range(const std::vector<Node>& nodes, Points2* gradient, Index first,
                                  Index last) const {
  double energy = 0.0;
  for (Index n = first; n < last; ++n) {
    const Node node = nodes[at(n)];
    Pair sum{};
    Pair cell{};
    for (std::int32_t i = offset_[at(n)]; i < offset_[at(n) + 1]; ++i) {
      const Node& other = nodes[at(neighbor_[at(i)])];
      const Pair p = other.p - node.p;
      const Pair q = other.q - node.q;
      const Pair left = Pair{-1.0, 1.0} * swapped(p);  // a quarter turn from x towards y
      const Pair own = node.w * q - (node.turn[0] * p + node.turn[1] * left);
      cell += kUniform ? own * own : edge_weight_[at(i)] * (own * own);
      if (!kGradient) continue;
      const Pair both = own + (other.w * q - (other.turn[0] * p + other.turn[1] * left));
      sum += kUniform ? both : edge_weight_[at(i)] * both;
    }
    energy += (cell[0] + cell[1]) / node.w;
    if (kGradient) {
      (*gradient)(n, 0) = sum[0];
      (*gradient)(n, 1) = sum[1];
    }
  }
  return energy;
}

double ArapSystem::residual(const std::vector<Node>& nodes, Points2* gradient) const {
  return parallel_sum(0, static_cast<Index>(nodes.size()), kGrain, [&](Index first, Index last) {
    if (gradient != nullptr) {
      return is_uniform_ ? residual_range<true, true>(nodes, gradient, first, last)
                         : residual_range<false, true>(nodes, gradient, first, last);
    }
    return is_uniform_ ? residual_range<true, false>(nodes, nullptr, first, last)
                       : residual_range<false, false>(nodes, nullptr, first, last);
  });
}

// `gradient` (minus half the derivative of E) in the order of order_: of held vertices it is passed
// on to those they follow, then the factor turns it into displacements.
void ArapSystem::descend(Points2& q, Points2& gradient) const {
  if (!constraints_.followers().empty()) {
    Eigen::VectorXi new_index(order_.size());
    for (Index i = 0; i < order_.size(); ++i) new_index[order_[i]] = static_cast<int>(i);
    for (const auto& follower : constraints_.followers()) {
      const RowVector2d pull = gradient.row(new_index[follower.vertex]);
      for (const auto& term : follower.terms)
        gradient.row(new_index[term.vertex]) += term.weight * pull;
    }
  }
  Points2 pairs(factor_.size(), 2);
  for (Index i = 0; i < place_.size(); ++i) {
    if (place_[i] >= 0) pairs.row(place_[i]) = gradient.row(i);
  }
  factor_.solve(pairs.data());
  for (Index v = 0; v < q.rows(); ++v) {
    if (place_of_vertex_[v] >= 0) q.row(v) += pairs.row(place_of_vertex_[v]);
  }
  for (const auto& follower : constraints_.followers()) {
    for (const auto& term : follower.terms)
      q.row(follower.vertex) += term.weight * pairs.row(place_of_vertex_[term.vertex]);
  }
}

double ArapSystem::iterate(Points2& q) const {
  std::vector<Node> nodes;
  load(q, nodes);
  rotate(nodes);
  Points2 gradient(q.rows(), 2);
  const double energy = residual(nodes, &gradient);
  descend(q, gradient);
  return energy;
}

double ArapSystem::energy(const Points2& q) const {
  std::vector<Node> nodes;
  load(q, nodes);
  rotate(nodes);
  return residual(nodes, nullptr);
}

Points2 ArapSystem::rotations(const Points2& q) const {
  std::vector<Node> nodes;
  load(q, nodes);
  rotate(nodes);
  Points2 result(q.rows(), 2);
  for (Index i = 0; i < q.rows(); ++i) {
    const Node& node = nodes[at(i)];
    result.row(order_[i]) << node.turn[0] / node.w, node.turn[1] / node.w;
  }
  return result;
}

VectorXd ArapSystem::residuals(const Points2& q) const {
  std::vector<Node> nodes;
  load(q, nodes);
  rotate(nodes);
  VectorXd result = VectorXd::Zero(q.rows());
  for (Index n = 0; n < q.rows(); ++n) {
    if (size_[n] == 0.0) continue;
    result[order_[n]] =
        residual_range<false, false>(nodes, nullptr, n, n + 1) / (nodes[at(n)].w * size_[n]);
  }
  return result;
}

void ArapSystem::fit_triangles(Points2& q,
                               const Eigen::Matrix<double, Eigen::Dynamic, 4>& maps) const {
  Points2 by_vertex = Points2::Zero(q.rows(), 2);
  for (Index f = 0; f < triangles_.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = triangles_(f, (k + 1) % 3);
      const std::int32_t b = triangles_(f, (k + 2) % 3);
      const RowVector2d p = plain_rest_.row(b) - plain_rest_.row(a);
      const RowVector2d wanted(maps(f, 0) * p.x() + maps(f, 1) * p.y(),
                               maps(f, 2) * p.x() + maps(f, 3) * p.y());
      const RowVector2d pull = face_edge_weight_(f, k) * (q.row(b) - q.row(a) - wanted);
      by_vertex.row(a) += pull;
      by_vertex.row(b) -= pull;
    }
  }
  Points2 gradient(q.rows(), 2);
  for (Index i = 0; i < q.rows(); ++i) gradient.row(i) = by_vertex.row(order_[i]);
  descend(q, gradient);
}

}  // namespace dupin
