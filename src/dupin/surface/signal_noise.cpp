#include "dupin/surface/signal_noise.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/surface/height_signal.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::size_t;

constexpr Index kLanes = ReplicaBlock::ColsAtCompileTime;
constexpr Index kQuantiles = 4096;  // 12 bits: five deviates of a 64-bit word

using Lanes = Eigen::Array<float, 1, kLanes>;
/// Row v: x, y, z of sixteen displacements (or normals).
using VectorBlock = Eigen::Matrix<float, Eigen::Dynamic, 3 * kLanes, Eigen::RowMajor>;

// Means of the normal distribution's 4096 equal shares would need densities; midpoints scaled to
// unit variance differ by less than 1e-3 of sigma but in the last share of either end.
std::array<float, kQuantiles> normal_quantiles() {
  std::array<double, kQuantiles> exact{};
  double x = -4.0;
  double sum = 0.0;
  for (Index i = 0; i < kQuantiles; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(kQuantiles);
    for (int step = 0; step < 60; ++step) {
      const double excess = 0.5 * std::erfc(-x / std::sqrt(2.0)) - share;
      const double density = std::exp(-0.5 * x * x) / std::sqrt(2.0 * M_PI);
      const double change = std::min(0.5, excess / density);
      x -= change;
      if (std::abs(change) < 1e-12) break;
    }
    exact[static_cast<size_t>(i)] = x;
    sum += x * x;
  }
  const double scale = std::sqrt(static_cast<double>(kQuantiles) / sum);
  std::array<float, kQuantiles> table{};
  for (size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(scale * exact[i]);
  return table;
}

// One stream for every (seed, block, vertex): splitmix64 started at a hash of the three.
class Deviates {
 public:
  explicit Deviates(std::uint64_t seed) : seed_(seed), table_(normal_quantiles()) {}

  // Fills `count` deviates.
  void fill(Index block, Index vertex, float* out, Index count) const {
    std::uint64_t state = mix(seed_ + mix(static_cast<std::uint64_t>(block) + 1)) +
                          static_cast<std::uint64_t>(vertex) * 0xD1B54A32D192ED03ULL;
    std::uint64_t word = 0;
    int left = 0;
    for (Index i = 0; i < count; ++i) {
      if (left == 0) {
        state += 0x9E3779B97F4A7C15ULL;
        word = mix(state);
        left = 5;
      }
      out[i] = table_[word & (kQuantiles - 1)];
      word >>= 12U;
      --left;
    }
  }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  }

  std::uint64_t seed_;
  std::array<float, kQuantiles> table_;
};

// Displacements of all vertices for one block, in units of sigma.
VectorBlock displacements(const Deviates& deviates, const Points& normals, NoiseModel model,
                          Index block) {
  VectorBlock moved(normals.rows(), 3 * kLanes);
  for (Index v = 0; v < normals.rows(); ++v) {
    float* row = moved.data() + v * 3 * kLanes;
    if (model == NoiseModel::isotropic) {
      deviates.fill(block, v, row, 3 * kLanes);
      continue;
    }
    float along[kLanes];
    deviates.fill(block, v, along, kLanes);
    for (Index k = 0; k < 3; ++k) {
      const auto n = static_cast<float>(normals(v, k));
      for (Index lane = 0; lane < kLanes; ++lane) row[k * kLanes + lane] = n * along[lane];
    }
  }
  return moved;
}

// One of them, in mu.
Points displacement(const VectorBlock& moved, Index lane, double sigma) {
  Points points(moved.rows(), 3);
  for (Index v = 0; v < moved.rows(); ++v) {
    for (Index k = 0; k < 3; ++k)
      points(v, k) = sigma * static_cast<double>(moved(v, k * kLanes + lane));
  }
  return points;
}

// x, y and z of sixteen vectors.
struct Triple {
  Lanes x, y, z;

