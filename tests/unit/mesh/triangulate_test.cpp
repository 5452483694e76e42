#include "dupin/mesh/triangulate.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <vector>

#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Index;

// Area of a plane polygon in z = 0 about its first corner.
double shoelace(const Points& p) {
  double sum = 0.0;
  for (Index i = 1; i + 1 < p.rows(); ++i) {
    sum += (p(i, 0) - p(0, 0)) * (p(i + 1, 1) - p(0, 1)) -
           (p(i + 1, 0) - p(0, 0)) * (p(i, 1) - p(0, 1));
  }
  return 0.5 * sum;
}

Eigen::RowVector3d area_vector(const Points& p, const std::array<std::int32_t, 3>& t) {
  const Eigen::RowVector3d a = p.row(t[0]);
  const Eigen::RowVector3d b = p.row(t[1]);
  const Eigen::RowVector3d c = p.row(t[2]);
  return 0.5 * (b - a).cross(c - a);
}

double area(const Points& p, const PolygonTriangles& result) {
  double sum = 0.0;
  for (const auto& t : result.triangles) sum += area_vector(p, t).norm();
  return sum;
}

// n - 2 triangles of the polygon's direction whose areas sum to its area: then they tile it.
void expect_tiling(const Points& p) {
  const PolygonTriangles result = triangulate_polygon(p);
  EXPECT_FALSE(result.is_crossed);
  EXPECT_EQ(static_cast<Index>(result.triangles.size()), p.rows() - 2);
  EXPECT_NEAR(area(p, result), std::abs(shoelace(p)), 1e-12 * std::abs(shoelace(p)));
  for (const auto& t : result.triangles) {
    ASSERT_GT(area_vector(p, t).z() * shoelace(p), 0.0) << "a triangle is turned over";
  }
}

Points flat(const std::vector<std::array<double, 2>>& corners) {
  Points p = Points::Zero(static_cast<Index>(corners.size()), 3);
  for (Index i = 0; i < p.rows(); ++i) {
    p(i, 0) = corners[static_cast<std::size_t>(i)][0];
    p(i, 1) = corners[static_cast<std::size_t>(i)][1];
  }
  return p;
}

// Star-shaped polygon of random radii: simple, with many reflex corners.
Points random_star(Index count, std::uint64_t seed) {
  Rng rng(seed);
  Points p = Points::Zero(count, 3);
  for (Index i = 0; i < count; ++i) {
    const double angle =
        2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
    const double r = rng.uniform(0.2, 1.0);
    p.row(i) << r * std::cos(angle), r * std::sin(angle), 0.0;
  }
  return p;
}

TEST(Triangulate, ConvexConcaveAndReversedPolygons) {
  for (const Index n : {5, 6, 7, 20, 101}) {
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      SCOPED_TRACE(seed);
      const Points p = random_star(n, seed);
      expect_tiling(p);
      expect_tiling(p.colwise().reverse());
    }
  }
  expect_tiling(flat({{0, 0}, {4, 0}, {4, 4}, {2, 1}, {0, 4}}));
}

// Snapped corners: straight angles and coinciding abscissae abound.
TEST(Triangulate, StaircasesAndCombs) {
  for (const int teeth : {2, 5, 50}) {
    std::vector<std::array<double, 2>> comb;
    std::vector<std::array<double, 2>> stairs;
    for (int i = 0; i < teeth; ++i) {
      comb.insert(comb.end(), {{2.0 * i, 0}, {2.0 * i, 5}, {2.0 * i + 1, 5}, {2.0 * i + 1, 0}});
      stairs.insert(stairs.end(), {{1.0 * i, 1.0 * i}, {i + 1.0, 1.0 * i}});
    }
    comb.insert(comb.end(), {{2.0 * teeth, 0}, {2.0 * teeth, -1}, {0, -1}});
    stairs.insert(stairs.end(), {{1.0 * teeth, 1.0 * teeth}, {0, 1.0 * teeth}});
    expect_tiling(flat(comb));
    expect_tiling(flat(stairs));
  }
}

