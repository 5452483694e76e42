#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/triangulate_outline.h"
#include "tests/support/mesh_promises.h"
#include "tests/support/outline_families.h"

namespace dupin {
namespace {

using Eigen::Index;

Points2 points_of(const std::vector<test::Corner>& points) { return test::loop_of(points); }

Outline square(double side) {
  return test::single({{0.0, 0.0}, {side, 0.0}, {side, side}, {0.0, side}});
}

Outline prepared(const Outline& raw, double spacing) {
  return prepare_outline(raw,
                         {.spacing_px = spacing, .tolerance_px = 0.5, .corner_angle_deg = 30.0})
      .outline;
}

MeshingOptions with_spacing(double spacing) {
  MeshingOptions options;
  options.spacing_px = spacing;
  return options;
}

std::string code_of(const Outline& outline) {
  try {
    triangulate_outline(outline);
  } catch (const Error& error) {
    return error.code() + " " + error.what();
  }
  return "none";
}

double smallest_angle_deg(const PlanarMesh& mesh) {
  double least = 180.0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const Eigen::RowVector2d a = mesh.points.row(mesh.triangles(f, k));
      const Eigen::RowVector2d u = mesh.points.row(mesh.triangles(f, (k + 1) % 3)) - a;
      const Eigen::RowVector2d v = mesh.points.row(mesh.triangles(f, (k + 2) % 3)) - a;
      least =
          std::min(least, std::acos(u.dot(v) / (u.norm() * v.norm())) * 180.0 / std::numbers::pi);
    }
  }
  return least;
}

// A triangle without room for a lattice point is itself: one triangle.
TEST(TriangulateOutline, LeavesASmallTriangleAlone) {
  const Outline outline = test::single({{0.0, 0.0}, {8.0, 0.0}, {4.0, 7.0}});
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(20.0));
  EXPECT_EQ(made.mesh.triangles.rows(), 1);
  EXPECT_EQ(test::broken_promise(outline, made), "");
}

// The area of an outline in whole pixels is a count of squares: 2 * 100^2 * 2^16.
TEST(ExactArea, OfASquareIsItsPixels) {
  EXPECT_EQ(exact_area(square(100.0)), std::int64_t{2} * 100 * 100 * 65536);
  Outline ring = square(100.0);
  ring.loops.push_back(points_of({{10.0, 10.0}, {10.0, 20.0}, {20.0, 20.0}, {20.0, 10.0}}));
  ring.component.push_back(0);
  EXPECT_EQ(exact_area(ring), std::int64_t{2} * (100 * 100 - 10 * 10) * 65536);
}

// Every promise (exact area, segments as chains, Delaunay, Euler, corners unmoved, causes of small
// angles) on every family of outlines; with pins.
class OutlineFamilies : public testing::TestWithParam<int> {};

TEST_P(OutlineFamilies, KeepAllPromises) {
  std::int64_t num_triangles = 0;
  for (std::uint64_t seed = 0; seed < 25; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(1000 * static_cast<std::uint64_t>(GetParam()) + seed);
    const Outline raw = test::random_outline(GetParam(), rng);
    const double spacing = rng.uniform(8.0, 30.0);
    const Outline outline = prepared(raw, spacing);
    Points2 pins(static_cast<Index>(rng.below(4)), 2);
    for (Index i = 0; i < pins.rows(); ++i)
      pins.row(i) << rng.uniform(0.0, 300.0), rng.uniform(0.0, 300.0);
    const TriangulatedOutline made = triangulate_outline(outline, pins, with_spacing(spacing));
    ASSERT_EQ(made.status, Status::ok);
    ASSERT_EQ(test::broken_promise(outline, made), "");
    num_triangles += made.mesh.triangles.rows();
  }
  EXPECT_GT(num_triangles, 500);
}

INSTANTIATE_TEST_SUITE_P(All, OutlineFamilies, testing::Range(0, test::kNumFamilies));

