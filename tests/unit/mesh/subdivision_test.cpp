#include "dupin/mesh/subdivision.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mesh/topology.h"

namespace dupin {
namespace {

using Eigen::Index;

Index euler(const Mesh& mesh) {
  return mesh.points.rows() - compute_topology(mesh.triangles, mesh.points.rows()).num_edges +
         mesh.triangles.rows();
}

// A bumpy disc: interior vertices of several valences and a boundary with corners.
Mesh open_patch() {
  PlaneOptions options;
  options.num_vertices = 60;
  options.lattice = Lattice::square;
  options.jitter = 0.2;
  return add_noise(make_saddle(0.8, options).mesh, {.percent = 10.0}).mesh;
}

Mesh rough_sphere() { return add_noise(make_sphere(1.0, 42).mesh, {.percent = 20.0}).mesh; }

TEST(Subdivision, MidpointsChangeNeitherAreaNorVolumeNorShape) {
  const Mesh mesh = rough_sphere();
  const Mesh fine = midpoint_subdivide(mesh, 2);
  EXPECT_EQ(fine.triangles.rows(), 16 * mesh.triangles.rows());
  EXPECT_EQ(euler(fine), 2);
  EXPECT_NEAR(surface_area(fine), surface_area(mesh), 1e-13);
  EXPECT_NEAR(enclosed_volume(fine), enclosed_volume(mesh), 1e-13);
  EXPECT_TRUE(fine.points.topRows(mesh.points.rows()) == mesh.points);
}

TEST(Subdivision, LoopKeepsTheTopology) {
  EXPECT_EQ(euler(loop_subdivide(make_torus(2.0, 1.0, 50).mesh, 2)), 0);
  EXPECT_EQ(euler(loop_subdivide(rough_sphere(), 2)), 2);
  EXPECT_EQ(euler(loop_subdivide(open_patch(), 2)), 1);
}

// The limit mask is the left eigenvector of the subdivision matrix, so a vertex has the same limit
// point at every level. Any beta passes here: the quadratics below pin it.
TEST(Subdivision, EveryLevelAgreesOnTheLimit) {
  for (const Mesh& mesh : {rough_sphere(), open_patch()}) {
    const Points limit = loop_limit_points(mesh);
    const Points later = loop_limit_points(loop_subdivide(mesh, 2));
    EXPECT_LE((later.topRows(limit.rows()) - limit).cwiseAbs().maxCoeff(), 1e-14);
    // and the vertices go there: the deviation falls fourfold a level in the long run
    const Points third = loop_subdivide(mesh, 3).points.topRows(limit.rows());
    const Points fifth = loop_subdivide(mesh, 5).points.topRows(limit.rows());
    EXPECT_LE((fifth - limit).norm(), (third - limit).norm() / 6.0);
  }
}

// Weights sum to one: an affine map and subdivision commute.
TEST(Subdivision, LoopCommutesWithAffineMaps) {
  Eigen::Matrix3d linear;
  linear << 1.0, 0.3, -0.2, 0.1, 0.8, 0.4, -0.5, 0.2, 1.3;
  const Eigen::RowVector3d offset(3.0, -2.0, 0.7);
  Mesh mesh = open_patch();
  Points expected = (loop_subdivide(mesh, 2).points * linear).rowwise() + offset;
  mesh.points = ((mesh.points * linear).rowwise() + offset).eval();
  EXPECT_LE((loop_subdivide(mesh, 2).points - expected).cwiseAbs().maxCoeff(), 1e-14);
}

// A straight boundary stays straight and a plane stays a plane.
TEST(Subdivision, LoopKeepsPlanesAndStraightBorders) {
  PlaneOptions options;
  options.num_vertices = 49;
  options.lattice = Lattice::square;
  const Mesh fine = loop_subdivide(make_plane(options).mesh, 3);
  EXPECT_EQ(fine.points.col(2).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_LE(fine.points.leftCols<2>().cwiseAbs().maxCoeff(), 1.0 + 1e-15);
}

// On a regular hexagonal lattice Loop reproduces quadratics up to a constant: the three-directional
// box spline has the moments of a C2 scheme, so z = x^2 + y^2 keeps second differences exactly.
TEST(Subdivision, LoopReproducesQuadraticsOnTheRegularLattice) {
  PlaneOptions options;
  options.num_vertices = 900;
  const Mesh mesh = make_paraboloid(1.0, options).mesh;
  const Mesh fine = loop_subdivide(mesh, 1);
  double low = 1e300;
  double high = -1e300;
  for (Index v = 0; v < fine.points.rows(); ++v) {
    const Eigen::RowVector3d p = fine.points.row(v);
    if (p.head<2>().cwiseAbs().maxCoeff() > 0.6) continue;
    const double gap = p.z() + 0.5 * p.head<2>().squaredNorm();
    low = std::min(low, gap);
    high = std::max(high, gap);
  }
  EXPECT_LE(high - low, 1e-14);
}

TEST(Subdivision, RefusesWhatHasNoRule) {
  Mesh fan;
  fan.points = Points::Random(5, 3);
  fan.triangles.resize(3, 3);
  fan.triangles << 0, 1, 2, 1, 0, 3, 0, 1, 4;
  EXPECT_THROW(loop_subdivide(fan), InvalidArgument);
  fan.triangles.resize(2, 3);
  fan.triangles << 0, 1, 2, 0, 3, 4;
  EXPECT_THROW(loop_subdivide(fan), InvalidArgument);
  EXPECT_EQ(midpoint_subdivide(fan).triangles.rows(), 8);
  EXPECT_THROW(midpoint_subdivide(fan, 13), InvalidArgument);
  fan.triangles << 0, 1, 1, 0, 3, 4;
  EXPECT_THROW(midpoint_subdivide(fan), InvalidArgument);
  EXPECT_THROW(midpoint_subdivide(make_icosphere(1.0, 6).mesh, 12), InvalidArgument);
}

}  // namespace
}  // namespace dupin
