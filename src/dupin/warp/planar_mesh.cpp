#include "dupin/warp/planar_mesh.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;

double cross(const Eigen::RowVector2d& a, const Eigen::RowVector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

void require_finite(const Points2& points, const std::string& what) {
  for (Index i = 0; i < points.rows(); ++i) {
    if (!std::isfinite(points(i, 0)) || !std::isfinite(points(i, 1)))
      throw InvalidArgument(what + " " + std::to_string(i) +
                            " has a coordinate that is not finite");
  }
}

}  // namespace

double signed_area(const Points2& loop) {
  if (loop.rows() < 3) return 0.0;
  const Eigen::RowVector2d origin = loop.row(0);
  double sum = 0.0;
  for (Index i = 1; i + 1 < loop.rows(); ++i)
    sum += cross(loop.row(i) - origin, loop.row(i + 1) - origin);
  return 0.5 * sum;
}

double signed_area(const Outline& outline) {
  double sum = 0.0;
  for (const Points2& loop : outline.loops) sum += signed_area(loop);
  return sum;
}

double signed_area(const PlanarMesh& mesh, Index face) {
  const auto corner = [&](Index k) { return mesh.points.row(mesh.triangles(face, k)); };
  return 0.5 * cross(corner(1) - corner(0), corner(2) - corner(0));
}

void validate(const PlanarMesh& mesh) {
  require_finite(mesh.points, "vertex");
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t v = mesh.triangles(f, k);
      if (v < 0 || v >= mesh.points.rows())
        throw InvalidArgument("face " + std::to_string(f) + " names vertex " + std::to_string(v) +
                              " of " + std::to_string(mesh.points.rows()));
    }
  }
}

void validate(const Outline& outline) {
  if (outline.component.size() != outline.loops.size())
    throw InvalidArgument("an outline of " + std::to_string(outline.loops.size()) + " loops has " +
                          std::to_string(outline.component.size()) + " component numbers");
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    if (outline.loops[l].rows() < 3)
      throw InvalidArgument("loop " + std::to_string(l) + " has fewer than three corners");
    require_finite(outline.loops[l], "loop " + std::to_string(l) + ", corner");
  }
}

}  // namespace dupin