// The report is what a plain computation of all angles finds.
TEST(TriangulateOutline, ReportsTheSmallestAngleAndReaches25Degrees) {
  const Outline outline = prepared(test::single(test::circle(200.0, 200.0, 150.0, 90)), 12.0);
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(12.0));
  EXPECT_NEAR(made.report.smallest_angle_deg, smallest_angle_deg(made.mesh), 1e-6);
  EXPECT_GE(made.report.smallest_angle_deg, 25.0);
  EXPECT_EQ(made.report.num_below, 0);
  EXPECT_GT(made.report.mean_smallest_angle_deg, 55.0);  // a lattice: 60 but near the border
}

// Refinement is what reaches the angle: without it the same outline stays below.
TEST(TriangulateOutline, RefinementWidensTheAngles) {
  Rng rng(5);
  const Outline outline = prepared(test::random_outline(4, rng), 15.0);
  MeshingOptions none = with_spacing(15.0);
  none.min_angle_deg = 0.0;
  const TriangulatedOutline before = triangulate_outline(outline, {}, none);
  const TriangulatedOutline after = triangulate_outline(outline, {}, with_spacing(15.0));
  EXPECT_LT(before.report.smallest_angle_deg, 25.0);
  EXPECT_GE(after.report.smallest_angle_deg, 25.0);
  EXPECT_GT(after.report.num_steiner + after.report.num_splits, 0);
}

// No border edge that may be split has the third corner of its triangle inside the circle over it.
TEST(TriangulateOutline, BorderEdgesAreGabriel) {
  Rng rng(6);
  const double spacing = 15.0;
  const Outline outline = prepared(test::random_outline(4, rng), spacing);
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(spacing));
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> apex;
  for (Index f = 0; f < made.mesh.triangles.rows(); ++f)
    for (Index k = 0; k < 3; ++k)
      apex[{made.mesh.triangles(f, k), made.mesh.triangles(f, (k + 1) % 3)}] =
          made.mesh.triangles(f, (k + 2) % 3);
  for (const BorderEdge& e : made.border) {
    const Eigen::RowVector2d a = made.mesh.points.row(e.from), b = made.mesh.points.row(e.to);
    const Eigen::RowVector2d c = made.mesh.points.row(apex.at({e.from, e.to}));
    if ((b - a).norm() < spacing / 50.0) continue;
    EXPECT_GE((a - c).dot(b - c), 0.0);
  }
}

// Four small angles at the tips of a rhombus of 20 degrees: the input forces them, and the report
// says so; nowhere else is an angle small.
TEST(TriangulateOutline, CountsAnglesThatTheOutlineForces) {
  const double half = 100.0 * std::tan(10.0 * std::numbers::pi / 180.0);
  const Outline outline =
      prepared(test::single({{0.0, 0.0}, {100.0, -half}, {200.0, 0.0}, {100.0, half}}), 15.0);
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(15.0));
  EXPECT_EQ(test::broken_promise(outline, made), "");
  EXPECT_GE(made.report.num_below, 2);
  EXPECT_LE(made.report.num_below, 8);
  EXPECT_EQ(made.report.num_below, made.report.below_at_corners);
  // Miller, Pav and Walkington: none below atan(sin t / (2 - cos t)) at a corner of angle t, and
  // the tip itself is t; .05 degrees for the rounding of the corners.
  const double tip = 20.0 * std::numbers::pi / 180.0;
  const double bound = std::atan(std::sin(tip) / (2.0 - std::cos(tip))) * 180.0 / std::numbers::pi;
  EXPECT_GE(made.report.smallest_angle_deg, bound - 0.05);
  EXPECT_LE(made.report.smallest_angle_deg, 20.05);
  // Triangles that the tips force are left alone, not chased into them with ever shorter edges.
  for (const BorderEdge& e : made.border)
    EXPECT_GE((made.mesh.points.row(e.to) - made.mesh.points.row(e.from)).norm(), 15.0 / 8.0);
}

