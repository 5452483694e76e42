#include "dupin/crest/ridge_segments.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using detail::RidgeSegments;

RidgeSegments segments_of(int num_crossings, std::vector<detail::RidgeSegment> segments) {
  RidgeSegments found;
  found.crossings.resize(static_cast<std::size_t>(num_crossings));
  found.segments = std::move(segments);
  return found;
}

// A path is walked from its end, in order.
TEST(LinkSegments, WalksAPathFromEndToEnd) {
  const auto chains = detail::link_segments(segments_of(4, {{2, 1}, {0, 2}, {1, 3}}));
  ASSERT_EQ(chains.size(), 1U);
  EXPECT_EQ(chains[0], (std::vector<std::int32_t>{0, 2, 1, 3}));
}

// A ring comes back to where it began.
TEST(LinkSegments, ClosesARing) {
  const auto chains = detail::link_segments(segments_of(3, {{0, 1}, {1, 2}, {2, 0}}));
  ASSERT_EQ(chains.size(), 1U);
  EXPECT_EQ(chains[0].size(), 4U);
  EXPECT_EQ(chains[0].front(), chains[0].back());
}

// Three segments at one crossing (an edge with three faces): three chains end there.
TEST(LinkSegments, EndsWhereThreeMeet) {
  const auto chains = detail::link_segments(segments_of(4, {{0, 3}, {1, 3}, {2, 3}}));
  EXPECT_EQ(chains.size(), 3U);
  for (const auto& chain : chains) EXPECT_EQ(chain.size(), 2U);
}

// bend = 2 + sign y^2 / 2 over a plane, with directions +-y at random.
struct Fold {
  SurfaceGraph graph = surface_graph(make_plane({.num_vertices = 2000, .jitter = 0.2}).mesh);
  detail::BendField field;

  explicit Fold(double sign) {
    const Eigen::Index count = graph.points.rows();
    field.bend.resize(count);
    field.strength = Eigen::VectorXd::Ones(count);
    field.direction = Points::Zero(count, 3);
    field.extremality.resize(count);
    Rng rng(3);
    for (Eigen::Index v = 0; v < count; ++v) {
      const double y = graph.points(v, 1);
      const double side = rng.below(2) == 0 ? 1.0 : -1.0;
      field.bend[v] = 2.0 + 0.5 * sign * y * y;
      field.direction(v, 1) = side;
      field.extremality[v] = side * sign * y;
    }
  }
};

// -y^2: the bend is largest along y = 0, whatever the signs of the directions; e is linear, so
// crossings are exact, and <grad e, t> = -1.
TEST(FindRidgeSegments, FindsTheLineWhereTheBendIsLargest) {
  const Fold fold(-1.0);
  const RidgeSegments found = detail::find_ridge_segments(fold.graph, fold.field);
  // The line crosses a strip of triangles from side to side, two on an edge's length.
  EXPECT_GT(found.segments.size(), 60U);
  for (const EdgeCrossing& c : found.crossings) {
    const double y =
        (1.0 - c.weight) * fold.graph.points(c.a, 1) + c.weight * fold.graph.points(c.b, 1);
    EXPECT_NEAR(y, 0.0, 1e-12);
    EXPECT_NEAR(c.sharpness, 1.0, 1e-9);
  }
  EXPECT_EQ(detail::link_segments(found).size(), 1U);
}

// +y^2: the same zeros of the extremality, but the bend is least there (E-29).
TEST(FindRidgeSegments, LeavesOutWhereTheBendIsLeast) {
  const Fold fold(1.0);
  EXPECT_TRUE(detail::find_ridge_segments(fold.graph, fold.field).segments.empty());
}

// Neither a curvature that bends the other way nor the weaker of the two makes a line.
TEST(FindRidgeSegments, LeavesOutTheOtherKindAndTheWeakerCurvature) {
  Fold fold(-1.0);
  fold.field.strength *= -1.0;
  EXPECT_TRUE(detail::find_ridge_segments(fold.graph, fold.field).segments.empty());
  fold.field.strength *= -1.0;
  fold.field.bend.array() -= 4.0;
  EXPECT_TRUE(detail::find_ridge_segments(fold.graph, fold.field).segments.empty());
}

// Where the strength changes its sign along the line, the line ends there, within a triangle: both
// ends of every segment are on the strong side (E-29).
TEST(FindRidgeSegments, EndsWhereTheOtherCurvatureBecomesTheStronger) {
  Fold fold(-1.0);
  fold.field.strength = fold.graph.points.col(0);
  const RidgeSegments found = detail::find_ridge_segments(fold.graph, fold.field);
  EXPECT_GT(found.segments.size(), 25U);
  for (const EdgeCrossing& c : found.crossings)
    EXPECT_GT((1.0 - c.weight) * fold.graph.points(c.a, 0) + c.weight * fold.graph.points(c.b, 0),
              0.0);
}

// The area-weighted mean of the gradients of a linear function is its gradient, on any triangles.
TEST(GradientStencil, IsExactForLinearFunctions) {
  const AnalyticSurface plane = make_plane({.num_vertices = 200, .jitter = 0.3, .seed = 3});
  const SurfaceGraph graph = surface_graph(plane.mesh);
  const detail::GradientStencil stencil =
      detail::gradient_stencil(graph.points, graph.triangles, graph.topology.ring);
  const Eigen::RowVector3d wanted(0.7, -1.3, 0.0);
  const Eigen::VectorXd value = graph.points * wanted.transpose();
  for (Eigen::Index v = 0; v < graph.points.rows(); ++v) {
    Eigen::RowVector3d gradient = Eigen::RowVector3d::Zero();
    const Adjacency& ring = graph.topology.ring;
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j)
      gradient += (value[*j] - value[v]) * stencil.weight.row(j - ring.neighbor.data());
    // Rounding of some ten terms.
    EXPECT_LT((gradient - wanted).norm(), 1e-12);
  }
}

