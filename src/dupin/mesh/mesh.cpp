#include "dupin/mesh/mesh.h"

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

RowVector3d doubled_area_vector(const Mesh& mesh, Index face) {
  const RowVector3d a = mesh.points.row(mesh.triangles(face, 0));
  const RowVector3d b = mesh.points.row(mesh.triangles(face, 1));
  const RowVector3d c = mesh.points.row(mesh.triangles(face, 2));
  return (b - a).cross(c - a);
}

}  // namespace

void validate(const Mesh& mesh) {
  const Index num_vertices = mesh.points.rows();
  for (Index v = 0; v < num_vertices; ++v) {
    // Eigen's allFinite() computes x - x, which raises FE_INVALID for an infinity.
    if (!std::isfinite(mesh.points(v, 0)) || !std::isfinite(mesh.points(v, 1)) ||
        !std::isfinite(mesh.points(v, 2))) {
      throw InvalidArgument("points: vertex " + std::to_string(v) + " is not finite");
    }
  }
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t v = mesh.triangles(f, k);
      if (v < 0 || v >= num_vertices) {
        throw InvalidArgument("triangles: face " + std::to_string(f) + " uses vertex " +
                              std::to_string(v) + ", but there are " +
                              std::to_string(num_vertices));
      }
    }
  }
}

double triangle_area(const Mesh& mesh, Index face) {
  return 0.5 * doubled_area_vector(mesh, face).norm();
}

double surface_area(const Mesh& mesh) {
  double area = 0.0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) area += triangle_area(mesh, f);
  return area;
}

double enclosed_volume(const Mesh& mesh) {
  if (mesh.points.rows() == 0) return 0.0;
  const RowVector3d center = mesh.points.colwise().mean();
  double volume = 0.0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const RowVector3d a = mesh.points.row(mesh.triangles(f, 0)) - center;
    const RowVector3d b = mesh.points.row(mesh.triangles(f, 1)) - center;
    const RowVector3d c = mesh.points.row(mesh.triangles(f, 2)) - center;
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return volume;
}

Points vertex_normals(const Mesh& mesh) {
  Points normals = Points::Zero(mesh.points.rows(), 3);
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const RowVector3d n = doubled_area_vector(mesh, f);
    for (Index k = 0; k < 3; ++k) normals.row(mesh.triangles(f, k)) += n;
  }
  for (Index v = 0; v < normals.rows(); ++v) {
    const double length = normals.row(v).norm();
    if (length > 0.0) normals.row(v) /= length;
  }
  return normals;
}

}  // namespace dupin
