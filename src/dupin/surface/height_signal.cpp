#include "dupin/surface/height_signal.h"

#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"

namespace dupin {

using Eigen::Index;
using Eigen::RowVector3d;

namespace {
constexpr Index kGrain = 8192;
}

Points smooth_normals(const Points& normals, const Adjacency& ring, int times) {
  if (times < 0)
    throw InvalidArgument("normal_smoothing is " + std::to_string(times) + ", must be >= 0");
  if (normals.rows() != ring.num_vertices()) {
    throw InvalidArgument("normals have " + std::to_string(normals.rows()) +
                          " rows, the ring has " + std::to_string(ring.num_vertices()));
  }
  Points current = normals;
  Points next(normals.rows(), 3);
  for (int pass = 0; pass < times; ++pass) {
    parallel_for(0, normals.rows(), kGrain, [&](Index first, Index last) {
      for (Index v = first; v < last; ++v) {
        RowVector3d sum = current.row(v);
        for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) sum += current.row(*j);
        const double length = sum.norm();
        next.row(v) = length > 0.0 ? RowVector3d(sum / length) : RowVector3d(current.row(v));
      }
    });
    current.swap(next);
  }
  return current;
}

Eigen::VectorXd height_signal(const Points& points, const Points& normals, const Adjacency& ring,
                              const HeightSignalOptions& options) {
  if (points.rows() != ring.num_vertices()) {
    throw InvalidArgument("points have " + std::to_string(points.rows()) + " rows, the ring has " +
                          std::to_string(ring.num_vertices()));
  }
  const Points smooth = smooth_normals(normals, ring, options.normal_smoothing);
  const double edge = mean_edge_length(points, ring);
  Eigen::VectorXd height = Eigen::VectorXd::Zero(points.rows());
  if (edge == 0.0) return height;
  const double factor = 2.0 / (edge * edge);
  parallel_for(0, points.rows(), kGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      const std::int32_t valence = ring.valence(v);
      if (valence == 0) continue;
      // Differences first: the mean of the ring itself would carry the offset of the whole surface.
      RowVector3d sum = RowVector3d::Zero();
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
        sum += points.row(v) - points.row(*j);
      height[v] = factor * smooth.row(v).dot(sum) / static_cast<double>(valence);
    }
  });
  return height;
}

}  // namespace dupin
