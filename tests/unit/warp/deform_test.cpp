#include "dupin/warp/deform.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/exterior_frames.h"
#include "tests/support/planar_shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::Vector2d;

constexpr double kPi = 3.14159265358979323846;

Pin pin(double x, double y, double to_x, double to_y) {
  Pin p;
  p.source = {x, y};
  p.target = {to_x, to_y};
  return p;
}

Pin resting(double x, double y) { return pin(x, y, x, y); }

// Pins on vertices, on an edge, inside triangles, two in one triangle.
std::vector<Pin> pins_anywhere() {
  return {resting(50.0, 50.0),  resting(103.0, 20.0), resting(151.7, 88.4),
          resting(152.9, 89.9), resting(20.3, 140.0), resting(190.0, 10.0)};
}

std::string code_of(const PlanarMesh& mesh, const std::vector<Pin>& pins) {
  try {
    deform(mesh, pins);
  } catch (const Error& error) {
    return error.code();
  }
  return "";
}

// Identity: pins at rest, also off the vertices, leave every vertex within 1e-9 px, for every kind
// of distance and weight.
TEST(Deform, WithPinsAtRestIsTheIdentity) {
  const PlanarMesh mesh = test::jittered(test::planar_grid(20, 15, 10.0), 2.0);
  for (const auto metric : {WarpMetric::geodesic, WarpMetric::edges, WarpMetric::euclidean}) {
    for (const auto weights : {EdgeWeights::uniform, EdgeWeights::cotangent}) {
      DeformOptions options;
      options.warp.metric = metric;
      options.warp.edge_weights = weights;
      const Deformation result = deform(mesh, pins_anywhere(), options);
      EXPECT_EQ(result.status, Status::ok);
      EXPECT_LT((result.points - mesh.points).cwiseAbs().maxCoeff(), 1e-9);
      EXPECT_TRUE(result.quality.flipped.empty());
      EXPECT_NEAR(result.quality.area_change, 0.0, 1e-12);
    }
  }
}

// The mesher puts a pin on its grid, up to 2^-16 px beside: with that vertex for an anchor, pins at
// rest leave the shape as it is, and a motion is carried whole.
TEST(Deform, AnAnchorBesideItsSourceKeepsTheIdentity) {
  const PlanarMesh mesh = test::planar_grid(20, 15, 10.0);
  std::vector<Pin> pins;
  for (const auto& at : {Vector2d(50.0, 50.0), Vector2d(150.0, 80.0), Vector2d(30.0, 120.0)}) {
    Pin p;
    p.source = p.target = at + Vector2d(1.2e-5, -0.9e-5);
    p.anchor = locate(mesh, at);
    ASSERT_TRUE(p.anchor.has_value());
    pins.push_back(p);
  }
  EXPECT_LT((deform(mesh, pins).points - mesh.points).cwiseAbs().maxCoeff(), 1e-9);
  for (Pin& p : pins) p.target += Vector2d(7.0, -3.0);
  const Points2 moved = deform(mesh, pins).points.rowwise() - RowVector2d(7.0, -3.0);
  EXPECT_LT((moved - mesh.points).cwiseAbs().maxCoeff(), 1e-9);
}

// What one stage folds over and a later one lays flat again stays flat: orientation is that of the
// first shape, not of the one between.
TEST(Deform, UnfoldedByALaterStageStaysUnfolded) {
  const PlanarMesh mesh = test::planar_grid(6, 6, 10.0);
  std::vector<Pin> fold;
  std::vector<Pin> unfold;
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    Pin p;
    p.source = mesh.points.row(v).transpose();
    p.target = {std::min(p.source.x(), 60.0 - p.source.x()), p.source.y()};
    for (Index f = 0; f < mesh.triangles.rows() && !p.anchor; ++f) {
      for (Index k = 0; k < 3; ++k) {
        if (mesh.triangles(f, k) != v) continue;
        p.anchor = MeshPoint{static_cast<std::int32_t>(f), Eigen::Vector3d::Unit(k)};
      }
    }
    fold.push_back(p);
    std::swap(p.source, p.target);
    unfold.push_back(p);
  }
  const DeformStage first{DeformMode::coarse, fold, {}};
  EXPECT_EQ(deform(mesh, std::vector<DeformStage>{first}).quality.flipped.size(), 36U);
  const Deformation both = deform(mesh, {first, {DeformMode::coarse, unfold, {}}});
  EXPECT_TRUE(both.quality.flipped.empty());
  EXPECT_EQ(both.stages[1].flipped_before_polish, 0);
  EXPECT_LT((both.points - mesh.points).cwiseAbs().maxCoeff(), 1e-9);
}

