#include "dupin/mesh/topology.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"

namespace dupin {
namespace {

Mesh tetrahedron() {
  Mesh mesh;
  mesh.points.resize(4, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3;
  return mesh;
}

TEST(Topology, ATetrahedronHasSixEdgesAndNoBoundary) {
  const Mesh mesh = tetrahedron();
  const MeshTopology topology = compute_topology(mesh.triangles, 4);
  EXPECT_EQ(topology.num_edges, 6);
  EXPECT_EQ(topology.num_boundary_edges, 0);
  EXPECT_EQ(topology.num_nonmanifold_edges, 0);
  for (Eigen::Index v = 0; v < 4; ++v) EXPECT_EQ(topology.ring.valence(v), 3);
  EXPECT_EQ(find_components(topology.ring).count, 1);
  EXPECT_NEAR(mean_edge_length(mesh.points, topology.ring), (1.0 + std::sqrt(2.0)) / 2.0, 1e-15);
  EXPECT_NEAR(enclosed_volume(mesh), 1.0 / 6.0, 1e-15);
  EXPECT_NEAR(surface_area(mesh), 1.5 + std::sqrt(3.0) / 2.0, 1e-15);
}

// Three faces on one edge, and an isolated vertex.
TEST(Topology, CountsBoundaryAndNonManifoldEdges) {
  Triangles triangles(3, 3);
  triangles << 0, 1, 2, 1, 0, 3, 0, 1, 4;
  const MeshTopology topology = compute_topology(triangles, 6);
  EXPECT_EQ(topology.num_edges, 7);
  EXPECT_EQ(topology.num_nonmanifold_edges, 1);
  EXPECT_EQ(topology.num_boundary_edges, 6);
  EXPECT_EQ(topology.ring.valence(5), 0);
  EXPECT_EQ(topology.is_boundary[5], 0);
  EXPECT_EQ(find_components(topology.ring).count, 2);
}

TEST(Topology, ARepeatedIndexMakesNoLoopEdge) {
  Triangles triangles(1, 3);
  triangles << 0, 0, 1;
  const MeshTopology topology = compute_topology(triangles, 2);
  EXPECT_EQ(topology.num_edges, 1);
}

TEST(Topology, RefusesAnIndexOutOfRange) {
  Triangles triangles(1, 3);
  triangles << 0, 1, 2;
  EXPECT_THROW(compute_topology(triangles, 2), InvalidArgument);
}

// Offsets are int32 and a triangle has six directed edges.
TEST(Topology, RefusesMoreFacesThanCanBeIndexed) {
  EXPECT_NO_THROW(require_indexable(357'913'941));
  EXPECT_THROW(require_indexable(357'913'942), Error);
}

TEST(Mesh, ValidateNamesTheFirstBadVertex) {
  Mesh mesh = tetrahedron();
  mesh.points(2, 1) = HUGE_VAL;
  try {
    validate(mesh);
    FAIL() << "accepted an infinite coordinate";
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find("vertex 2"), std::string::npos);
  }
}

TEST(Mesh, NormalsPointOutOfATetrahedron) {
  const Mesh mesh = tetrahedron();
  const Points normals = vertex_normals(mesh);
  const Eigen::RowVector3d center = mesh.points.colwise().mean();
  for (Eigen::Index v = 0; v < 4; ++v) {
    EXPECT_NEAR(normals.row(v).norm(), 1.0, 1e-15);
    EXPECT_GT(normals.row(v).dot(mesh.points.row(v) - center), 0.0);
  }
}

}  // namespace
}  // namespace dupin
