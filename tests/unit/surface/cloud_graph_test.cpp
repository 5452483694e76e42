#include "dupin/surface/cloud_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {
namespace {

using Eigen::Index;

Points random_points(Index count, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Index i = 0; i < points.size(); ++i) points.data()[i] = rng.uniform(-1.0, 1.0);
  return points;
}

Points square_grid(Index side) {
  Points points(side * side, 3);
  for (Index v = 0; v < points.rows(); ++v)
    points.row(v) << static_cast<double>(v % side), static_cast<double>(v / side), 0.0;
  return points;
}

// A grid is all ties: which of them came first in the input must not choose the neighbours.
TEST(CloudGraph, DoesNotDependOnTheOrderOfThePoints) {
  const Points points = square_grid(17);
  std::vector<std::int32_t> to(static_cast<std::size_t>(points.rows()));
  std::iota(to.begin(), to.end(), 0);
  Rng rng(5);
  for (std::size_t i = to.size() - 1; i > 0; --i) std::swap(to[i], to[rng.below(i + 1)]);
  Points shuffled(points.rows(), 3);
  for (Index v = 0; v < points.rows(); ++v)
    shuffled.row(to[static_cast<std::size_t>(v)]) = points.row(v);
  for (const int neighbors : {3, 5, 6, 8, 10}) {
    const Adjacency ring = build_cloud_graph({points, {}}, {neighbors, 16}).ring;
    const Adjacency other = build_cloud_graph({shuffled, {}}, {neighbors, 16}).ring;
    for (Index v = 0; v < points.rows(); ++v) {
      std::vector<std::int32_t> expected;
      for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
        expected.push_back(to[static_cast<std::size_t>(*j)]);
      std::sort(expected.begin(), expected.end());
      const Index w = to[static_cast<std::size_t>(v)];
      EXPECT_EQ(std::vector<std::int32_t>(other.begin(w), other.end(w)), expected)
          << neighbors << " neighbours of point " << v;
    }
  }
}

