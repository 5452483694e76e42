#include <gtest/gtest.h>

#include <algorithm>

#include "dupin/base/random.h"
#include "dupin/warp/planar_triangulation.h"
#include "dupin/warp/smooth_mesh.h"
#include "dupin/warp/spatial_order.h"

namespace dupin {
namespace {

using Triangulation = PlanarTriangulation;

std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

Triangulation box_of(std::int32_t extent) {
  return Triangulation({-2 * extent, -2 * extent}, {2 * extent, 2 * extent}, 64);
}

void insert_random(Triangulation& mesh, Rng& rng, std::int32_t extent, int count) {
  for (int i = 0; i < count; ++i) {
    const auto c = [&] {
      return static_cast<std::int32_t>(rng.below(2 * static_cast<std::uint64_t>(extent))) - extent;
    };
    const std::int32_t x = c();
    const GridPoint p{x, c()};
    const Triangulation::Location where = mesh.locate(p, 0, false);
    if (where.place != Triangulation::Place::vertex) mesh.insert(p, where);
  }
}

bool is_empty_circle(const Triangulation& mesh, std::int32_t t) {
  const std::int32_t* v = &mesh.origin[at(4 * t)];
  for (std::int32_t w = 0; w < mesh.num_vertices(); ++w)
    if (w != v[0] && w != v[1] && w != v[2] &&
        in_circle(mesh.p(v[0]), mesh.p(v[1]), mesh.p(v[2]), mesh.p(w)) > 0)
      return false;
  return true;
}

// Delaunay's definition, all circles against all points; small extents make cocircular points.
TEST(PlanarTriangulation, HasEmptyCircles) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const std::int32_t extent = seed % 2 == 0 ? 8 : 100000;
    Triangulation mesh = box_of(extent);
    insert_random(mesh, rng, extent, 60);
    std::int64_t area = 0;
    for (std::int32_t t = 0; t < mesh.num_triangles(); ++t) {
      const std::int32_t* v = &mesh.origin[at(4 * t)];
      const std::int64_t twice = orientation(mesh.p(v[0]), mesh.p(v[1]), mesh.p(v[2]));
      ASSERT_GT(twice, 0);
      area += twice;
      ASSERT_TRUE(is_empty_circle(mesh, t));
    }
    EXPECT_EQ(area, std::int64_t{32} * extent * extent);
    EXPECT_EQ(mesh.num_triangles(), 2 * mesh.num_vertices() - 6);  // Euler, four on the hull
  }
}

// Half-edges agree with their twins, and leaving[] with its vertex.
TEST(PlanarTriangulation, KeepsItsLinks) {
  Rng rng(3);
  Triangulation mesh = box_of(50);
  insert_random(mesh, rng, 50, 300);
  for (std::int32_t e = 0; e < 4 * mesh.num_triangles(); ++e) {
    if ((e & 3) == 3 || mesh.twin[at(e)] == Triangulation::kNone) continue;
    const std::int32_t b = mesh.twin[at(e)];
    ASSERT_EQ(mesh.twin[at(b)], e);
    ASSERT_EQ(mesh.origin[at(b)], mesh.destination(e));
  }
  for (std::int32_t v = 0; v < mesh.num_vertices(); ++v)
    ASSERT_EQ(mesh.origin[at(mesh.leaving[at(v)])], v);
}

// After a segment is forced in, it is an edge, every other edge is locally Delaunay, and vertices
// in the circle of a triangle are hidden from it by the segment.
TEST(PlanarTriangulation, ForcesSegmentsIn) {
  int num_forced = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Rng rng(seed);
    const std::int32_t extent = seed % 3 == 0 ? 12 : 1000;
    Triangulation mesh = box_of(extent);
    insert_random(mesh, rng, extent, 80);
    const auto u = static_cast<std::int32_t>(4 + rng.below(20));
    const auto v = static_cast<std::int32_t>(30 + rng.below(20));
    if (v >= mesh.num_vertices()) continue;
    const bool was_there = mesh.find_edge(u, v) != Triangulation::kNone;
    const Triangulation::Obstacle stop = mesh.insert_segment(u, v, 5);
    if (stop.kind == Triangulation::Obstacle::Kind::vertex) {
      ASSERT_EQ(orientation(mesh.p(u), mesh.p(v), mesh.p(stop.index)), 0);
      continue;
    }
    ASSERT_EQ(stop.kind, Triangulation::Obstacle::Kind::none);
    const std::int32_t e = mesh.find_edge(u, v);
    ASSERT_NE(e, Triangulation::kNone);
    EXPECT_EQ(mesh.segment[at(e)], 5);
    EXPECT_EQ(mesh.segment[at(mesh.twin[at(e)])], 5);
    num_forced += was_there ? 0 : 1;
    for (std::int32_t k = 0; k < 4 * mesh.num_triangles(); ++k) {
      if ((k & 3) == 3) continue;
      ASSERT_TRUE(mesh.is_locally_delaunay(k));
      ASSERT_GT(orientation(mesh.p(mesh.origin[at(k)]), mesh.p(mesh.destination(k)),
                            mesh.p(mesh.apex(k))),
                0);
    }
  }
  EXPECT_GT(num_forced, 150);
}