  static Triple of(const VectorBlock& block, Index v) {
    const float* row = block.data() + v * 3 * kLanes;
    return {Eigen::Map<const Lanes>(row), Eigen::Map<const Lanes>(row + kLanes),
            Eigen::Map<const Lanes>(row + 2 * kLanes)};
  }
  void store(VectorBlock& block, Index v) const {
    float* row = block.data() + v * 3 * kLanes;
    std::copy(x.data(), x.data() + kLanes, row);
    std::copy(y.data(), y.data() + kLanes, row + kLanes);
    std::copy(z.data(), z.data() + kLanes, row + 2 * kLanes);
  }
  Triple& operator+=(const Triple& b) {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  Triple operator-(const Triple& b) const { return {x - b.x, y - b.y, z - b.z}; }
  Lanes dot(const Eigen::RowVector3f& a) const { return a[0] * x + a[1] * y + a[2] * z; }
  // this x a
  Triple cross(const Eigen::RowVector3f& a) const {
    return {y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0]};
  }
};

using FloatPoints = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

// A sum that is normalised afterwards: the unit vector and one over the length (0: not defined).
struct Normalisation {
  FloatPoints unit;
  Eigen::VectorXf inverse;
};

// d(S / |S|) = (dS - n (n . dS)) / |S|
void project(const Normalisation& at, Index v, Triple& change) {
  const Eigen::RowVector3f n = at.unit.row(v);
  const Lanes along = change.dot(n);
  const float inverse = at.inverse[v];
  change.x = (change.x - n[0] * along) * inverse;
  change.y = (change.y - n[1] * along) * inverse;
  change.z = (change.z - n[2] * along) * inverse;
}

Normalisation normalise(const Points& sums) {
  Normalisation result{FloatPoints::Zero(sums.rows(), 3), Eigen::VectorXf::Zero(sums.rows())};
  for (Index v = 0; v < sums.rows(); ++v) {
    const double length = sums.row(v).norm();
    if (!(length > 0.0)) continue;
    result.unit.row(v) = (sums.row(v) / length).cast<float>();
    result.inverse[v] = static_cast<float>(1.0 / length);
  }
  return result;
}

// Everything that the derivative of the height signal needs, lengths in mean edges.
struct HeightDerivative {
  Deviates deviates;
  NoiseModel model;
  Adjacency ring;
  Triangles triangles;
  Points normals;
  FloatPoints points;         // relative to the first corner's neighbours: differences only
  FloatPoints umbrella;       // p - mean of the ring
  FloatPoints edge_gradient;  // of the mean edge length, by every vertex
  Eigen::VectorXf height;     // the signal, times the mean edge
  FloatPoints smooth;         // smoothed unit normals
  std::vector<Normalisation> normals_of_pass;  // 0: area vectors; k: after k averages

