#include "dupin/crest/tensor_stack.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"
#include "dupin/surface/height_signal.h"

namespace dupin::detail {

using Eigen::Index;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

namespace {

constexpr Index kGrain = 4096;
constexpr size_t kColumns = 9;
// Of the ring in one average of the normals: as much as each of seven equal ones.
constexpr double kShare = 6.0 / 7.0;

// Tangential part of a symmetric tensor: its larger and smaller eigenvalue and the cosine and sine
// of the direction of the larger one from u to w.
struct Plane {
  RowVector3d u;
  RowVector3d w;
  double a = 0.0;  // u S u
  double b = 0.0;  // u S w
  double c = 0.0;  // w S w
  double mean() const { return 0.5 * (a + c); }
  double radius() const { return std::hypot(0.5 * (a - c), b); }
};

bool tangential(const std::array<double, kColumns>& x, Plane& plane) {
  const RowVector3d normal(x[6], x[7], x[8]);
  const double length = normal.norm();
  if (!(length > 0.0)) return false;
  tangent_basis(normal / length, plane.u, plane.w);
  const auto apply = [&](const RowVector3d& v) {
    return RowVector3d(x[0] * v[0] + x[1] * v[1] + x[2] * v[2],
                       x[1] * v[0] + x[3] * v[1] + x[4] * v[2],
                       x[2] * v[0] + x[4] * v[1] + x[5] * v[2]);
  };
  const RowVector3d su = apply(plane.u);
  const RowVector3d sw = apply(plane.w);
  plane.a = plane.u.dot(su);
  plane.b = plane.u.dot(sw);
  plane.c = plane.w.dot(sw);
  return true;
}

// A value between two levels.
template <class Values>
double between(const Values& values, double level) {
  const auto below = static_cast<Index>(level);
  const Index above = std::min(below + 1, values.size() - 1);
  const double weight = level - static_cast<double>(below);
  return (1.0 - weight) * static_cast<double>(values[below]) +
         weight * static_cast<double>(values[above]);
}

// The tensor at `near` and `gain` times its difference from that at `far`.
struct Extrapolation {
  double near = 0.0;
  double far = 0.0;
  double gain = 0.0;
};

Extrapolation extrapolation(const TensorStack& stack, double level, double ratio) {
  const auto last = static_cast<double>(stack.num_levels() - 1);
  Extrapolation at;
  at.near = std::clamp(level, 0.0, last);
  if (!(ratio > 1.0)) return at;
  const double tau = between(stack.tau, at.near);
  const double far = std::min(ratio * tau, stack.tau[stack.num_levels() - 1]);
  if (!(far > tau)) return at;
  auto below = static_cast<Index>(at.near);
  while (below + 2 < stack.num_levels() && stack.tau[below + 1] <= far) ++below;
  at.far = static_cast<double>(below) +
           (far - stack.tau[below]) / (stack.tau[below + 1] - stack.tau[below]);
  // Less towards the coarsest level, beyond which there is nothing to compare with.
  at.gain = std::min(tau / (far - tau), 1.0 / (ratio - 1.0));
  return at;
}

}  // namespace

GradientStencil gradient_stencil(const Points& points, const Triangles& triangles,
                                 const Adjacency& ring) {
  GradientStencil stencil;
  stencil.weight = Points::Zero(static_cast<Index>(ring.neighbor.size()), 3);
  Eigen::VectorXd area = Eigen::VectorXd::Zero(points.rows());
  const auto slot = [&](int32_t a, int32_t b) {
    return std::lower_bound(ring.begin(a), ring.end(a), b) - ring.neighbor.data();
  };
  for (Index f = 0; f < triangles.rows(); ++f) {
    const auto corner = triangles.row(f);
    if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
    const RowVector3d p[3] = {points.row(corner[0]), points.row(corner[1]), points.row(corner[2])};
    const RowVector3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const double doubled = normal.norm();
    if (!(doubled > 0.0)) continue;
    for (Index k = 0; k < 3; ++k) {
      // Doubled area times the gradient of the hat function of this corner.
      const RowVector3d hat = normal.cross(p[(k + 2) % 3] - p[(k + 1) % 3]) / doubled;
      area[corner[k]] += doubled;
      for (Index other = 1; other < 3; ++other)
        stencil.weight.row(slot(corner[(k + other) % 3], corner[k])) += hat;
    }
  }
  for (Index v = 0; v < points.rows(); ++v) {
    if (!(area[v] > 0.0)) continue;
    const auto first = ring.begin(v) - ring.neighbor.data();
    stencil.weight.middleRows(first, ring.valence(v)) /= area[v];
  }
  return stencil;
}

TensorField normal_gradient(const Points& normals, const Adjacency& ring,
                            const GradientStencil& stencil) {
  TensorField tensor = TensorField::Zero(normals.rows(), 6);
  parallel_for(0, normals.rows(), kGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
      for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        const RowVector3d change = normals.row(*j) - normals.row(v);
        gradient += change.transpose() * stencil.weight.row(j - ring.neighbor.data());
      }
      Index entry = 0;
      for (Index r = 0; r < 3; ++r) {
        for (Index c = r; c < 3; ++c) tensor(v, entry++) = 0.5 * (gradient(r, c) + gradient(c, r));
      }
    }
  });
  return tensor;
}

