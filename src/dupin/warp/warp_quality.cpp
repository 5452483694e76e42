#include "dupin/warp/warp_quality.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;

constexpr double kFlat = 1e-9;    // of the area at rest: a triangle with less has none
constexpr int kLoosenEvery = 50;  // turns after which the bound on the stretch is doubled

Matrix2d edges(const Points2& points, const Triangles& triangles, Index f) {
  Matrix2d result;
  result.col(0) = (points.row(triangles(f, 1)) - points.row(triangles(f, 0))).transpose();
  result.col(1) = (points.row(triangles(f, 2)) - points.row(triangles(f, 0))).transpose();
  return result;
}

// A linear map as z -> u z + w conj(z): singular values |u| + |w| and |u| - |w|, the second
// negative if the map reflects.
struct LinearMap {
  double ux, uy, wx, wy;
  double large, small;
};

LinearMap decompose(const Matrix2d& j) {
  LinearMap map{0.5 * (j(0, 0) + j(1, 1)),
                0.5 * (j(1, 0) - j(0, 1)),
                0.5 * (j(0, 0) - j(1, 1)),
                0.5 * (j(1, 0) + j(0, 1)),
                0.0,
                0.0};
  const double u = std::hypot(map.ux, map.uy);
  const double w = std::hypot(map.wx, map.wy);
  map.large = u + w;
  map.small = u - w;
  return map;
}

// The same map with other singular values.
Matrix2d with_stretches(const LinearMap& map, double large, double small) {
  const double u = 0.5 * (map.large + map.small);
  const double w = 0.5 * (map.large - map.small);
  const double u_scale = u > 0.0 ? 0.5 * (large + small) / u : 0.0;
  const double w_scale = w > 0.0 ? 0.5 * (large - small) / w : 0.0;
  const double ux = u > 0.0 ? u_scale * map.ux : 0.5 * (large + small);
  const double uy = u_scale * map.uy;
  const double wx = w_scale * map.wx;
  const double wy = w_scale * map.wy;
  Matrix2d result;
  result << ux + wx, wy - uy, uy + wy, ux - wx;
  return result;
}

}  // namespace

WarpQuality measure_warp(const PlanarMesh& rest, const Points2& deformed) {
  if (deformed.rows() != rest.points.rows())
    throw InvalidArgument("the deformed mesh has another number of vertices");
  WarpQuality quality;
  quality.num_triangles = rest.triangles.rows();
  double rest_area = 0.0;
  double area = 0.0;
  double stretch = 0.0;
  double smallest = std::numeric_limits<double>::infinity();
  double largest = 0.0;
  for (Index f = 0; f < rest.triangles.rows(); ++f) {
    const Matrix2d before = edges(rest.points, rest.triangles, f);
    const double size = 0.5 * std::abs(before.determinant());
    if (size <= kFlat * before.squaredNorm()) {
      ++quality.degenerate;
      continue;
    }
    const LinearMap map = decompose(edges(deformed, rest.triangles, f) * before.inverse().eval());
    if (map.large * map.small <= kFlat) quality.flipped.push_back(static_cast<std::int32_t>(f));
    rest_area += size;
    area += size * map.large * map.small;
    stretch += 0.5 * size * (map.large + std::max(map.small, 0.0));
    smallest = std::min(smallest, std::max(map.small, 0.0));
    largest = std::max(largest, map.large);
  }
  if (rest_area > 0.0) {
    quality.min_stretch = smallest;
    quality.max_stretch = largest;
    quality.mean_stretch = stretch / rest_area;
    quality.area_change = area / rest_area - 1.0;
  }
  return quality;
}

PolishResult polish_folds(const ArapSystem& system, const PlanarMesh& rest, const Points2& deformed,
                          const PolishOptions& options, const RunControl& run) {
  if (options.max_iterations < 1) throw InvalidArgument("max_iterations must be >= 1");
  if (!(options.max_stretch > 1.0)) throw InvalidArgument("max_stretch must be > 1");
  const Index num_faces = rest.triangles.rows();
  Eigen::Matrix<double, Eigen::Dynamic, 4> inverse(num_faces, 4);
  std::vector<std::uint8_t> is_flat(static_cast<std::size_t>(num_faces), 0);
  for (Index f = 0; f < num_faces; ++f) {
    const Matrix2d before = edges(rest.points, rest.triangles, f);
    is_flat[static_cast<std::size_t>(f)] =
        std::abs(before.determinant()) <= 2.0 * kFlat * before.squaredNorm() ? 1 : 0;
    const Matrix2d inverted = is_flat[static_cast<std::size_t>(f)] != 0
                                  ? Matrix2d::Identity().eval()
                                  : before.inverse().eval();
    inverse.row(f) << inverted(0, 0), inverted(0, 1), inverted(1, 0), inverted(1, 1);
  }
  PolishResult best{deformed, 0, num_faces + 1};
  Points2 q;
  Eigen::Matrix<double, Eigen::Dynamic, 4> maps(num_faces, 4);
  for (int iteration = 0;; ++iteration) {
    run.throw_if_cancelled();
    // Where pins force more than k the bound itself keeps triangles folded, and what it led to is
    // no good start for a wider one.
    if (iteration % kLoosenEvery == 0) q = deformed;
    const double bound = options.max_stretch * std::exp2(iteration / kLoosenEvery);
    Index flipped = 0;
    for (Index f = 0; f < num_faces; ++f) {
      if (is_flat[static_cast<std::size_t>(f)] != 0) {
        maps.row(f) << 1.0, 0.0, 0.0, 1.0;
        continue;
      }
      Matrix2d inverted;
      inverted << inverse(f, 0), inverse(f, 1), inverse(f, 2), inverse(f, 3);
      const LinearMap map = decompose(edges(q, rest.triangles, f) * inverted);
      if (map.large * map.small <= kFlat) ++flipped;
      const Matrix2d clamped = with_stretches(map, std::clamp(map.large, 1.0 / bound, bound),
                                              std::clamp(map.small, 1.0 / bound, bound));
      maps.row(f) << clamped(0, 0), clamped(0, 1), clamped(1, 0), clamped(1, 1);
    }
    best.iterations = iteration;
    if (flipped < best.flipped) {
      best.flipped = flipped;
      best.points = q;
    }
    if (best.flipped == 0 || iteration == options.max_iterations) break;
    system.fit_triangles(q, maps);
  }
  return best;
}

}  // namespace dupin