// Depths of one stage hold until another one gives some.
TEST(Deform, DepthsOfAStageStayUntilOthersAreGiven) {
  const PlanarMesh mesh = test::planar_grid(6, 6, 10.0);
  Pin near = resting(10.0, 10.0);
  near.depth = 2.0;
  const DeformStage deep{DeformMode::coarse, {near, resting(50.0, 50.0)}, {}};
  const DeformStage flat{DeformMode::coarse, {resting(10.0, 50.0), resting(50.0, 10.0)}, {}};
  const Deformation one = deform(mesh, std::vector<DeformStage>{deep});
  EXPECT_GT(one.depth.maxCoeff(), 1.9);
  EXPECT_EQ(deform(mesh, {deep, flat}).depth, one.depth);
  EXPECT_EQ(deform(mesh, {flat, deep}).depth, one.depth);
}

// Two pins at one place with different radii would leave the choice to their order.
TEST(Deform, PinsAtOnePlaceThatDifferAreRefused) {
  const PlanarMesh mesh = test::planar_grid(4, 4, 20.0);
  Pin wide = resting(40.0, 40.0);
  EXPECT_EQ(code_of(mesh, {resting(40.0, 40.0), wide}), "");
  wide.radius = 15.0;
  EXPECT_EQ(code_of(mesh, {resting(40.0, 40.0), wide}), "E_PIN_CONFLICT");
}

// Every pin ends where it should, within 1e-6 px, and with a rotation at rest nothing moves either.
TEST(Deform, InterpolatesPinsAnywhere) {
  const PlanarMesh mesh = test::jittered(test::planar_grid(20, 15, 10.0), 2.0);
  std::vector<Pin> pins = pins_anywhere();
  for (auto& p : pins) p.rotation = 0.0;
  EXPECT_LT((deform(mesh, pins).points - mesh.points).cwiseAbs().maxCoeff(), 1e-9);
  for (const bool has_rotation : {false, true}) {
    for (std::size_t m = 0; m < pins.size(); ++m) {
      const auto k = static_cast<double>(m);
      pins[m].target = pins[m].source + Vector2d(15.0 * std::sin(3.0 * k), 12.0 * std::cos(k));
      pins[m].rotation.reset();
      if (has_rotation && m % 2 == 0) pins[m].rotation = 0.2 * k;
    }
    pins[3].target = pins[3].source + (pins[2].target - pins[2].source);
    for (const int iterations : {0, 1, 20}) {
      DeformOptions options;
      options.warp.iterations = iterations;
      options.is_polished = false;
      const Deformation result = deform(mesh, pins, options);
      for (const Pin& p : pins) {
        const auto place = locate(mesh, p.source);
        ASSERT_TRUE(place);
        EXPECT_LT((position(result.points, mesh.triangles, *place) - p.target).norm(), 1e-6);
      }
      EXPECT_LT(result.stages[0].largest_violation_px, 1e-6);
    }
  }
}