  HeightDerivative(const SurfaceGraph& graph, const SignalNoiseOptions& options)
      : deviates(options.seed),
        model(options.model),
        ring(graph.topology.ring),
        triangles(graph.triangles),
        normals(graph.normals) {
    const Index num_vertices = graph.points.rows();
    umbrella.setZero(num_vertices, 3);
    edge_gradient.setZero(num_vertices, 3);
    const Points smoothed = smooth_normals(graph.normals, ring, options.normal_smoothing);
    smooth = smoothed.cast<float>();
    height = (graph.mean_edge * height_signal(graph.points, smoothed, ring, {0})).cast<float>();
    const double num_edges = 0.5 * static_cast<double>(ring.neighbor.size());
    const double edge = graph.mean_edge;
    for (Index v = 0; v < num_vertices; ++v) {
      if (ring.valence(v) == 0) continue;
      RowVector3d sum = RowVector3d::Zero();
      RowVector3d directions = RowVector3d::Zero();
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        const RowVector3d difference = graph.points.row(v) - graph.points.row(*j);
        sum += difference;
        const double length = difference.norm();
        if (length > 0.0) directions += difference / length;
      }
      edge_gradient.row(v) = (directions / num_edges).cast<float>();
      umbrella.row(v) = (sum / (edge * ring.valence(v))).cast<float>();
    }
    if (model == NoiseModel::isotropic) halve_noise(options.sigma / edge);
    if (graph.is_mesh()) prepare_normals(graph, options.normal_smoothing);
  }

  // Takes half of the noise's energy from the umbrella vectors. They turn with the normals to make
  // a product of two noises, Q(w, w), which leads at coarse levels. Its derivative at noisy points,
  // 2 Q(w, w'), has twice its variance; at points with half the noise it has the right one.
  // Averaged over the ring: a vector alone tells nothing of its own noise. Noise along the normal
  // moves umbrella vectors across the plane in which normals turn: no such product.
  void halve_noise(double sigma) {
    constexpr double kCoordinates = 3.0;
    Eigen::VectorXf factor(umbrella.rows());
    const auto noise = [&](Index v) {
      return kCoordinates * sigma * sigma * (1.0 + 1.0 / std::max(1, ring.valence(v)));
    };
    for (Index v = 0; v < umbrella.rows(); ++v) {
      double square = static_cast<double>(umbrella.row(v).squaredNorm());
      double expected = noise(v);
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        square += static_cast<double>(umbrella.row(*j).squaredNorm());
        expected += noise(*j);
      }
      factor[v] = static_cast<float>(square > expected ? std::sqrt(1.0 - 0.5 * expected / square)
                                                       : std::sqrt(0.5));
    }
    umbrella = factor.asDiagonal() * umbrella;
  }

  void prepare_normals(const SurfaceGraph& graph, int times) {
    const double edge = graph.mean_edge;
    const RowVector3d centre = graph.points.colwise().mean();
    points = ((graph.points.rowwise() - centre) / edge).cast<float>();
    Points sums = Points::Zero(graph.points.rows(), 3);
    for (Index f = 0; f < triangles.rows(); ++f) {
      const RowVector3d a = graph.points.row(triangles(f, 0));
      const RowVector3d ab = (graph.points.row(triangles(f, 1)) - a) / edge;
      const RowVector3d ac = (graph.points.row(triangles(f, 2)) - a) / edge;
      const RowVector3d n = ab.cross(ac);
      for (Index k = 0; k < 3; ++k) sums.row(triangles(f, k)) += n;
    }
    normals_of_pass.push_back(normalise(sums));
    Points current = graph.normals;
    for (int pass = 0; pass < times; ++pass) {
      for (Index v = 0; v < current.rows(); ++v) {
        sums.row(v) = current.row(v);
        for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
          sums.row(v) += current.row(*j);
      }
      normals_of_pass.push_back(normalise(sums));
      current = smooth_normals(current, ring, 1);
    }
  }

  // Change of the smoothed normals.
  VectorBlock normal_change(const VectorBlock& moved) const {
    VectorBlock change = VectorBlock::Zero(moved.rows(), 3 * kLanes);
    for (Index f = 0; f < triangles.rows(); ++f) {
      const Index a = triangles(f, 0);
      const Index b = triangles(f, 1);
      const Index c = triangles(f, 2);
      const Triple da = Triple::of(moved, a);
      // d(ab x ac) = dab x ac - dac x ab
      Triple normal = (Triple::of(moved, b) - da).cross(points.row(c) - points.row(a));
      const Triple other = (Triple::of(moved, c) - da).cross(points.row(b) - points.row(a));
      normal = normal - other;
      for (const Index v : {a, b, c}) {
        Triple sum = Triple::of(change, v);
        sum += normal;
        sum.store(change, v);
      }
    }
    for (Index v = 0; v < change.rows(); ++v) {
      Triple value = Triple::of(change, v);
      project(normals_of_pass[0], v, value);
      value.store(change, v);
    }
    VectorBlock next(moved.rows(), 3 * kLanes);
    for (size_t pass = 1; pass < normals_of_pass.size(); ++pass) {
      for (Index v = 0; v < change.rows(); ++v) {
        Triple sum = Triple::of(change, v);
        for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
          sum += Triple::of(change, *j);
        project(normals_of_pass[pass], v, sum);
        sum.store(next, v);
      }
      change.swap(next);
    }
    return change;
  }

  // In units of 2 sigma / e^2.
  ReplicaBlock draw(Index block) const {
    const VectorBlock moved = displacements(deviates, normals, model, block);
    ReplicaBlock result = ReplicaBlock::Zero(moved.rows(), kLanes);
    Lanes edge_change = Lanes::Zero();
    for (Index v = 0; v < moved.rows(); ++v)
      edge_change += Triple::of(moved, v).dot(edge_gradient.row(v));
    for (Index v = 0; v < moved.rows(); ++v) {
      if (ring.valence(v) == 0) continue;
      Triple sum{Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
        sum += Triple::of(moved, *j);
      const float inverse = 1.0F / static_cast<float>(ring.valence(v));
      const Eigen::RowVector3f n = smooth.row(v);
      // 2 / e^2 shrinks when the mean edge grows: all vertices share that.
      result.row(v) =
          (Triple::of(moved, v).dot(n) - inverse * sum.dot(n) - height[v] * edge_change).matrix();
    }
    if (normals_of_pass.empty()) return result;
    const VectorBlock turned = normal_change(moved);
    for (Index v = 0; v < moved.rows(); ++v) {
      result.row(v) += Triple::of(turned, v).dot(umbrella.row(v)).matrix();
    }
    return result;
  }
};

