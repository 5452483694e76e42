#include "tests/support/scan_pair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "dupin/base/random.h"
#include "dupin/mesh/topology.h"

namespace dupin::test {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

Vector3d random_direction(Rng& rng) {
  Vector3d direction = Vector3d::Zero();
  while (direction.norm() < 1e-3) direction << rng.normal(), rng.normal(), rng.normal();
  return direction.normalized();
}

Points face_centers(const Mesh& mesh) {
  Points centers(mesh.triangles.rows(), 3);
  for (Index f = 0; f < centers.rows(); ++f) {
    const auto corners = mesh.triangles.row(f);
    centers.row(f) =
        (mesh.points.row(corners[0]) + mesh.points.row(corners[1]) + mesh.points.row(corners[2])) /
        3.0;
  }
  return centers;
}

/// Area of all faces that come before each one along `direction`, plus half its own, over the area
/// of all.
Eigen::VectorXd area_quantiles(const Mesh& mesh, const Vector3d& direction) {
  const Eigen::VectorXd height = face_centers(mesh) * direction;
  std::vector<Index> order(static_cast<std::size_t>(height.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return height[a] < height[b]; });
  Eigen::VectorXd quantile(height.size());
  double before = 0.0;
  for (const Index f : order) {
    const double area = triangle_area(mesh, f);
    quantile[f] = before + 0.5 * area;
    before += area;
  }
  return quantile / before;
}

Mesh faces_where(const Mesh& mesh, const Eigen::VectorXd& quantile, double from, double to) {
  std::vector<std::int32_t> new_index(static_cast<std::size_t>(mesh.points.rows()), -1);
  std::vector<std::array<std::int32_t, 3>> faces;
  std::vector<std::int32_t> kept;
  for (Index f = 0; f < quantile.size(); ++f) {
    if (quantile[f] < from || quantile[f] > to) continue;
    std::array<std::int32_t, 3> face{};
    for (int c = 0; c < 3; ++c) {
      const std::int32_t v = mesh.triangles(f, c);
      auto& index = new_index[static_cast<std::size_t>(v)];
      if (index < 0) {
        index = static_cast<std::int32_t>(kept.size());
        kept.push_back(v);
      }
      face[static_cast<std::size_t>(c)] = index;
    }
    faces.push_back(face);
  }
  Mesh part;
  part.points.resize(static_cast<Index>(kept.size()), 3);
  for (Index i = 0; i < part.points.rows(); ++i) {
    part.points.row(i) = mesh.points.row(kept[static_cast<std::size_t>(i)]);
  }
  part.triangles.resize(static_cast<Index>(faces.size()), 3);
  for (Index f = 0; f < part.triangles.rows(); ++f) {
    const auto& face = faces[static_cast<std::size_t>(f)];
    part.triangles.row(f) << face[0], face[1], face[2];
  }
  return part;
}

void displace(Points& points, double sigma, Rng& rng) {
  if (sigma <= 0.0) return;
  for (Index v = 0; v < points.rows(); ++v) {
    for (int c = 0; c < 3; ++c) points(v, c) += sigma * rng.normal();
  }
}

struct Spoke {
  std::int32_t from;  // the face leads from this neighbour ...
  std::int32_t to;    // ... to this one, counter-clockwise about the vertex
  std::int32_t face;
};

}  // namespace

Mesh slice(const Mesh& surface, const Vector3d& direction, double from, double to) {
  return faces_where(surface, area_quantiles(surface, direction), from, to);
}

Mesh dual_mesh(const Mesh& mesh) {
  std::vector<std::vector<Spoke>> spokes(static_cast<std::size_t>(mesh.points.rows()));
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      spokes[static_cast<std::size_t>(mesh.triangles(f, c))].push_back(
          {mesh.triangles(f, (c + 1) % 3), mesh.triangles(f, (c + 2) % 3),
           static_cast<std::int32_t>(f)});
    }
  }
  std::vector<std::array<std::int32_t, 3>> faces;
  for (const auto& around : spokes) {
    if (around.size() < 3) continue;
    std::vector<std::int32_t> ring{around.front().face};
    std::int32_t end = around.front().to;
    while (end != around.front().from && ring.size() <= around.size()) {
      const auto next = std::find_if(around.begin(), around.end(),
                                     [&](const Spoke& spoke) { return spoke.from == end; });
      if (next == around.end()) break;
      ring.push_back(next->face);
      end = next->to;
    }
    if (end != around.front().from || ring.size() != around.size()) continue;
    for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
      faces.push_back({ring[0], ring[i], ring[i + 1]});
    }
  }
  Mesh dual{face_centers(mesh), Triangles(static_cast<Index>(faces.size()), 3)};
  for (Index f = 0; f < dual.triangles.rows(); ++f) {
    const auto& face = faces[static_cast<std::size_t>(f)];
    dual.triangles.row(f) << face[0], face[1], face[2];
  }
  return dual;
}

Mesh mirrored(const Mesh& mesh) {
  Mesh out = mesh;
  out.points.col(0) *= -1.0;
  out.triangles.col(1).swap(out.triangles.col(2));
  return out;
}

Pose random_pose(double diameter, double scale_range, std::uint64_t seed) {
  Rng rng(seed);
  Pose out;
  out.rotation = random_rotation(rng);
  for (int c = 0; c < 3; ++c) out.translation[c] = rng.uniform(-diameter, diameter);
  const double reach = std::log(scale_range);
  if (reach > 0.0) out.scale = std::exp(rng.uniform(-reach, reach));
  return out;
}

ScanPair make_scan_pair(const Mesh& surface, const ScanPairOptions& options) {
  Rng rng(options.seed);
  const Vector3d direction = random_direction(rng);
  const std::uint64_t pose_seed = rng.next();
  const Eigen::VectorXd quantile = area_quantiles(surface, direction);
  // Parts [0, q] and [1 - q, 1] share 2 q - 1, which is to be `overlap` of q.
  const double q = 1.0 / (2.0 - options.overlap);

  ScanPair pair;
  const MeshTopology topology = compute_topology(surface.triangles, surface.points.rows());
  pair.edge = mean_edge_length(surface.points, topology.ring);
  pair.diameter =
      (surface.points.colwise().maxCoeff() - surface.points.colwise().minCoeff()).norm();
  pair.moving = faces_where(surface, quantile, 0.0, q);
  pair.fixed = faces_where(surface, quantile, 1.0 - q, 1.0);
  double shared = 0.0;
  for (Index f = 0; f < quantile.size(); ++f) {
    if (quantile[f] >= 1.0 - q && quantile[f] <= q) shared += triangle_area(surface, f);
  }
  pair.overlap = shared / std::min(surface_area(pair.moving), surface_area(pair.fixed));

  if (options.has_face_centers) pair.fixed = dual_mesh(pair.fixed);
  const double sigma = options.noise_percent / 100.0 * pair.edge;
  displace(pair.moving.points, sigma, rng);
  displace(pair.fixed.points, sigma, rng);
  const Pose placed = random_pose(pair.diameter, options.scale_range, pose_seed);
  pair.moving.points = transformed(pair.moving.points, placed);
  pair.truth = inverse(placed);
  return pair;
}

PoseError pose_error(const Pose& found, const Pose& truth, const Points& points) {
  const Points mean = points.colwise().mean();
  PoseError error;
  error.rotation_deg = rotation_angle(found.rotation, truth.rotation) * 180.0 / M_PI;
  error.translation = (transformed(mean, found) - transformed(mean, truth)).norm();
  error.scale = found.scale / truth.scale - 1.0;
  return error;
}

}  // namespace dupin::test