// A rigid motion of all pins is that motion of the mesh within 1e-6 px.
TEST(Deform, ReproducesARigidMotionOfAllPins) {
  const PlanarMesh mesh = test::sleeve_shape();
  for (const bool has_rotation : {false, true}) {
    std::vector<Pin> pins = {resting(20.0, 140.0), resting(90.0, 101.3), resting(131.0, 12.0)};
    for (Pin& p : pins) {
      const Points2 source = p.source.transpose();
      p.target = test::moved_rigidly(source, 1.1, 30.0, -200.0).row(0).transpose();
      if (has_rotation) p.rotation = 1.1;
    }
    const Deformation result = deform(mesh, pins);
    const Points2 expected = test::moved_rigidly(mesh.points, 1.1, 30.0, -200.0);
    EXPECT_LT((result.points - expected).cwiseAbs().maxCoeff(), 1e-6);
  }
}

// The hard case of the thesis (Fig. 7.2): a cuff pin moves 60 px away, the torso across the gap of
// 5 px stays within 1 % of that. Through the air it is dragged along.
TEST(Deform, OfASleeveLeavesTheTorsoStill) {
  const PlanarMesh mesh = test::sleeve_shape();
  const std::vector<Pin> pins = {pin(20.0, 145.0, -35.0, 130.0),
                                 pin(20.0, 90.0, -12.0, 82.0),
                                 resting(45.0, 15.0),
                                 resting(95.0, 15.0),
                                 resting(50.0, 190.0),
                                 resting(140.0, 190.0),
                                 resting(50.0, 60.0),
                                 resting(140.0, 60.0)};
  const double motion = (pins[0].target - pins[0].source).norm();
  const auto torso_motion = [&](WarpMetric metric, int iterations, double alpha = 2.0) {
    DeformOptions options;
    options.warp.metric = metric;
    options.warp.iterations = iterations;
    options.warp.mls.alpha = alpha;
    options.is_polished = false;
    const Points2 q = deform(mesh, pins, options).points;
    double largest = 0.0;
    for (Index v = 0; v < q.rows(); ++v) {
      if (mesh.points(v, 0) >= 45.0 && mesh.points(v, 1) > 75.0)
        largest = std::max(largest, (q.row(v) - mesh.points.row(v)).norm());
    }
    return largest / motion;
  };
  EXPECT_LT(torso_motion(WarpMetric::geodesic, 0), 0.1);
  EXPECT_LT(torso_motion(WarpMetric::geodesic, 10), 0.01);
  EXPECT_LT(torso_motion(WarpMetric::geodesic, 1, 4.0), 0.01);
  EXPECT_GT(torso_motion(WarpMetric::euclidean, 0), 0.15);
}

TEST(Deform, EnergyNeverRisesAndIsReported) {
  const PlanarMesh mesh = test::sleeve_shape();
  const std::vector<Pin> pins = {pin(20.0, 145.0, -80.0, 100.0), resting(95.3, 100.7),
                                 resting(140.0, 190.0)};
  DeformOptions options;
  options.warp.iterations = 40;
  const Deformation result = deform(mesh, pins, options);
  const auto& energy = result.stages[0].energy;
  ASSERT_EQ(energy.size(), 41U);
  for (std::size_t i = 1; i < energy.size(); ++i) EXPECT_LE(energy[i], energy[i - 1] * (1 + 1e-12));
  EXPECT_LT(energy.back(), 0.9 * energy.front());
  // With a tolerance it stops where an iteration gains less, and says when it did not get there.
  options.warp.iterations = 2000;
  options.warp.tolerance = 1e-3;
  const Deformation settled = deform(mesh, pins, options);
  EXPECT_EQ(settled.status, Status::ok);
  EXPECT_LT(settled.stages[0].iterations, 500);
  options.warp.iterations = 2;
  options.warp.tolerance = 1e-9;
  EXPECT_EQ(deform(mesh, pins, options).status, Status::not_converged);
}

double turn_of(const Points2& p, const Points2& q, Index centre, Index v) {
  const RowVector2d before = p.row(v) - p.row(centre);
  const RowVector2d after = q.row(v) - q.row(centre);
  return std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after));
}

