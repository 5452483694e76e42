#include "dupin/warp/planar_mesh.h"

#include <gtest/gtest.h>

#include <limits>

#include "dupin/base/error.h"

namespace dupin {
namespace {

Points2 square(double x, double y, double side, bool reversed = false) {
  Points2 loop(4, 2);
  loop << x, y, x + side, y, x + side, y + side, x, y + side;
  if (reversed) loop = loop.colwise().reverse().eval();
  return loop;
}

// A square with a square hole: 100 - 4, whatever the corner the sums start from.
TEST(PlanarMesh, AreaOfAnOutlineIsOuterLoopsLessHoles) {
  const Outline outline{{square(0, 0, 10), square(2, 2, 2, true)}, {0, 0}};
  EXPECT_EQ(signed_area(outline.loops[0]), 100.0);
  EXPECT_EQ(signed_area(outline.loops[1]), -4.0);
  EXPECT_EQ(signed_area(outline), 96.0);
}

// (0,0), (1,0), (0,1) in a picture with y down: right, then down: positive.
TEST(PlanarMesh, TrianglesTurnFromXTowardsY) {
  PlanarMesh mesh;
  mesh.points.resize(3, 2);
  mesh.points << 0, 0, 1, 0, 0, 1;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 1;
  EXPECT_EQ(signed_area(mesh, 0), 0.5);
  EXPECT_EQ(signed_area(mesh, 1), -0.5);
}

TEST(PlanarMesh, BrokenArraysAreRefused) {
  PlanarMesh mesh;
  mesh.points = square(0, 0, 1);
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 4;
  EXPECT_THROW(validate(mesh), InvalidArgument);
  mesh.triangles << 0, 1, 3;
  EXPECT_NO_THROW(validate(mesh));
  mesh.points(2, 1) = std::numeric_limits<double>::infinity();
  EXPECT_THROW(validate(mesh), InvalidArgument);

  Outline outline{{square(0, 0, 10)}, {0}};
  EXPECT_NO_THROW(validate(outline));
  outline.component.clear();
  EXPECT_THROW(validate(outline), InvalidArgument);
  outline = {{square(0, 0, 10).topRows(2)}, {0}};
  EXPECT_THROW(validate(outline), InvalidArgument);
}

}  // namespace
}  // namespace dupin