// A pin is a vertex at its place to half a step; pins at one place share one, pins outside and in
// holes get none, pins on the border and on corners become border vertices.
TEST(TriangulateOutline, FixedPointsBecomeVertices) {
  Outline raw = square(200.0);
  raw.loops.push_back(points_of({{90.0, 90.0}, {90.0, 130.0}, {130.0, 130.0}, {130.0, 90.0}}));
  raw.component.push_back(0);
  const Outline outline = prepared(raw, 20.0);
  const Points2 pins = points_of({{50.3, 60.7},
                                  {50.3, 60.7},
                                  {110.0, 110.0},
                                  {-3.0, 10.0},
                                  {5e9, 10.0},
                                  {77.7, 0.0},
                                  {200.0, 200.0},
                                  {150.2, 31.9}});
  const TriangulatedOutline made = triangulate_outline(outline, pins, with_spacing(20.0));
  ASSERT_EQ(test::broken_promise(outline, made), "");
  ASSERT_EQ(made.fixed_vertex.size(), 8u);
  for (const Index i : {0, 1, 5, 6, 7}) {
    const std::int32_t v = made.fixed_vertex[static_cast<std::size_t>(i)];
    ASSERT_GE(v, 0) << i;
    EXPECT_LE((made.mesh.points.row(v) - pins.row(i)).cwiseAbs().maxCoeff(), 0.5 * kMeshStep);
  }
  EXPECT_EQ(made.fixed_vertex[0], made.fixed_vertex[1]);
  EXPECT_EQ(made.fixed_vertex[2], -1);
  EXPECT_EQ(made.fixed_vertex[3], -1);
  EXPECT_EQ(made.fixed_vertex[4], -1);
  const auto on_border = [&](std::int32_t v) {
    return std::any_of(made.border.begin(), made.border.end(),
                       [&](const BorderEdge& e) { return e.from == v; });
  };
  EXPECT_TRUE(on_border(made.fixed_vertex[5]));
  EXPECT_TRUE(on_border(made.fixed_vertex[6]));
  EXPECT_FALSE(on_border(made.fixed_vertex[7]));
}

// Two pins closer than the spacing force small triangles, never a broken mesh.
TEST(TriangulateOutline, ClosePinsKeepAllPromises) {
  const Outline outline = prepared(square(200.0), 20.0);
  for (const double gap : {5.0, 0.3, 0.01, kMeshStep}) {
    const TriangulatedOutline made = triangulate_outline(
        outline, points_of({{80.0, 80.0}, {80.0 + gap, 80.0}, {80.0, gap}}), with_spacing(20.0));
    EXPECT_EQ(test::broken_promise(outline, made), "") << gap;
    EXPECT_NE(made.fixed_vertex[0], made.fixed_vertex[1]);
  }
}

// Parts of an outline keep their component numbers, islands in holes as well.
TEST(TriangulateOutline, SaysWhichComponentATriangleBelongsTo) {
  Rng rng(4);
  Outline raw = test::with_holes(rng);
  raw.loops.push_back(test::loop_of(test::circle(500.0, 200.0, 40.0, 30)));
  raw.component.push_back(7);
  const Outline outline = prepared(raw, 15.0);
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(15.0));
  for (Index f = 0; f < made.mesh.triangles.rows(); ++f) {
    const bool is_far = made.mesh.points(made.mesh.triangles(f, 0), 0) > 450.0;
    ASSERT_EQ(made.component[static_cast<std::size_t>(f)] == 7, is_far);
  }
}