// Corners on a side, as T-junctions leave them: still n - 2 triangles with area, no slivers.
TEST(Triangulate, CornersOnASideAreUsed) {
  expect_tiling(flat({{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}}));
  expect_tiling(flat({{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}));
  expect_tiling(flat({{0, 0}, {1, 0}, {2, 0}, {1, 2}}));
  const PolygonTriangles thirds = triangulate_polygon(
      flat({{0, 0}, {1.0 / 3.0, 1.0 / 3.0}, {2.0 / 3.0, 2.0 / 3.0}, {1, 1}, {0, 1}}));
  EXPECT_EQ(thirds.triangles.size(), 3U);
}

TEST(Triangulate, QuadsTakeTheShorterDiagonalInside) {
  const auto kite = triangulate_polygon(flat({{0, 0}, {3, -1}, {6, 0}, {3, 1}}));
  ASSERT_EQ(kite.triangles.size(), 2U);
  EXPECT_EQ(kite.triangles[0], (std::array<std::int32_t, 3>{0, 1, 3}));
  expect_tiling(flat({{0, 0}, {3, -1}, {1, 0}, {3, 1}}));  // a dart: only one diagonal is inside
  expect_tiling(flat({{3, -1}, {1, 0}, {3, 1}, {0, 0}}));
}

// The cut turns and scales with the polygon.
TEST(Triangulate, DoesNotDependOnPoseOrScale) {
  const Points p = random_star(30, 5);
  const auto expected = triangulate_polygon(p).triangles;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(3, -1, 2).normalized()).toRotationMatrix();
  for (const double scale : {1e-300, 1e-30, 1.0, 1e30, 1e300}) {
    SCOPED_TRACE(scale);
    const Points moved =
        scale * ((p * turn.transpose()).rowwise() + Eigen::RowVector3d(10, 20, 30));
    EXPECT_EQ(triangulate_polygon(moved).triangles, expected);
  }
}

TEST(Triangulate, DegeneratePolygonsGiveNothing) {
  EXPECT_TRUE(triangulate_polygon(Points(0, 3)).triangles.empty());
  EXPECT_TRUE(triangulate_polygon(flat({{0, 0}, {1, 0}})).triangles.empty());
  EXPECT_TRUE(triangulate_polygon(flat({{1, 1}, {1, 1}, {1, 1}, {1, 1}})).triangles.empty());
  const auto line = triangulate_polygon(flat({{0, 0}, {1, 1}, {3, 3}, {2, 2}, {1.5, 1.5}}));
  EXPECT_TRUE(line.triangles.empty());
  EXPECT_FALSE(line.is_crossed);
  const auto repeated = triangulate_polygon(flat({{0, 0}, {0, 0}, {1, 0}, {1, 0}, {0, 1}, {0, 0}}));
  ASSERT_EQ(repeated.triangles.size(), 1U);
}

TEST(Triangulate, SaysThatAPolygonCrossesItself) {
  EXPECT_TRUE(triangulate_polygon(flat({{0, 0}, {1, 1}, {1, 0}, {0, 1}})).is_crossed);
  std::vector<std::array<double, 2>> pentagram;
  for (int k = 0; k < 5; ++k) {
    const double angle = 4.0 * std::numbers::pi * k / 5.0;
    pentagram.push_back({std::cos(angle), std::sin(angle)});
  }
  const auto result = triangulate_polygon(flat(pentagram));
  EXPECT_TRUE(result.is_crossed);
  EXPECT_FALSE(result.triangles.empty());
}

TEST(Triangulate, TenThousandCornersTakeWellUnderASecond) {
  std::vector<std::array<double, 2>> spiral;
  for (int k = 0; k < 5000; ++k) {
    const double angle = 20.0 * std::numbers::pi * k / 5000.0;
    spiral.push_back({(1.0 + angle) * std::cos(angle), (1.0 + angle) * std::sin(angle)});
  }
  for (int k = 4999; k >= 0; --k) {
    const double angle = 20.0 * std::numbers::pi * k / 5000.0;
    spiral.push_back({(2.0 + angle) * std::cos(angle), (2.0 + angle) * std::sin(angle)});
  }
  for (const Points& p : {random_star(10000, 1), flat(spiral)}) {
    const auto start = std::chrono::steady_clock::now();
    const PolygonTriangles result = triangulate_polygon(p);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    EXPECT_NEAR(area(p, result), std::abs(shoelace(p)), 1e-12 * area(p, result));
    EXPECT_FALSE(result.is_crossed);
    RecordProperty("seconds", std::to_string(seconds.count()));
    EXPECT_LT(seconds.count(), 2.0) << "unoptimised; about twenty times faster in a release build";
  }
}

}  // namespace
}  // namespace dupin
