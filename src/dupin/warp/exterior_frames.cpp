#include "dupin/warp/exterior_frames.h"

#include <algorithm>
#include <numeric>

#include "dupin/base/error.h"
#include "dupin/warp/planar_graph.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

constexpr double kSeparate = 1e-9;  // of the box diagonal: nearer vertices are at one place
constexpr std::size_t kPartners = 8;

}  // namespace

ExteriorFrame attach_exterior(const Points2& points, const Vector2d& point) {
  Eigen::VectorXd distance(points.rows());
  for (Index v = 0; v < points.rows(); ++v)
    distance[v] = (points.row(v).transpose() - point).norm();
  std::vector<std::int32_t> order(static_cast<std::size_t>(points.rows()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return distance[a] < distance[b]; });
  ExteriorFrame frame;
  const double least = kSeparate * box_diagonal(points);
  for (const std::int32_t v : order) {
    if (frame.base < 0) {
      frame.base = v;
      continue;
    }
    if (frame.partners.size() == kPartners) break;
    const Vector2d way = (points.row(v) - points.row(frame.base)).transpose();
    if (way.norm() <= least) continue;
    const Vector2d along = way.normalized();
    const Vector2d offset = point - points.row(frame.base).transpose();
    frame.partners.push_back(
        {v, offset.dot(along), -along.y() * offset.x() + along.x() * offset.y()});
  }
  if (frame.partners.empty())
    throw InvalidArgument("an exterior point needs vertices at two places");
  return frame;
}

Vector2d place_exterior(const Points2& points, const ExteriorFrame& frame) {
  const Vector2d base = points.row(frame.base).transpose();
  const double least = kSeparate * box_diagonal(points);
  for (const auto& partner : frame.partners) {
    const Vector2d way = points.row(partner.vertex).transpose() - base;
    if (way.norm() <= least) continue;
    const Vector2d along = way.normalized();
    return base + partner.u * along + partner.v * Vector2d(-along.y(), along.x());
  }
  return base;
}

}  // namespace dupin