// No guarded move and no flip lowers a smallest angle; the moves are real.
TEST(TriangulateOutline, SmoothingNeverLowersTheSmallestAngle) {
  int num_smoothed = 0;  // a thin outline may have no vertex to move
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Rng rng(seed);
    const Outline outline = prepared(test::random_outline(static_cast<int>(seed % 5), rng), 12.0);
    MeshingOptions rough = with_spacing(12.0);
    rough.smoothing_passes = 0;
    MeshingOptions smooth = rough;
    smooth.smoothing_passes = 8;
    const TriangulatedOutline before = triangulate_outline(outline, {}, rough);
    const TriangulatedOutline after = triangulate_outline(outline, {}, smooth);
    EXPECT_GE(after.report.smallest_angle_deg, before.report.smallest_angle_deg);
    num_smoothed += after.report.num_moves > 0 ? 1 : 0;
    EXPECT_EQ(test::broken_promise(outline, after), "");
  }
  EXPECT_GE(num_smoothed, 8);
}

// Moved by whole outline steps: the same mesh moved, bit for bit.
TEST(TriangulateOutline, CommutesWithTranslations) {
  Rng rng(9);
  const Outline outline = prepared(test::random_outline(0, rng), 14.0);
  Outline moved = outline;
  const Eigen::RowVector2d shift(1234.0 + 5.0 / 256.0, -77.25);
  for (Points2& loop : moved.loops) loop.rowwise() += shift;
  const TriangulatedOutline here = triangulate_outline(outline, {}, with_spacing(14.0));
  const TriangulatedOutline there = triangulate_outline(moved, {}, with_spacing(14.0));
  ASSERT_EQ(there.mesh.triangles, here.mesh.triangles);
  EXPECT_EQ(there.mesh.points, Points2(here.mesh.points.rowwise() + shift));
}

// Turned by 90 degrees the lattice lies otherwise, but the quality is the same: promises, area and,
// to 3 percent and a border's width, the number of triangles.
TEST(TriangulateOutline, IsAsGoodWhenTurnedByARightAngle) {
  Rng rng(10);
  const Outline outline = prepared(test::random_outline(4, rng), 10.0);
  Outline turned = outline;
  for (Points2& loop : turned.loops) {
    const Eigen::VectorXd x = loop.col(0);
    loop.col(0) = -loop.col(1);
    loop.col(1) = x;
  }
  const TriangulatedOutline here = triangulate_outline(outline, {}, with_spacing(10.0));
  const TriangulatedOutline there = triangulate_outline(turned, {}, with_spacing(10.0));
  EXPECT_EQ(test::broken_promise(turned, there), "");
  EXPECT_EQ(exact_area(here.mesh), exact_area(there.mesh));
  EXPECT_GE(there.report.smallest_angle_deg, 25.0);
  EXPECT_NEAR(static_cast<double>(there.mesh.triangles.rows()),
              static_cast<double>(here.mesh.triangles.rows()),
              0.03 * static_cast<double>(here.mesh.triangles.rows()) + 10.0);
}

TEST(TriangulateOutline, IsDeterministic) {
  Rng rng(11);
  const Outline outline = prepared(test::random_outline(5, rng), 9.0);
  const TriangulatedOutline first = triangulate_outline(outline, {}, with_spacing(9.0));
  const TriangulatedOutline second = triangulate_outline(outline, {}, with_spacing(9.0));
  EXPECT_EQ(first.mesh.triangles, second.mesh.triangles);
  EXPECT_EQ(first.mesh.points, second.mesh.points);
}

// Lattice points keep .7 of the spacing from the border where nothing needed refinement or moved.
TEST(TriangulateOutline, LatticePointsKeepTheirDistance) {
  const Outline outline = prepared(square(300.0), 20.0);
  MeshingOptions options = with_spacing(20.0);
  options.smoothing_passes = 0;
  options.min_angle_deg = 0.0;
  const TriangulatedOutline made = triangulate_outline(outline, {}, options);
  ASSERT_GT(made.report.num_lattice_points, 150);
  for (Index v = outline.loops[0].rows(); v < made.mesh.points.rows(); ++v) {
    const auto q = made.mesh.points.row(v);
    const double distance = std::min({q.x(), q.y(), 300.0 - q.x(), 300.0 - q.y()});
    EXPECT_GE(distance, 14.0 - kMeshStep);
  }
}