Points averaged_normals(const Points& points, const Triangles& triangles, const Adjacency& ring,
                        int times) {
  Points current = Points::Zero(points.rows(), 3);
  for (Index f = 0; f < triangles.rows(); ++f) {
    const auto corner = triangles.row(f);
    const RowVector3d p = points.row(corner[0]);
    const RowVector3d area =
        (points.row(corner[1]) - p).cross(RowVector3d(points.row(corner[2]) - p));
    for (Index k = 0; k < 3; ++k) current.row(corner[k]) += area;
  }
  for (Index v = 0; v < points.rows(); ++v) current.row(v) /= std::max(1, ring.valence(v));
  Points next(points.rows(), 3);
  for (int pass = 0; pass < times; ++pass) {
    parallel_for(0, points.rows(), kGrain, [&](Index first, Index last) {
      for (Index v = first; v < last; ++v) {
        RowVector3d sum = RowVector3d::Zero();
        for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) sum += current.row(*j);
        const int32_t valence = ring.valence(v);
        next.row(v) = valence > 0 ? RowVector3d((1.0 - kShare) * current.row(v) +
                                                kShare / static_cast<double>(valence) * sum)
                                  : RowVector3d(current.row(v));
      }
    });
    current.swap(next);
  }
  for (Index v = 0; v < points.rows(); ++v) {
    const double length = current.row(v).norm();
    if (length > 0.0) current.row(v) /= length;
  }
  return current;
}

std::optional<TensorStack> make_tensor_stack(const SurfaceGraph& graph, const Points& points,
                                             const TensorStackOptions& options,
                                             const GradientStencil& stencil,
                                             const RunControl& run) {
  const Adjacency& ring = graph.topology.ring;
  const Points normals = averaged_normals(points, graph.triangles, ring, options.normal_smoothing);
  const TensorField tensor = normal_gradient(normals, ring, stencil);
  const DiffusionOperator op = umbrella_operator(ring, &graph.topology);
  ScaleSpaceOptions wanted;
  wanted.schedule = options.schedule;
  wanted.filter = options.filter;
  wanted.want_loc = false;
  TensorStack stack;
  for (size_t c = 0; c < kColumns; ++c) {
    const auto column = static_cast<Index>(c);
    Eigen::VectorXd signal;
    if (c < 6) {
      // Detail far below the mean edge bends more than single precision can hold.
      const double largest = kLargestBend / graph.mean_edge;
      signal = tensor.col(column).cwiseMax(-largest).cwiseMin(largest);
    } else {
      signal = normals.col(column - 6);
    }
    const auto part = static_cast<double>(c) / static_cast<double>(kColumns);
    ScaleSpaceF space = compute_scale_space_single(
        op, signal, wanted, run.stage(part, part + 1.0 / static_cast<double>(kColumns)));
    if (space.status == Status::cancelled) return std::nullopt;
    // Each average of the normals is a step of kShare.
    stack.tau = space.tau.array() + kShare * options.normal_smoothing;
    stack.column.push_back(std::move(space.levels));
  }
  return stack;
}