// Expected relative growth of the mean edge, of second order: noise across an edge lengthens it.
double edge_growth(const SurfaceGraph& graph, const SignalNoiseOptions& options) {
  const Adjacency& ring = graph.topology.ring;
  double sum = 0.0;
  for (Index v = 0; v < graph.points.rows(); ++v) {
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      const RowVector3d difference = graph.points.row(v) - graph.points.row(*j);
      const double length = difference.norm();
      if (!(length > 0.0)) continue;
      double across = 4.0;  // of variances of one coordinate
      if (options.model == NoiseModel::along_normal) {
        across = 2.0;
        for (const Index end : {v, static_cast<Index>(*j)})
          across -= std::pow(graph.normals.row(end).dot(difference) / length, 2);
      }
      sum += 0.5 * across / length;
    }
  }
  const auto count = static_cast<double>(ring.neighbor.size());
  return options.sigma * options.sigma * sum / (count * graph.mean_edge);
}

// Any other signal: (S(p + h d) - S(p - h d)) / 2h.
struct CentralDifference {
  Deviates deviates;
  SurfaceGraph graph;
  Signal signal;
  SignalNoiseOptions options;
  double unit;

  Eigen::VectorXd at(const Points& points) const {
    SurfaceGraph moved = graph;
    moved.points = points;
    moved.normals = vertex_normals({points, graph.triangles});
    return compute_signal(moved, signal, options.normal_smoothing);
  }

  ReplicaBlock draw(Index block) const {
    constexpr double kStep = 1e-3;
    const VectorBlock moved = displacements(deviates, graph.normals, options.model, block);
    ReplicaBlock result(moved.rows(), kLanes);
    for (Index lane = 0; lane < kLanes; ++lane) {
      const Points step = displacement(moved, lane, kStep * options.sigma);
      const Eigen::VectorXd change = at(graph.points + step) - at(graph.points - step);
      result.col(lane) = (change / (2.0 * kStep * unit)).cast<float>();
    }
    return result;
  }
};

}  // namespace