// On a sphere dN = dp / r: the tensor is the tangential projector over r, positive for outward
// normals.
TEST(NormalGradient, OfASphereIsTheProjectorOverTheRadius) {
  const double radius = 2.5;
  const AnalyticSurface sphere = make_sphere(radius, 2500);
  const SurfaceGraph graph = surface_graph(sphere.mesh);
  const detail::GradientStencil stencil =
      detail::gradient_stencil(graph.points, graph.triangles, graph.topology.ring);
  const TensorField tensor = detail::normal_gradient(sphere.normals, graph.topology.ring, stencil);
  for (Eigen::Index v = 0; v < tensor.rows(); ++v) {
    const Eigen::RowVector3d n = sphere.normals.row(v);
    // e = 0.07 r; faces tilt by e / r against the tangent plane, which enters by its square.
    EXPECT_NEAR(tensor(v, 0), (1.0 - n[0] * n[0]) / radius, 0.01 / radius);
    EXPECT_NEAR(tensor(v, 1), -n[0] * n[1] / radius, 0.01 / radius);
    EXPECT_NEAR(tensor(v, 5), (1.0 - n[2] * n[2]) / radius, 0.01 / radius);
  }
}

// A tensor that is linear in tau, diag(3 + tau, 2 - tau) in the plane z = 0: extrapolated to no
// smoothing it is diag(3, 2) from every level that has a level r tau beyond it, between levels too;
// at the coarsest there is nothing to compare with.
TEST(PrincipalFrame, IsExtrapolatedToNoSmoothingWhereTheTensorIsLinear) {
  detail::TensorStack stack;
  stack.tau = Eigen::VectorXd::LinSpaced(9, 1.0, 5.0).array().square();
  for (int c = 0; c < 9; ++c) stack.column.push_back(LevelMatrixF::Zero(9, 1));
  for (Eigen::Index l = 0; l < 9; ++l) {
    stack.column[0](l, 0) = static_cast<float>(3.0 + stack.tau[l]);
    stack.column[3](l, 0) = static_cast<float>(2.0 - stack.tau[l]);
    stack.column[8](l, 0) = 1.0F;
  }
  for (const double level : {0.0, 1.0, 2.3, 5.9}) {
    const detail::PrincipalFrame plain = detail::principal_frame(stack, 0, level);
    EXPECT_GT(plain.k1 - plain.k2, 2.9) << level;
    for (const double ratio : {1.25, 1.6, 2.0}) {
      if (level > 4.0 && ratio > 1.5) continue;  // beyond tau = 25
      const detail::PrincipalFrame frame = detail::principal_frame(stack, 0, level, ratio);
      // Roundings of single precision, 1e-6 of 28, times the gain of four.
      EXPECT_NEAR(frame.k1, 3.0, 1e-4) << level << " " << ratio;
      EXPECT_NEAR(frame.k2, 2.0, 1e-4) << level << " " << ratio;
    }
  }
  EXPECT_EQ(detail::principal_frame(stack, 0, 8.0, 1.25).k1,
            detail::principal_frame(stack, 0, 8.0).k1);
  // Continuous on the way there.
  EXPECT_NEAR(detail::principal_frame(stack, 0, 7.999, 1.25).k1,
              detail::principal_frame(stack, 0, 8.0).k1, 0.05);
}

// For r = 1.25 the noise is 25 - 40 / 1.125^4 + 16 / 1.25^4 = 6.5816 of that without, which is that
// of tau / 6.5816^(1/4). As r goes to 1, T - tau dT/dtau: (1 + q^2 s / 2)^2 instead of 1, by the
// moments 3!, 4!, 5! of q^2 s: 1 + 4 + 5 = 10. Without extrapolation nothing changes.
TEST(ResolvedTau, IsThatOfAsMuchNoiseWithoutExtrapolation) {
  EXPECT_EQ(detail::resolved_tau(7.0, 1.0), 7.0);
  EXPECT_NEAR(detail::resolved_tau(1.0, 1.25), std::pow(6.5816, -0.25), 1e-5);
  EXPECT_NEAR(detail::resolved_tau(1.0, 1.0001), std::pow(10.0, -0.25), 1e-3);
}

// A vertex of no area has no normal, and no stencil.
TEST(GradientStencil, IsZeroWhereNoFaceHasAnArea) {
  Points points(3, 3);
  points << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  Triangles triangles(1, 3);
  triangles << 0, 1, 2;
  const SurfaceGraph graph = surface_graph(Mesh{points, triangles});
  const detail::GradientStencil stencil =
      detail::gradient_stencil(points, triangles, graph.topology.ring);
  EXPECT_EQ(stencil.weight.cwiseAbs().maxCoeff(), 0.0);
  EXPECT_EQ(
      detail::averaged_normals(points, triangles, graph.topology.ring, 2).cwiseAbs().maxCoeff(),
      0.0);
}

}  // namespace
}  // namespace dupin