// The ring of a rotated pin turns by its angle, within half a degree; that of a radius too. Without
// a hold ARAP forgets the angle.
TEST(Deform, TurnsTheRingOfARotatedPin) {
  const PlanarMesh mesh = test::planar_grid(20, 20, 10.0);
  const PlanarGraph graph = make_planar_graph(mesh);
  const Index centre = test::nearest_vertex(mesh.points, 100.0, 100.0);
  std::vector<Pin> pins = {resting(100.0, 100.0), resting(0.0, 0.0), resting(200.0, 200.0)};
  pins[0].rotation = 30.0 * kPi / 180.0;
  DeformOptions options;
  options.warp.iterations = 50;
  const Points2 q = deform(mesh, pins, options).points;
  for (const std::int32_t* k = graph.topology.ring.begin(centre);
       k != graph.topology.ring.end(centre); ++k)
    EXPECT_NEAR(turn_of(mesh.points, q, centre, *k), *pins[0].rotation, 0.5 * kPi / 180.0);
  const Index far = test::nearest_vertex(mesh.points, 130.0, 100.0);
  EXPECT_LT(turn_of(mesh.points, q, centre, far), *pins[0].rotation - 1.0 * kPi / 180.0);
  pins[0].radius = 35.0;
  const Points2 wide = deform(mesh, pins, options).points;
  EXPECT_NEAR(turn_of(mesh.points, wide, centre, far), *pins[0].rotation, 1e-9);
}

// 7.3.3 as printed: the angle is a start, six iterations, vertices with small residuals stay. What
// belongs to the pin turns with it exactly, as far as the mended band is away.
TEST(Deform, CanRotateAsTheThesis) {
  const PlanarMesh mesh = test::planar_grid(60, 6, 5.0);
  std::vector<Pin> pins = {resting(15.0, 15.0), resting(285.0, 15.0)};
  pins[1].rotation = 20.0 * kPi / 180.0;
  DeformOptions options;
  options.warp.rotation = RotationMode::thesis;
  options.is_polished = false;
  const Deformation result = deform(mesh, pins, options);
  EXPECT_EQ(result.stages[0].iterations, 6);
  const Index centre = test::nearest_vertex(mesh.points, 285.0, 15.0);
  const Index near = test::nearest_vertex(mesh.points, 250.0, 30.0);
  EXPECT_NEAR(turn_of(mesh.points, result.points, centre, near), *pins[1].rotation, 1e-9);
  const Index still = test::nearest_vertex(mesh.points, 50.0, 30.0);
  EXPECT_LT((result.points.row(still) - mesh.points.row(still)).norm(), 1e-9);
  EXPECT_LT(result.stages[0].energy.back(), 0.5 * result.stages[0].energy.front());
}

// Two ropes laid on each other, one over the other at the left and under it at the right: every
// triangle there comes before or after all of the other rope's. The depths of the pins decide.
TEST(Deform, PaintsInterlacedRopesInOrder) {
  const PlanarMesh mesh =
      test::planar_cells(60, 12, 5.0, [](double, double y) { return y < 20.0 || y > 40.0; });
  std::vector<Pin> pins;
  for (const double x : {50.0, 150.0, 250.0}) {
    const double over = x == 150.0 ? 0.0 : (x < 150.0 ? 1.0 : -1.0);
    Pin upper = pin(x, 10.0, x, 30.0);
    upper.depth = over;
    Pin lower = pin(x, 50.0, x, 30.0);
    lower.depth = -over;
    pins.push_back(upper);
    pins.push_back(lower);
  }
  const Deformation result = deform(mesh, pins);
  std::vector<std::size_t> rank(result.paint_order.size());
  for (std::size_t i = 0; i < rank.size(); ++i)
    rank[static_cast<std::size_t>(result.paint_order[i])] = i;
  // In the left third the upper rope is above all of the lower one, in the right third below.
  const auto centre = [&](Index f) {
    return RowVector2d((mesh.points.row(mesh.triangles(f, 0)) +
                        mesh.points.row(mesh.triangles(f, 1)) +
                        mesh.points.row(mesh.triangles(f, 2))) /
                       3.0);
  };
  int compared = 0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    for (Index g = 0; g < mesh.triangles.rows(); ++g) {
      const RowVector2d a = centre(f);
      const RowVector2d b = centre(g);
      if (a.y() > 30.0 || b.y() < 30.0 || std::abs(a.x() - b.x()) > 10.0) continue;
      const bool is_over = rank[static_cast<std::size_t>(f)] > rank[static_cast<std::size_t>(g)];
      if (std::abs(a.x() - 50.0) < 35.0) {
        EXPECT_TRUE(is_over);
      } else if (std::abs(a.x() - 250.0) < 35.0) {
        EXPECT_FALSE(is_over);
      } else {
        continue;
      }
      ++compared;
    }
  }
  EXPECT_GT(compared, 500);
}

