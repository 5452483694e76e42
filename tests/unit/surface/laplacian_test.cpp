#include "dupin/surface/laplacian.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;

Eigen::VectorXd apply(const CotanWeights& weights, const Adjacency& ring,
                      const Eigen::VectorXd& f) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(f.size());
  for (Index v = 0; v < f.size(); ++v) {
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      result[v] += weights.weight[static_cast<std::size_t>(j - ring.neighbor.data())] *
                   (f[*j] - f[v]) / weights.mass[v];
    }
  }
  return result;
}

// Inside a flat Delaunay mesh no weight is clamped and the operator is exact for linear functions;
// x^2 + y^2 has Laplacian 4 on the regular lattice, whose lumped masses are the Voronoi areas
// (inventory A8).
TEST(CotanWeights, AreExactOnTheHexagonalLattice) {
  const Mesh mesh = make_plane({.num_vertices = 2'000}).mesh;
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  const CotanWeights weights = cotan_weights(mesh, topology);
  const Eigen::VectorXd linear = 3.0 * mesh.points.col(0) - 2.0 * mesh.points.col(1);
  const Eigen::VectorXd square = mesh.points.leftCols(2).rowwise().squaredNorm();
  const Eigen::VectorXd d_linear = apply(weights, topology.ring, linear);
  const Eigen::VectorXd d_square = apply(weights, topology.ring, square);
  Index tested = 0;
  for (Index v = 0; v < linear.size(); ++v) {
    if (topology.is_boundary[static_cast<std::size_t>(v)] != 0) continue;
    EXPECT_NEAR(d_linear[v], 0.0, 1e-9);
    EXPECT_NEAR(d_square[v], 4.0, 1e-9);
    ++tested;
  }
  EXPECT_GT(tested, 1'500);
}

TEST(CotanWeights, CountWhatTheyClamp) {
  // A needle and an obtuse pair: two triangles whose common edge sees angles above 90 degrees.
  Mesh mesh;
  mesh.points.resize(4, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 0.5, 0.1, 0, 0.5, -0.1, 0;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 1, 0, 3;
  const CotanWeights weights = cotan_weights(mesh, compute_topology(mesh.triangles, 4));
  EXPECT_EQ(weights.num_clamped_weights, 1);
  EXPECT_GE(weights.first_clamped_weight, 0);
  for (const double w : weights.weight) EXPECT_GE(w, 0.0);
  EXPECT_GT(weights.mass.minCoeff(), 0.0);
}

TEST(CotanWeights, AreSymmetricAndTheirMassesAddUpToTheArea) {
  const Mesh mesh = make_torus(1.0, 0.4, 3'000).mesh;
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  const CotanWeights weights = cotan_weights(mesh, topology);
  EXPECT_EQ(weights.num_clamped_masses, 0);
  EXPECT_EQ(weights.first_clamped_mass, -1);
  EXPECT_NEAR(weights.mass.sum(), surface_area(mesh), 1e-9);
  const Adjacency& ring = topology.ring;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      const std::int32_t* back =
          std::lower_bound(ring.begin(*j), ring.end(*j), static_cast<std::int32_t>(v));
      EXPECT_EQ(weights.weight[static_cast<std::size_t>(j - ring.neighbor.data())],
                weights.weight[static_cast<std::size_t>(back - ring.neighbor.data())]);
    }
  }
}

}  // namespace
}  // namespace dupin