// A sphere without faces: normals must be radial, and one orientation (outward, since the start is
// at the top) everywhere.
TEST(CloudGraph, OrientsTheNormalsOfASphereOutward) {
  const AnalyticSurface sphere = make_sphere(1.0, 3'000);
  const CloudGraph graph = build_cloud_graph({sphere.mesh.points, {}});
  for (Index v = 0; v < graph.normals.rows(); ++v) {
    EXPECT_GT(graph.normals.row(v).dot(sphere.normals.row(v)), 0.99);
    EXPECT_EQ(graph.is_boundary[static_cast<std::size_t>(v)], 0);
  }
}

TEST(CloudGraph, IsSymmetric) {
  const CloudGraph graph = build_cloud_graph({random_points(300, 9), {}});
  for (Index v = 0; v < 300; ++v) {
    EXPECT_GE(graph.ring.valence(v), 8);
    for (const std::int32_t* j = graph.ring.begin(v); j != graph.ring.end(v); ++j) {
      EXPECT_TRUE(std::binary_search(graph.ring.begin(*j), graph.ring.end(*j),
                                     static_cast<std::int32_t>(v)));
      EXPECT_NE(*j, v);
    }
  }
}

// The rim of a plane leaves half its surroundings empty; the inside does not.
TEST(CloudGraph, FindsTheRimOfAPlane) {
  const Mesh plane = make_plane({.num_vertices = 900}).mesh;
  const MeshTopology topology = compute_topology(plane.triangles, plane.points.rows());
  const CloudGraph graph = build_cloud_graph({plane.points, {}});
  Index inside = 0;
  for (Index v = 0; v < plane.points.rows(); ++v) {
    const double rim = 1.0 - plane.points.row(v).head(2).cwiseAbs().maxCoeff();
    if (rim < 0.01) {
      EXPECT_EQ(graph.is_boundary[static_cast<std::size_t>(v)], 1);
    }
    if (rim > 0.2) {
      EXPECT_EQ(graph.is_boundary[static_cast<std::size_t>(v)], 0);
      ++inside;
    }
  }
  EXPECT_GT(inside, 300);
}

// Found by fuzz_pipeline: the scatter of points at 1e300 is infinite, and the eigenproblem threw
// from a worker.
// A surface whose squares leave the range of a double has no lengths.
TEST(SurfaceGraph, RefusesWhatIsTooSmallOrTooLargeToMeasure) {
  const Mesh mesh = make_icosphere(1.0, 1).mesh;
  for (const double unit : {1e-170, 1e160}) {
    const Points points = unit * mesh.points;
    EXPECT_THROW(surface_graph(Mesh{points, mesh.triangles}), AnalysisError) << unit;
    EXPECT_THROW(surface_graph(PointCloud{points, {}}), AnalysisError) << unit;
  }
  for (const double unit : {1e-140, 1e140}) {
    const Points points = unit * mesh.points;
    const SurfaceGraph graph = surface_graph(Mesh{points, mesh.triangles});
    EXPECT_NEAR(graph.mean_edge / unit, surface_graph(mesh).mean_edge, 1e-12);
  }
}

TEST(CloudGraph, RefusesCoordinatesWhoseSquaresOverflow) {
  const Points points = 1e300 * random_points(20, 4);
  try {
    build_cloud_graph({points, {}});
    FAIL();
  } catch (const AnalysisError& error) {
    EXPECT_EQ(error.code(), "E_RANGE");
  }
}

TEST(CloudGraph, RefusesTooFewPoints) {
  try {
    build_cloud_graph({random_points(8, 1), {}});
    FAIL();
  } catch (const AnalysisError& error) {
    EXPECT_EQ(error.code(), "E_TOO_FEW_POINTS");
  }
}

// Given normals count as directions only: 1000 times as long, they give the same graph. Those that
// are zero or not finite are estimated, with the sign of their neighbours, here inward.
TEST(CloudGraph, NormalsNeedNotBeUnitVectors) {
  const Mesh sphere = make_sphere(1.0, 2'000).mesh;
  PointCloud cloud{sphere.points, -1000.0 * sphere.points};
  const CloudGraph all = build_cloud_graph(cloud);
  EXPECT_EQ(all.num_rescaled_normals, cloud.points.rows());
  EXPECT_EQ(all.first_rescaled_normal, 0);
  EXPECT_EQ(all.num_estimated_normals, 0);
  EXPECT_EQ(all.first_estimated_normal, -1);
  EXPECT_LE((all.normals + sphere.points).cwiseAbs().maxCoeff(), 1e-12);
  for (Eigen::Index v = 0; v < cloud.points.rows(); v += 3) {
    cloud.normals.row(v).setConstant(v % 2 == 0 ? 0.0 : std::nan(""));
  }
  const CloudGraph part = build_cloud_graph(cloud);
  EXPECT_EQ(part.num_estimated_normals, (cloud.points.rows() + 2) / 3);
  for (Eigen::Index v = 0; v < cloud.points.rows(); ++v) {
    // A plane through 16 neighbours of a sphere of 2,000 points leans by far less than 10 degrees.
    EXPECT_LT(part.normals.row(v).dot(sphere.points.row(v)), -0.98) << v;
    EXPECT_NEAR(part.normals.row(v).norm(), 1.0, 1e-12);
  }
  cloud.normals.conservativeResize(5, 3);
  EXPECT_THROW(build_cloud_graph(cloud), InvalidArgument);
}

TEST(CloudGraph, RefusesMoreNeighboursThanCanBeCounted) {
  const PointCloud cloud{make_sphere(1.0, 100).mesh.points, {}};
  CloudGraphOptions options;
  options.normal_neighbors = std::numeric_limits<int>::max();
  EXPECT_THROW(build_cloud_graph(cloud, options), InvalidArgument);
}

}  // namespace
}  // namespace dupin
