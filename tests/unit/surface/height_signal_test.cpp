#include "dupin/surface/height_signal.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/surface/curvature.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {
namespace {

using Eigen::Index;

// On a ring of radius e about a point of a surface the mean of the ring lies H e^2 / 2 below it, so
// h = H; the sign is that of outward normals. Valence-5 vertices and uneven edges make the bound 10
// %.
TEST(HeightSignal, IsTheMeanCurvatureOfASphere) {
  const SurfaceGraph graph = surface_graph(make_icosphere(2.0, 4).mesh);
  const Eigen::VectorXd h = compute_signal(graph, Signal::height);
  EXPECT_NEAR(h.mean(), 0.5, 0.01);
  EXPECT_GT(h.minCoeff(), 0.0);
}

TEST(HeightSignal, IsZeroOnAPlaneInside) {
  const SurfaceGraph graph = surface_graph(make_plane({.num_vertices = 500, .jitter = 0.2}).mesh);
  const Eigen::VectorXd h = compute_signal(graph, Signal::height);
  for (Index v = 0; v < h.size(); ++v) EXPECT_NEAR(h[v], 0.0, 1e-12);
}

// The claim that makes it the default signal: each value is useless at 20 % noise, but the error is
// zero-mean. Noise along the normal also lengthens the edges, e^2 by 2 sigma^2 = 8 %, so the mean
// must be 1 / 1.08; its sampling error is below 1 %.
TEST(HeightSignal, NoiseAveragesOut) {
  const Mesh clean = make_icosphere(1.0, 5).mesh;
  const SurfaceGraph graph = surface_graph(add_noise(clean, {.percent = 20.0, .seed = 3}).mesh);
  const Eigen::VectorXd h = compute_signal(graph, Signal::height);
  const double spread = std::sqrt((h.array() - 1.0).square().mean());
  EXPECT_GT(spread, 3.0);
  EXPECT_NEAR(h.mean(), 1.0 / 1.08, 0.02);
}

TEST(HeightSignal, ScalesInverselyOverSixteenDecades) {
  const Mesh mesh = make_ellipsoid(1.0, 0.8, 0.6, 1'000).mesh;
  const Eigen::VectorXd expected = compute_signal(surface_graph(mesh), Signal::height);
  for (const double s : {1e-8, 1e8}) {
    const Eigen::VectorXd actual =
        compute_signal(surface_graph(Mesh{s * mesh.points, mesh.triangles}), Signal::height);
    EXPECT_TRUE((s * actual).isApprox(expected, 1e-9));
  }
}

TEST(SmoothNormals, KeepConstantFieldsAndUnitLength) {
  const Mesh mesh = make_icosphere(1.0, 3).mesh;
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  Points up = Points::Zero(mesh.points.rows(), 3);
  up.col(2).setOnes();
  EXPECT_TRUE(smooth_normals(up, topology.ring, 5).isApprox(up, 1e-15));
  const Points smooth = smooth_normals(vertex_normals(mesh), topology.ring, 5);
  EXPECT_LT((smooth.rowwise().norm().array() - 1.0).abs().maxCoeff(), 1e-14);
}

TEST(SmoothNormals, RefuseANegativeCount) {
  const Mesh mesh = make_icosphere(1.0, 1).mesh;
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  EXPECT_THROW(smooth_normals(vertex_normals(mesh), topology.ring, -1), InvalidArgument);
}

TEST(HeightSignal, AnIsolatedVertexGetsZero) {
  Mesh mesh = make_icosphere(1.0, 1).mesh;
  mesh.points.conservativeResize(mesh.points.rows() + 1, 3);
  mesh.points.bottomRows(1) << 9, 9, 9;
  const Eigen::VectorXd h = compute_signal(surface_graph(mesh), Signal::height);
  EXPECT_EQ(h[h.size() - 1], 0.0);
}

}  // namespace
}  // namespace dupin