SignalNoise make_signal_noise(const SurfaceGraph& graph, Signal signal,
                              const SignalNoiseOptions& options) {
  if (!(std::isfinite(options.sigma) && options.sigma > 0.0)) {
    throw InvalidArgument("sigma is " + std::to_string(options.sigma) + ", must be > 0");
  }
  if (options.model == NoiseModel::directional) {
    throw InvalidArgument("model: directional noise has no first-order signal noise here",
                          "isotropic or along_normal");
  }
  if (options.normal_smoothing < 0) {
    throw InvalidArgument("normal_smoothing is " + std::to_string(options.normal_smoothing) +
                          ", must be >= 0");
  }
  if (signal != Signal::height && !graph.is_mesh()) {
    throw AnalysisError("E_NO_FACES", "Taubin's curvature needs faces, this is a point cloud",
                        "the signal 'height' works on points");
  }
  SignalNoise noise;
  const double edge = graph.mean_edge;
  if (!(edge > 0.0)) {
    const Index num_vertices = graph.points.rows();
    noise.draw = [num_vertices](Index) -> ReplicaBlock {
      return ReplicaBlock::Zero(num_vertices, kLanes);
    };
    noise.displacement = [num_vertices](Index) -> Points { return Points::Zero(num_vertices, 3); };
    return noise;
  }
  noise.unit = 2.0 * options.sigma / (edge * edge);
  if (signal == Signal::height) {
    const auto derivative = std::make_shared<const HeightDerivative>(graph, options);
    // The signal carries 1 / e^2.
    noise.bias = -2.0 * edge_growth(graph, options) / edge * derivative->height.cast<double>();
    noise.draw = [derivative](Index block) { return derivative->draw(block); };
    noise.displacement = [derivative, sigma = options.sigma](Index replica) {
      return displacement(displacements(derivative->deviates, derivative->normals,
                                        derivative->model, replica / kLanes),
                          replica % kLanes, sigma);
    };
    return noise;
  }
  if (signal == Signal::gauss) noise.unit /= edge;
  const auto difference = std::make_shared<const CentralDifference>(
      CentralDifference{Deviates(options.seed), graph, signal, options, noise.unit});
  noise.draw = [difference](Index block) { return difference->draw(block); };
  noise.displacement = [difference](Index replica) {
    return displacement(displacements(difference->deviates, difference->graph.normals,
                                      difference->options.model, replica / kLanes),
                        replica % kLanes, difference->options.sigma);
  };
  return noise;
}

double estimate_rounding(const Points& points) {
  if (points.rows() == 0) return 0.0;
  const double* x = points.data();
  const Index count = points.size();
  if (!std::all_of(x, x + count, [](double value) { return std::isfinite(value); }))
    throw InvalidArgument("points: a coordinate is not finite");
  const double largest = points.cwiseAbs().maxCoeff();
  const double extent = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
  const auto is_single = [&](double value) {
    return std::abs(value) <= static_cast<double>(std::numeric_limits<float>::max()) &&
           static_cast<double>(static_cast<float>(value)) == value;
  };
  const int digits = std::all_of(x, x + count, is_single) ? std::numeric_limits<float>::digits
                                                          : std::numeric_limits<double>::digits;
  double sum = 0.0;
  for (Index i = 0; i < count; ++i) {
    if (x[i] == 0.0) continue;
    const double step = std::ldexp(1.0, std::ilogb(x[i]) + 1 - digits);
    sum += step * step;
  }
  double square = sum / static_cast<double>(count);
  // Fewest decimals first: the coarsest grid that fits is the one.
  for (int decimals = -12; decimals <= 15; ++decimals) {
    const double step = std::pow(10.0, -decimals);
    // A decimal that has been rounded to single or double precision is off by that much.
    const double off = std::ldexp(largest, 1 - digits);
    if (off > 0.05 * step) break;
    const auto is_on_grid = [&](double value) {
      return std::abs(value - step * std::nearbyint(value / step)) <= off;
    };
    if (!std::all_of(x, x + count, is_on_grid)) continue;
    if (step <= 1e-3 * extent) square = std::max(square, step * step);
    break;
  }
  return std::sqrt(square / 12.0);
}

}  // namespace dupin