// A pin dragged across its neighbours folds triangles over; the polish takes that out and keeps the
// pins.
TEST(Deform, PolishTakesFoldsOut) {
  const PlanarMesh mesh = test::planar_grid(20, 20, 10.0);
  const std::vector<Pin> corners = {resting(0.0, 0.0), resting(200.0, 0.0), resting(0.0, 200.0),
                                    resting(200.0, 200.0)};
  for (const bool is_through : {false, true}) {
    SCOPED_TRACE(is_through);
    std::vector<Pin> pins = corners;
    if (is_through) {
      pins.push_back(pin(100.0, 60.0, 100.0, 140.0));
      pins.push_back(resting(60.0, 100.0));
      pins.push_back(resting(140.0, 100.0));
    } else {
      pins.push_back(pin(100.0, 100.0, 146.0, 100.0));
      pins.push_back(resting(150.0, 100.0));
    }
    DeformOptions options;
    options.is_polished = false;
    const Deformation rough = deform(mesh, pins, options);
    ASSERT_FALSE(rough.quality.flipped.empty());
    EXPECT_TRUE(rough.warnings.contains("W_FOLD_OVER"));
    options.is_polished = true;
    const Deformation polished = deform(mesh, pins, options);
    EXPECT_EQ(polished.quality.flipped.size(), 0U);
    EXPECT_GT(polished.quality.min_stretch, 0.0);
    EXPECT_EQ(polished.stages[0].flipped_before_polish,
              static_cast<Index>(rough.quality.flipped.size()));
    EXPECT_LT(polished.stages[0].largest_violation_px, 1e-6);
    EXPECT_FALSE(polished.warnings.contains("W_FOLD_OVER"));
  }
}

// Three pins of one triangle, turned over: no polish can help, and the report says so.
TEST(Deform, SaysWhatPinsForceToFold) {
  const PlanarMesh mesh = test::planar_grid(10, 10, 10.0);
  const std::vector<Pin> pins = {pin(50.0, 50.0, 60.0, 50.0), pin(60.0, 50.0, 50.0, 50.0),
                                 pin(60.0, 60.0, 60.0, 60.0), resting(0.0, 0.0)};
  const Deformation result = deform(mesh, pins);
  EXPECT_FALSE(result.quality.flipped.empty());
  EXPECT_TRUE(result.warnings.contains("W_FOLD_OVER"));
  EXPECT_EQ(result.quality.min_stretch, 0.0);
}

