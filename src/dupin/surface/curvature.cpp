#include "dupin/surface/curvature.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/math/symmetric3.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

// Sum of the areas of the faces on each directed edge, aligned with ring.neighbor.
std::vector<double> edge_areas(const Mesh& mesh, const Adjacency& ring) {
  std::vector<double> area(ring.neighbor.size(), 0.0);
  const auto slot = [&](std::int32_t a, std::int32_t b) {
    const auto* it = std::lower_bound(ring.begin(a), ring.end(a), b);
    return static_cast<std::size_t>(it - ring.neighbor.data());
  };
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const double face_area = triangle_area(mesh, f);
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = mesh.triangles(f, k);
      const std::int32_t b = mesh.triangles(f, (k + 1) % 3);
      if (a == b) continue;
      area[slot(a, b)] += face_area;
      area[slot(b, a)] += face_area;
    }
  }
  return area;
}

void resize(CurvatureField& field, Index num_vertices) {
  field.k1.setZero(num_vertices);
  field.k2.setZero(num_vertices);
  field.d1.setZero(num_vertices, 3);
  field.d2.setZero(num_vertices, 3);
  field.is_estimated.assign(static_cast<std::size_t>(num_vertices), 0);
}

// Symmetric 2 x 2 eigenproblem [a b; b c]: larger value first, `angle` of its direction.
struct Eigen2 {
  double large;
  double small;
  double cosine;
  double sine;
};
Eigen2 eigen_symmetric2(double a, double b, double c) {
  const double mean = 0.5 * (a + c);
  const double difference = 0.5 * (a - c);
  const double radius = std::hypot(difference, b);
  const double angle = 0.5 * std::atan2(b, difference);
  return {mean + radius, mean - radius, std::cos(angle), std::sin(angle)};
}

void estimate_at(const Mesh& mesh, const Adjacency& ring, const std::vector<double>& area, Index v,
                 CurvatureField& field) {
  const RowVector3d n = field.normals.row(v);
  if (n.squaredNorm() == 0.0) return;
  RowVector3d u;
  RowVector3d w;
  tangent_basis(n, u, w);
  const RowVector3d p = mesh.points.row(v);
  double total = 0.0;
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
    const RowVector3d edge = mesh.points.row(*j) - p;
    const double length2 = edge.squaredNorm();
    const double x = edge.dot(u);
    const double y = edge.dot(w);
    const double tangential2 = x * x + y * y;
    if (length2 == 0.0 || tangential2 <= 1e-24 * length2) continue;  // no tangent along this edge
    const double weight = area[static_cast<std::size_t>(j - ring.neighbor.data())];
    const double curvature = -2.0 * n.dot(edge) / length2;
    const double factor = weight * curvature / tangential2;
    a += factor * x * x;
    b += factor * x * y;
    c += factor * y * y;
    total += weight;
  }
  if (total <= 0.0) return;
  const Eigen2 m = eigen_symmetric2(a / total, b / total, c / total);
  field.k1[v] = 3.0 * m.large - m.small;
  field.k2[v] = 3.0 * m.small - m.large;
  field.d1.row(v) = m.cosine * u + m.sine * w;
  field.d2.row(v) = -m.sine * u + m.cosine * w;
  field.is_estimated[static_cast<std::size_t>(v)] = 1;
}

Index count_skipped(const CurvatureField& field) {
  Index skipped = 0;
  for (const std::uint8_t done : field.is_estimated) skipped += done == 0 ? 1 : 0;
  return skipped;
}

}  // namespace

CurvatureField estimate_curvature_taubin(const Mesh& mesh, const MeshTopology& topology,
                                         RunControl run) {
  if (topology.ring.num_vertices() != mesh.points.rows()) {
    throw InvalidArgument("topology has " + std::to_string(topology.ring.num_vertices()) +
                          " vertices, the mesh has " + std::to_string(mesh.points.rows()));
  }
  CurvatureField field;
  resize(field, mesh.points.rows());
  field.normals = vertex_normals(mesh);
  const std::vector<double> area = edge_areas(mesh, topology.ring);
  parallel_for(0, mesh.points.rows(), 4096, [&](Index first, Index last) {
    if (run.cancelled()) return;
    for (Index v = first; v < last; ++v) estimate_at(mesh, topology.ring, area, v, field);
  });
  field.num_skipped = count_skipped(field);
  if (run.cancelled()) field.status = Status::cancelled;
  run.report(1.0);
  return field;
}

TensorField curvature_tensor(const CurvatureField& field) {
  TensorField tensor(field.k1.size(), 6);
  for (Index v = 0; v < field.k1.size(); ++v) {
    const RowVector3d a = field.d1.row(v);
    const RowVector3d b = field.d2.row(v);
    Index entry = 0;
    for (Index r = 0; r < 3; ++r) {
      for (Index c = r; c < 3; ++c)
        tensor(v, entry++) = field.k1[v] * a[r] * a[c] + field.k2[v] * b[r] * b[c];
    }
  }
  return tensor;
}

CurvatureField diagonalise(const TensorField& tensor, const Points& normals) {
  if (tensor.rows() != normals.rows()) {
    throw InvalidArgument("tensor has " + std::to_string(tensor.rows()) + " rows, normals have " +
                          std::to_string(normals.rows()));
  }
  CurvatureField field;
  resize(field, tensor.rows());
  field.normals = normals;
  parallel_for(0, tensor.rows(), 4096, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      const RowVector3d n = normals.row(v);
      if (n.squaredNorm() == 0.0) continue;
      Eigen::Matrix3d matrix;
      matrix << tensor(v, 0), tensor(v, 1), tensor(v, 2), tensor(v, 1), tensor(v, 3), tensor(v, 4),
          tensor(v, 2), tensor(v, 4), tensor(v, 5);
      const SymmetricEigen3 eigen = eigen_symmetric(matrix);
      Index aside = 0;
      for (Index c = 1; c < 3; ++c) {
        if (std::abs(n.dot(eigen.vectors.col(c))) > std::abs(n.dot(eigen.vectors.col(aside))))
          aside = c;
      }
      const Index small = aside == 0 ? 1 : 0;
      const Index large = aside == 2 ? 1 : 2;
      field.k1[v] = eigen.values[large];
      field.k2[v] = eigen.values[small];
      field.d1.row(v) = eigen.vectors.col(large).transpose();
      field.d2.row(v) = eigen.vectors.col(small).transpose();
      field.is_estimated[static_cast<std::size_t>(v)] = 1;
    }
  });
  field.num_skipped = count_skipped(field);
  return field;
}

}  // namespace dupin