// The largest extent the grid holds, cut to a thin frame so that the mesh stays small.
TEST(TriangulateOutline, MeshesTheLargestExtent) {
  Outline outline = square(32768.0);
  const TriangulatedOutline made = triangulate_outline(outline, {}, with_spacing(8000.0));
  EXPECT_EQ(test::broken_promise(outline, made), "");
  outline.loops[0](2, 0) += 1.0;
  EXPECT_EQ(code_of(outline).substr(0, 11), "E_TOO_LARGE");
}

TEST(TriangulateOutline, RefusesWhatCannotBeMeshedAndSaysWhere) {
  const std::string bow_tie = code_of(test::single({{0, 0}, {100, 100}, {100, 0}, {0, 101}}));
  EXPECT_EQ(bow_tie.substr(0, 17), "E_OUTLINE_CROSSED");
  EXPECT_NE(bow_tie.find("loop 0, edge"), std::string::npos) << bow_tie;
  EXPECT_NE(bow_tie.find("near ("), std::string::npos);

  Outline touching = square(100.0);
  touching.loops.push_back(points_of({{0.0, 50.0}, {50.0, 60.0}, {50.0, 40.0}}));
  touching.component.push_back(0);
  EXPECT_NE(code_of(touching).find("touches corner 0 of loop 1"), std::string::npos);

  Outline repeated = square(100.0);
  repeated.loops.push_back(points_of({{0.0, 0.0}, {50.0, 60.0}, {50.0, 40.0}}));
  repeated.component.push_back(0);
  EXPECT_NE(code_of(repeated).find("lies on corner"), std::string::npos);

  Outline turned = square(100.0);
  turned.loops[0] = turned.loops[0].colwise().reverse().eval();
  EXPECT_EQ(code_of(turned).substr(0, 17), "E_OUTLINE_NESTING");

  Outline doubled = square(100.0);
  doubled.loops.push_back(points_of({{20.0, 20.0}, {50.0, 20.0}, {50.0, 60.0}}));
  doubled.component.push_back(1);
  EXPECT_EQ(code_of(doubled).substr(0, 17), "E_OUTLINE_NESTING");

  EXPECT_THROW(triangulate_outline(test::single({{0.001, 0}, {100, 0}, {50, 50}})),
               InvalidArgument);
  EXPECT_THROW(triangulate_outline(Outline{}), InvalidArgument);
  EXPECT_THROW(triangulate_outline(square(10.0), points_of({{NAN, 0.0}})), InvalidArgument);
  for (const double spacing : {0.0, -1.0, 1e9, double(NAN)})
    EXPECT_THROW(triangulate_outline(square(10.0), {}, with_spacing(spacing)), InvalidArgument);
}

TEST(TriangulateOutline, KeepsToItsLimitOfTriangles) {
  MeshingOptions options = with_spacing(5.0);
  options.max_triangles = 1000;
  EXPECT_THROW(triangulate_outline(square(300.0), {}, options), Error);
  // What refinement would add beyond the limit is left out, and the status says so.
  Rng rng(5);
  const Outline outline = prepared(test::random_outline(4, rng), 15.0);
  options = with_spacing(15.0);
  const Index all = triangulate_outline(outline, {}, options).mesh.triangles.rows();
  options.max_triangles = all - 20;
  const TriangulatedOutline part = triangulate_outline(outline, {}, options);
  EXPECT_EQ(part.status, Status::not_converged);
  EXPECT_LT(part.mesh.triangles.rows(), all);
  EXPECT_EQ(test::broken_promise(outline, part), "");
}

TEST(TriangulateOutline, CancelledGivesNothing) {
  const RunControl run = RunControl::create();
  run.cancel();
  const TriangulatedOutline made = triangulate_outline(square(300.0), {}, with_spacing(5.0), run);
  EXPECT_EQ(made.status, Status::cancelled);
  EXPECT_EQ(made.mesh.triangles.rows(), 0);
}

}  // namespace
}  // namespace dupin