// A stage begins where the one before ended: splitting is not the same as one stage, replaying is
// the same to the bit, and stages without motion change nothing.
TEST(Deform, StagesAreReplayedInOrder) {
  const PlanarMesh mesh = test::sleeve_shape();
  const std::vector<Pin> first = {pin(20.0, 145.0, -30.0, 130.0), resting(95.0, 100.0),
                                  resting(140.0, 190.0)};
  const Deformation one = deform(mesh, first);
  const auto carried = [&](double x, double y) {
    return position(one.points, mesh.triangles, locate(mesh, Vector2d(x, y)).value());
  };
  DeformStage fine{DeformMode::fine, {}, {}};
  for (const auto& corner : {Vector2d(0.0, 0.0), Vector2d(145.0, 0.0), Vector2d(145.0, 200.0),
                             Vector2d(45.0, 200.0), Vector2d(40.0, 150.0), Vector2d(0.0, 150.0)}) {
    Pin p;
    p.source = carried(corner.x(), corner.y());
    p.target = p.source;
    fine.pins.push_back(p);
  }
  const DeformStage coarse{DeformMode::coarse, first, {}};
  DeformOptions options;
  options.warp.line_spacing_px = 25.0;
  const Deformation two = deform(mesh, {coarse, fine}, options);
  EXPECT_LT((two.points - one.points).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_EQ(two.stages.size(), 2U);
  fine.pins[1].target += Vector2d(12.0, -5.0);
  const Deformation three = deform(mesh, {coarse, fine, DeformStage{}}, options);
  const Index corner = test::nearest_vertex(mesh.points, 145.0, 0.0);
  EXPECT_LT((three.points.row(corner).transpose() - fine.pins[1].target).norm(), 1e-6);
  // A pull in two halves is another shape than the whole pull: each half starts from a shape that
  // the first has bent.
  std::vector<Pin> half = first;
  half[0].target = 0.5 * (first[0].source + first[0].target);
  std::vector<Pin> rest = first;
  rest[0].source = half[0].target;
  const Deformation split =
      deform(mesh, {{DeformMode::coarse, half, {}}, {DeformMode::coarse, rest, {}}}, options);
  EXPECT_GT((split.points - one.points).cwiseAbs().maxCoeff(), 0.1);
  const Deformation again = deform(mesh, {coarse, fine, DeformStage{}}, options);
  EXPECT_TRUE((again.points.array() == three.points.array()).all());
}

// Between two exterior points the border follows the straight line between their targets, the
// better the denser the samples: the line is the limit.
TEST(Deform, ControlLinesConvergeWithDenserSamples) {
  const PlanarMesh mesh = test::planar_grid(40, 20, 5.0);
  DeformStage fine{DeformMode::fine,
                   {pin(0.0, 0.0, 0.0, -10.0), pin(200.0, 0.0, 200.0, 20.0), resting(200.0, 100.0),
                    resting(0.0, 100.0)},
                   {}};
  std::vector<double> error;
  for (const double spacing : {100.0, 50.0, 25.0, 5.0}) {
    DeformOptions options;
    options.warp.line_spacing_px = spacing;
    options.is_polished = false;
    const Points2 q = deform(mesh, {fine}, options).points;
    double largest = 0.0;
    for (Index v = 0; v <= 40; ++v) {
      const double t = mesh.points(v, 0) / 200.0;
      largest = std::max(largest, (q.row(v) - RowVector2d(200.0 * t, -10.0 + 30.0 * t)).norm());
    }
    error.push_back(largest);
  }
  EXPECT_GT(error[0], error[1]);
  EXPECT_GT(error[1], error[2]);
  EXPECT_LT(error[3], 1e-9);  // a sample at every vertex
}

// Eq. 7.31 to 7.33: a rigid motion carries the point exactly, also when the first partner falls on
// the base.
TEST(ExteriorFrames, AreCarriedByRigidMotions) {
  const PlanarMesh mesh = test::jittered(test::planar_grid(4, 4, 10.0), 1.0);
  const Vector2d point(-3.0, 17.0);
  const ExteriorFrame frame = attach_exterior(mesh.points, point);
  EXPECT_LT((place_exterior(mesh.points, frame) - point).norm(), 1e-12);
  const Points2 moved = test::moved_rigidly(mesh.points, 2.0, 5.0, 9.0);
  const Points2 expected = test::moved_rigidly(point.transpose(), 2.0, 5.0, 9.0);
  EXPECT_LT((place_exterior(moved, frame).transpose() - expected.row(0)).norm(), 1e-12);
  Points2 collapsed = moved;
  collapsed.row(frame.partners[0].vertex) = collapsed.row(frame.base);
  EXPECT_LT((place_exterior(collapsed, frame).transpose() - expected.row(0)).norm(), 1e-12);
  EXPECT_THROW(attach_exterior(Points2::Zero(3, 2), point), InvalidArgument);
}

// Bad input has a code and names what is wrong (contract, row 23).
TEST(Deform, NamesBadPins) {
  const PlanarMesh mesh = test::planar_cells(5, 5, 10.0, [](double x, double y) {
    return std::abs(x - 25.0) > 6 || std::abs(y - 25.0) > 6;
  });
  EXPECT_EQ(code_of(mesh, {resting(5.0, 5.0)}), "");
  EXPECT_EQ(code_of(mesh, {resting(25.0, 25.0)}), "E_PIN_OUTSIDE");
  EXPECT_EQ(code_of(mesh, {resting(-1.0, 5.0)}), "E_PIN_OUTSIDE");
  EXPECT_EQ(code_of(mesh, {resting(5.0, 5.0), pin(5.0, 5.0, 9.0, 9.0)}), "E_PIN_CONFLICT");
  EXPECT_EQ(code_of(mesh, {pin(5.0, 5.0, std::nan(""), 0.0)}), "E_OPTION");
  Pin light = resting(5.0, 5.0);
  light.weight = 0.0;
  EXPECT_EQ(code_of(mesh, {light}), "E_OPTION");
  EXPECT_EQ(
      code_of(mesh, {resting(1.0, 2.0), resting(1.5, 3.0), resting(2.0, 4.5), resting(2.5, 6.0)}),
      "E_PINS_CROWDED");
  const Deformation twice = deform(mesh, {resting(5.0, 5.0), resting(5.0, 5.0)});
  EXPECT_TRUE(twice.warnings.contains("W_PIN_REPEATED"));
  DeformOptions options;
  options.warp.beta = 0.5;
  EXPECT_THROW(deform(mesh, {resting(5.0, 5.0)}, options), InvalidArgument);
}

// Parts without a pin stay to the bit and are named; on request they are an error. No pins at all
// change nothing.
TEST(Deform, LeavesPartsWithoutAPinStillAndNamesThem) {
  const PlanarMesh mesh =
      test::planar_cells(9, 3, 10.0, [](double x, double) { return x < 40.0 || x > 50.0; });
  const std::vector<Pin> pins = {pin(5.0, 5.0, 50.0, 60.0), resting(35.0, 25.0)};
  const Deformation result = deform(mesh, pins);
  EXPECT_EQ(result.stages[0].still_components, (std::vector<std::int32_t>{1}));
  EXPECT_TRUE(result.warnings.contains("W_COMPONENT_UNANCHORED"));
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    if (mesh.points(v, 0) > 45.0) {
      EXPECT_EQ((result.points.row(v) - mesh.points.row(v)).norm(), 0.0);
    }
  }
  DeformOptions strict;
  strict.warp.is_unanchored_allowed = false;
  EXPECT_THROW(deform(mesh, pins, strict), AnalysisError);
  EXPECT_TRUE((deform(mesh, std::vector<Pin>{}).points.array() == mesh.points.array()).all());
}

