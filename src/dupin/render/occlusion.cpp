#include "dupin/render/occlusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "dupin/base/parallel.h"
#include "dupin/render/raster.h"

namespace dupin::detail {
namespace {

using Eigen::Index;

constexpr int kAxes = 24;  // each lights the surface from both of its ends
constexpr int kBatch = 8;
constexpr int kTexels = 512;
constexpr float kNothing = 4.0F;  // beyond any point of the unit ball
// A surface shadows itself within the footprint of a texel; points are lifted and compared with
// this much slack, in texels. Less gives acne, more loses creases of that size.
constexpr double kLift = 1.5;
constexpr double kSlack = 1.5;
constexpr double kTexel = 2.0 / kTexels;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// Directions of a Fibonacci lattice on the upper half of the sphere; with their opposites they
// cover it evenly.
Eigen::Vector3d axis_direction(int i) {
  const double z = 1.0 - (i + 0.5) / kAxes;
  const double turn = 2.0 * std::numbers::pi * (i + 0.5) * (std::numbers::phi - 1.0);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(turn), r * std::sin(turn), z};
}

// Nearest and farthest surface along an axis: one rasterisation for two directions of light.
struct DepthMap {
  Eigen::Matrix3d frame;  // rows: right, down, along the axis
  std::vector<float> top = std::vector<float>(at(kTexels) * at(kTexels), -kNothing);
  std::vector<float> bottom = std::vector<float>(at(kTexels) * at(kTexels), kNothing);

  explicit DepthMap(const Eigen::Vector3d& light) {
    const Eigen::Vector3d helper =
        std::abs(light.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    frame.row(2) = light.transpose();
    frame.row(0) = helper.cross(light).normalized().transpose();
    frame.row(1) = light.cross(frame.row(0).transpose()).transpose();
  }

  void draw(const Points& points, const Triangles& triangles) {
    std::vector<FixedPoint> place(at(points.rows()));
    std::vector<double> height(at(points.rows()));
    for (Index v = 0; v < points.rows(); ++v) {
      const Eigen::Vector3d p = frame * points.row(v).transpose();
      // Positive: rounding by truncation, an eighth of the price of lround.
      place[at(v)] = {static_cast<std::int32_t>((p.x() + 1.0) * (256.0 / kTexel) + 0.5),
                      static_cast<std::int32_t>((p.y() + 1.0) * (256.0 / kTexel) + 0.5)};
      height[at(v)] = p.z();
    }
    const SampleBox all{0, 0, kTexels, kTexels};
    for (Index f = 0; f < triangles.rows(); ++f) {
      const std::size_t a = at(triangles(f, 0));
      const std::size_t b = at(triangles(f, 1));
      const std::size_t c = at(triangles(f, 2));
      if (doubled_area(place[a], place[b], place[c]) == 0) continue;
      const SamplePlane plane(place[a], place[b], place[c], height[a], height[b], height[c]);
      fill_triangle(place[a], place[b], place[c], all, [&](int x, int y) {
        const std::size_t texel = at(y) * kTexels + at(x);
        const auto here = static_cast<float>(plane.at(x, y));
        top[texel] = std::max(top[texel], here);
        bottom[texel] = std::min(bottom[texel], here);
      });
    }
  }

  // Share of the four texels around `point` that are not between it and the light at the upper
  // or lower end of the axis.
  double visibility(const Eigen::Vector3d& point, bool is_from_top) const {
    const Eigen::Vector3d p = frame * point;
    const double x = (p.x() + 1.0) / kTexel - 0.5;
    const double y = (p.y() + 1.0) / kTexel - 0.5;
    const int x0 = std::clamp(static_cast<int>(x), 0, kTexels - 2);
    const int y0 = std::clamp(static_cast<int>(y), 0, kTexels - 2);
    const double fx = std::clamp(x - x0, 0.0, 1.0);
    const double fy = std::clamp(y - y0, 0.0, 1.0);
    const auto limit = static_cast<float>(p.z() + (is_from_top ? 1.0 : -1.0) * kSlack * kTexel);
    const auto free = [&](int i, int j) {
      const std::size_t texel = at(j) * kTexels + at(i);
      return (is_from_top ? top[texel] <= limit : bottom[texel] >= limit) ? 1.0 : 0.0;
    };
    return (1.0 - fy) * ((1.0 - fx) * free(x0, y0) + fx * free(x0 + 1, y0)) +
           fy * ((1.0 - fx) * free(x0, y0 + 1) + fx * free(x0 + 1, y0 + 1));
  }
};

std::vector<float> smoothed(const std::vector<float>& values, const Triangles& triangles) {
  std::vector<float> sum = values;
  std::vector<float> weight(values.size(), 1.0F);
  for (Index f = 0; f < triangles.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const std::size_t v = at(triangles(f, k));
      sum[v] +=
          0.5F * (values[at(triangles(f, (k + 1) % 3))] + values[at(triangles(f, (k + 2) % 3))]);
      weight[v] += 1.0F;
    }
  }
  for (std::size_t v = 0; v < sum.size(); ++v) sum[v] /= weight[v];
  return sum;
}

}  // namespace

std::vector<float> sky_visibility(const Points& points, const Points& normals,
                                  const Triangles& triangles, const RunControl& run) {
  const Index num_points = points.rows();
  std::vector<double> free(at(num_points), 0.0);
  std::vector<double> total(at(num_points), 0.0);
  std::vector<std::vector<float>> batch(kBatch, std::vector<float>(at(num_points)));
  for (int first = 0; first < kAxes && !run.cancelled(); first += kBatch) {
    parallel_for(0, kBatch, 1, [&](Index begin, Index end) {
      for (Index b = begin; b < end; ++b) {
        const Eigen::Vector3d light = axis_direction(first + static_cast<int>(b));
        DepthMap map(light);
        map.draw(points, triangles);
        for (Index v = 0; v < num_points; ++v) {
          const Eigen::Vector3d normal = normals.row(v).transpose();
          batch[at(b)][at(v)] = static_cast<float>(map.visibility(
              points.row(v).transpose() + (kLift * kTexel) * normal, normal.dot(light) > 0.0));
        }
      }
    });
    // The sum runs over the axes in order, whichever thread drew them.
    for (int b = 0; b < kBatch; ++b) {
      const Eigen::Vector3d light = axis_direction(first + b);
      for (Index v = 0; v < num_points; ++v) {
        const double cosine = std::abs(normals.row(v).dot(light));
        total[at(v)] += cosine;
        free[at(v)] += cosine * static_cast<double>(batch[at(b)][at(v)]);
      }
    }
    run.report(static_cast<double>(first + kBatch) / kAxes);
  }
  std::vector<float> share(at(num_points), 1.0F);
  for (std::size_t v = 0; v < share.size(); ++v) {
    if (total[v] > 0.0) share[v] = static_cast<float>(free[v] / total[v]);
  }
  return smoothed(share, triangles);
}

}  // namespace dupin::detail