PrincipalFrame principal_frame(const TensorStack& stack, Index vertex, double level, double ratio) {
  const Extrapolation at = extrapolation(stack, level, ratio);
  std::array<double, kColumns> x{};
  for (size_t c = 0; c < kColumns; ++c) {
    const auto values = stack.column[c].col(vertex);
    x[c] = between(values, at.near);
    if (c < 6 && at.gain > 0.0) x[c] += at.gain * (x[c] - between(values, at.far));
  }
  PrincipalFrame frame;
  Plane plane;
  if (!tangential(x, plane)) return frame;
  const double radius = plane.radius();
  frame.k1 = plane.mean() + radius;
  frame.k2 = plane.mean() - radius;
  const double angle = 0.5 * std::atan2(plane.b, 0.5 * (plane.a - plane.c));
  frame.d1 = std::cos(angle) * plane.u + std::sin(angle) * plane.w;
  frame.d2 = -std::sin(angle) * plane.u + std::cos(angle) * plane.w;
  return frame;
}

double resolved_tau(double tau, double ratio) {
  if (!(ratio > 1.0)) return tau;
  // Integral of q^7 ((1 + g) exp(-q^2 s / 2) - g exp(-r q^2 s / 2))^2 over that of q^7 exp(-q^2 s),
  // for white noise of the height, whose third derivatives the slopes are; it falls with s^-4.
  const double gain = 1.0 / (ratio - 1.0);
  const double middle = 0.5 * (1.0 + ratio);
  const double noise = (1.0 + gain) * (1.0 + gain) -
                       2.0 * gain * (1.0 + gain) / (middle * middle * middle * middle) +
                       gain * gain / (ratio * ratio * ratio * ratio);
  return tau / std::sqrt(std::sqrt(noise));
}

LevelCurvature level_curvature(const TensorStack& stack, Index level) {
  const Index count = stack.num_vertices();
  LevelCurvature result{Eigen::VectorXf::Zero(count), Eigen::VectorXf::Zero(count)};
  parallel_for(0, count, kGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      // Invariants of the tangential part P S P, without a basis: its trace and squared norm.
      const auto at = [&](size_t c) { return static_cast<double>(stack.column[c](level, v)); };
      const double xx = at(0), xy = at(1), xz = at(2), yy = at(3), yz = at(4), zz = at(5);
      const double x = at(6), y = at(7), z = at(8);
      const double square = x * x + y * y + z * z;
      if (!(square > 0.0)) continue;
      const double sx = xx * x + xy * y + xz * z;
      const double sy = xy * x + yy * y + yz * z;
      const double sz = xz * x + yz * y + zz * z;
      const double along = (sx * x + sy * y + sz * z) / square;
      const double sum = xx + yy + zz - along;
      const double norm = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz) -
                          2.0 * (sx * sx + sy * sy + sz * sz) / square + along * along;
      const double difference = std::sqrt(std::max(0.0, 2.0 * norm - sum * sum));
      // ||k1| - |k2|| is the smaller of |k1 + k2| and k1 - k2.
      result.strength[v] = static_cast<float>(std::min(std::abs(sum), difference));
      result.largest[v] = static_cast<float>(0.5 * (std::abs(sum) + difference));
    }
  });
  return result;
}

}  // namespace dupin::detail