// One pin is a translation, with a rotation a rotation about it.
TEST(Deform, OfOnePinIsRigid) {
  const PlanarMesh mesh = test::sleeve_shape();
  Pin p = pin(77.0, 33.0, 90.0, 12.0);
  Points2 expected = mesh.points;
  expected.rowwise() += RowVector2d(13.0, -21.0);
  EXPECT_LT((deform(mesh, std::vector<Pin>{p}).points - expected).cwiseAbs().maxCoeff(), 1e-9);
  p.rotation = -0.6;
  expected = mesh.points;
  expected.rowwise() -= RowVector2d(77.0, 33.0);
  expected = test::moved_rigidly(expected, -0.6, 90.0, 12.0);
  EXPECT_LT((deform(mesh, std::vector<Pin>{p}).points - expected).cwiseAbs().maxCoeff(), 1e-6);
}

// Twice the size is twice the deformation, a rotated picture is the rotated deformation.
TEST(Deform, MovesWithThePicture) {
  const PlanarMesh mesh = test::sleeve_shape();
  const std::vector<Pin> pins = {pin(20.0, 145.0, -35.0, 130.0), resting(95.3, 100.7),
                                 resting(140.0, 190.0)};
  const Points2 expected = deform(mesh, pins).points;
  PlanarMesh other = mesh;
  other.points = 1000.0 * test::moved_rigidly(mesh.points, 0.8, 3.0, 4.0);
  std::vector<Pin> moved = pins;
  for (Pin& p : moved) {
    for (Vector2d* x : {&p.source, &p.target}) {
      const Points2 row = x->transpose();
      *x = 1000.0 * test::moved_rigidly(row, 0.8, 3.0, 4.0).row(0).transpose();
    }
  }
  const Points2 actual = deform(other, moved).points;
  EXPECT_LT((actual / 1000.0 - test::moved_rigidly(expected, 0.8, 3.0, 4.0)).cwiseAbs().maxCoeff(),
            1e-8);
}