// A second segment across the first is refused and named, and nothing changes.
TEST(PlanarTriangulation, RefusesCrossingSegments) {
  Triangulation mesh = box_of(100);
  for (const GridPoint p : {GridPoint{-50, 0}, {50, 1}, {0, -50}, {1, 50}})
    mesh.insert(p, mesh.locate(p, 0, false));
  ASSERT_EQ(mesh.insert_segment(4, 5, 8).kind, Triangulation::Obstacle::Kind::none);
  const std::vector<std::int32_t> before = mesh.origin;
  const Triangulation::Obstacle stop = mesh.insert_segment(6, 7, 9);
  EXPECT_EQ(stop.kind, Triangulation::Obstacle::Kind::segment);
  EXPECT_EQ(stop.index, 8);
  EXPECT_EQ(mesh.origin, before);
}

TEST(PlanarTriangulation, WalksStopAtSegments) {
  Triangulation mesh = box_of(100);
  for (const GridPoint p : {GridPoint{0, -90}, {0, 90}}) mesh.insert(p, mesh.locate(p, 0, false));
  mesh.insert_segment(4, 5, 1);
  const GridPoint left{-50, 3}, right{50, 3};
  const std::int32_t start = mesh.locate(left, 0, false).edge;
  EXPECT_EQ(mesh.locate(right, start, true).place, Triangulation::Place::blocked);
  EXPECT_EQ(mesh.locate(right, start, false).place, Triangulation::Place::triangle);
  EXPECT_EQ(mesh.locate({0, -90}, start, false).place, Triangulation::Place::vertex);
  EXPECT_EQ(mesh.locate({0, 7}, start, false).place, Triangulation::Place::edge);
}

// Every index once, near places near in the order: steps within the last round, which holds half of
// the points, are short on average (a random order: about half the extent).
TEST(SpatialOrder, IsAPermutationAlongACurve) {
  Rng rng(4);
  std::vector<GridPoint> points;
  for (int i = 0; i < 4000; ++i)
    points.push_back({static_cast<std::int32_t>(rng.below(1 << 20)),
                      static_cast<std::int32_t>(rng.below(1 << 20))});
  std::vector<std::int32_t> order = spatial_order(points, {0, 0}, {1 << 20, 1 << 20});
  double sum = 0.0;
  for (std::size_t i = 2500; i + 1 < order.size(); ++i) {
    const GridPoint a = points[at(order[i])], b = points[at(order[i + 1])];
    sum += std::hypot(double(a.x) - b.x, double(a.y) - b.y);
  }
  EXPECT_LT(sum / 1499.0, 0.08 * (1 << 20));
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) ASSERT_EQ(order[i], static_cast<std::int32_t>(i));
}

// cot 60 for the equilateral triangle, 1 for the right isosceles one.
TEST(LargestCotangent, IsThatOfTheSmallestAngle) {
  EXPECT_DOUBLE_EQ(largest_cotangent({0, 0}, {100, 0}, {0, 100}), 1.0);
  EXPECT_NEAR(largest_cotangent({0, 0}, {100000, 0}, {50000, 86603}), 1.0 / std::sqrt(3.0), 1e-5);
  EXPECT_EQ(largest_cotangent({0, 0}, {0, 100}, {100, 0}), HUGE_VAL);
}

}  // namespace
}  // namespace dupin