// Drags do not remember each other, nor does the number of threads show.
TEST(Warper, DragsDoNotDependOnHistoryOrThreads) {
  const PlanarMesh mesh = test::sleeve_shape(2.5);
  const std::vector<Pin> pins = {pin(20.0, 145.0, -35.0, 130.0), resting(95.3, 100.7),
                                 resting(140.0, 190.0)};
  set_thread_count(1);
  const Warper warper(mesh, pins);
  const Points2 first = warper.drag(warper.targets()).points;
  Points2 elsewhere = warper.targets();
  elsewhere.array() += 100.0;
  warper.drag(elsewhere);
  set_thread_count(3);
  const Points2 again = warper.drag(warper.targets()).points;
  const Points2 fresh = Warper(mesh, pins).drag(warper.targets()).points;
  set_thread_count(0);
  EXPECT_TRUE((first.array() == again.array()).all());
  EXPECT_TRUE((first.array() == fresh.array()).all());
  EXPECT_TRUE(
      (deform(mesh, pins, {.warp = {}, .fine_iterations = 0, .is_polished = false, .polish = {}})
           .points.array() == first.array())
          .all());
}

TEST(Deform, StopsWhenCancelled) {
  const PlanarMesh mesh = test::planar_grid(5, 5, 10.0);
  const RunControl run = RunControl::create();
  run.cancel();
  const Deformation result = deform(mesh, {resting(5.0, 5.0)}, {}, run);
  EXPECT_EQ(result.status, Status::cancelled);
  EXPECT_EQ(result.num_done, 0U);
  EXPECT_TRUE((result.points.array() == mesh.points.array()).all());
}

// A diagonal stretch of 2 by 1/2 has those singular values everywhere and keeps the area.
TEST(WarpQuality, OfAStretchIsItsSingularValues) {
  const PlanarMesh mesh = test::planar_grid(4, 4, 10.0);
  Points2 q = mesh.points;
  q.col(0) *= 2.0;
  q.col(1) *= 0.5;
  const WarpQuality stretched = measure_warp(mesh, q);
  EXPECT_NEAR(stretched.min_stretch, 0.5, 1e-12);
  EXPECT_NEAR(stretched.max_stretch, 2.0, 1e-12);
  EXPECT_NEAR(stretched.mean_stretch, 1.25, 1e-12);
  EXPECT_NEAR(stretched.area_change, 0.0, 1e-12);
  q.col(0) *= -1.0;
  EXPECT_EQ(measure_warp(mesh, q).flipped.size(), 32U);
}

}  // namespace
}  // namespace dupin
