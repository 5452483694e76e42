#include "dupin/warp/arap.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "tests/support/planar_shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;
using Eigen::VectorXd;

struct Fixture {
  explicit Fixture(const PlanarMesh& shape, EdgeWeights kind = EdgeWeights::uniform)
      : mesh(shape),
        graph(make_planar_graph(mesh)),
        weight(edge_weights(mesh, graph, kind).weight) {
    Rng rng(3);
    vertex_weight = VectorXd::Ones(mesh.points.rows());
    for (Index v = 0; v < vertex_weight.size(); ++v)
      vertex_weight[v] = v % 3 == 0 ? 1.0 + 3.0 * rng.uniform() : 1.0;
  }

  ArapSystem system(const std::vector<PlaceConstraint>& rows) const {
    return {mesh, graph, weight, vertex_weight, LinearConstraints(mesh.points.rows(), rows)};
  }

  // Eq. 7.17 written out, for given rotations (#V by 2).
  double energy(const Points2& q, const Points2& rotation) const {
    const Adjacency& ring = graph.topology.ring;
    double sum = 0.0;
    for (Index n = 0; n < q.rows(); ++n) {
      for (const std::int32_t* k = ring.begin(n); k != ring.end(n); ++k) {
        const RowVector2d p = mesh.points.row(*k) - mesh.points.row(n);
        const RowVector2d turned(rotation(n, 0) * p.x() - rotation(n, 1) * p.y(),
                                 rotation(n, 1) * p.x() + rotation(n, 0) * p.y());
        sum += vertex_weight[n] * weight[static_cast<std::size_t>(k - ring.neighbor.data())] *
               (q.row(*k) - q.row(n) - turned).squaredNorm();
      }
    }
    return sum;
  }

  PlanarMesh mesh;
  PlanarGraph graph;
  std::vector<double> weight;
  VectorXd vertex_weight;
};

Points2 shaken(const Points2& points, double amount, std::uint64_t seed) {
  Rng rng(seed);
  Points2 result = points;
  for (Index i = 0; i < result.size(); ++i) result.data()[i] += amount * (rng.uniform() - 0.5);
  return result;
}

// Two vertices fixed and one place inside a triangle.
std::vector<PlaceConstraint> three_rows(const PlanarMesh& mesh) {
  return {
      {{0}, {1.0}, "a"},
      {{static_cast<std::int32_t>(mesh.points.rows()) - 1}, {1.0}, "b"},
      {{mesh.triangles(7, 0), mesh.triangles(7, 1), mesh.triangles(7, 2)}, {0.2, 0.5, 0.3}, "c"}};
}

// Eq. 7.16: no other angle of a cell lowers its energy.
TEST(Arap, RotationsAreTheBestOfEveryCell) {
  for (const auto kind : {EdgeWeights::uniform, EdgeWeights::cotangent}) {
    const Fixture f(test::jittered(test::planar_grid(6, 5, 10.0), 2.0), kind);
    const ArapSystem system = f.system({{{0}, {1.0}, "a"}});
    const Points2 q = shaken(test::moved_rigidly(f.mesh.points, 1.9, 3.0, 4.0), 8.0, 2);
    const Points2 best = system.rotations(q);
    const double lowest = f.energy(q, best);
    EXPECT_NEAR(lowest, system.energy(q), 1e-9 * lowest);
    for (Index v = 0; v < q.rows(); ++v) {
      for (const double turn : {-1.0, -1e-3, 1e-3, 0.3, 2.0}) {
        Points2 other = best;
        other.row(v) << best(v, 0) * std::cos(turn) - best(v, 1) * std::sin(turn),
            best(v, 1) * std::cos(turn) + best(v, 0) * std::sin(turn);
        EXPECT_GT(f.energy(q, other), lowest);
      }
    }
  }
}

// Eq. 7.19 with 7.23: after the global step the derivative of the energy, by differences, is zero
// in every direction that the constraints permit (erratum E-36: it goes to the neighbours).
TEST(Arap, PlacesAreTheConstrainedMinimum) {
  for (const auto kind : {EdgeWeights::uniform, EdgeWeights::cotangent}) {
    const Fixture f(test::jittered(test::planar_grid(5, 4, 10.0), 2.0), kind);
    const auto rows = three_rows(f.mesh);
    const ArapSystem system = f.system(rows);
    const LinearConstraints constraints(f.mesh.points.rows(), rows);
    Points2 values(3, 2);
    values << -5.0, 3.0, 70.0, 20.0, 30.0, 30.0;
    Points2 q = shaken(f.mesh.points, 5.0, 5);
    constraints.enforce(q, values);
    const Points2 rotation = system.rotations(q);
    const double before = f.energy(q, rotation);
    EXPECT_NEAR(system.iterate(q), before, 1e-9 * before);
    EXPECT_LT(constraints.largest_violation(q, values), 1e-11);
    const double after = f.energy(q, rotation);
    EXPECT_LT(after, before);
    Rng rng(6);
    for (int trial = 0; trial < 20; ++trial) {
      Points2 direction = Points2::Zero(q.rows(), 2);
      for (Index i = 0; i < direction.size(); ++i) direction.data()[i] = rng.uniform() - 0.5;
      constraints.enforce(direction, Points2::Zero(3, 2));
      const double step = 1e-3;
      const double slope =
          (f.energy(q + step * direction, rotation) - f.energy(q - step * direction, rotation)) /
          (2.0 * step);
      // Central differences of a quadratic are exact: rounding of E over the step is left.
      EXPECT_NEAR(slope, 0.0, 1e-9 * before);
    }
  }
}

// Each turn is a minimisation, so that E never rises.
TEST(Arap, EnergyNeverRises) {
  for (const auto kind : {EdgeWeights::uniform, EdgeWeights::cotangent}) {
    const Fixture f(test::jittered(test::planar_grid(12, 9, 10.0), 3.0), kind);
    const auto rows = three_rows(f.mesh);
    const ArapSystem system = f.system(rows);
    Points2 values(3, 2);
    values << 40.0, 30.0, 10.0, 120.0, 60.0, -30.0;
    Points2 q = f.mesh.points;
    LinearConstraints(q.rows(), rows).enforce(q, values);
    double last = system.iterate(q);
    for (int i = 0; i < 60; ++i) {
      const double energy = system.iterate(q);
      EXPECT_LE(energy, last * (1.0 + 1e-12));
      last = energy;
    }
    EXPECT_GT(last, 0.0);
  }
}

// A rigid motion is where E is zero, and an iteration does not leave it; with the rest shape's
// constraints moved rigidly, iterations lead there from elsewhere.
TEST(Arap, RigidMotionsAreFixedPoints) {
  const Fixture f(test::jittered(test::planar_grid(8, 8, 10.0), 2.0));
  const ArapSystem system = f.system({{{0}, {1.0}, "a"}, {{80}, {1.0}, "b"}});
  const Points2 moved = test::moved_rigidly(f.mesh.points, 2.5, 300.0, -80.0);
  Points2 q = moved;
  EXPECT_LT(system.iterate(q), 1e-18 * 300.0 * 300.0 * 300.0);
  EXPECT_LT((q - moved).cwiseAbs().maxCoeff(), 1e-10);
  Points2 start = shaken(moved, 3.0, 9);
  start.row(0) = moved.row(0);
  start.row(80) = moved.row(80);
  for (int i = 0; i < 2000; ++i) system.iterate(start);
  EXPECT_LT((start - moved).cwiseAbs().maxCoeff(), 1e-6);
}

// Numbers of vertices do not matter, nor where the picture's origin is.
TEST(Arap, DoesNotDependOnNumberingOrPlace) {
  const PlanarMesh mesh = test::jittered(test::planar_grid(9, 7, 10.0), 2.0);
  std::vector<std::int32_t> number;
  const PlanarMesh other = test::renumbered(mesh, number, 12);
  const auto run = [](const PlanarMesh& shape, std::int32_t a, std::int32_t b, double dx) {
    const PlanarGraph graph = make_planar_graph(shape);
    const auto weight = edge_weights(shape, graph, EdgeWeights::cotangent).weight;
    const std::vector<PlaceConstraint> rows = {{{a}, {1.0}, ""}, {{b}, {1.0}, ""}};
    const LinearConstraints constraints(shape.points.rows(), rows);
    const ArapSystem system(shape, graph, weight, VectorXd::Ones(shape.points.rows()), constraints);
    Points2 values(2, 2);
    values << dx + 15.0, -8.0, dx + 50.0, 50.0;
    Points2 q = shape.points;
    constraints.enforce(q, values);
    for (int i = 0; i < 5; ++i) system.iterate(q);
    return q;
  };
  const Points2 q = run(mesh, 0, 79, 0.0);
  const Points2 p = run(other, number[0], number[79], 0.0);
  PlanarMesh shifted = mesh;
  shifted.points.col(0).array() += 1e4;
  const Points2 s = run(shifted, 0, 79, 1e4);
  for (Index v = 0; v < q.rows(); ++v) {
    EXPECT_LT((q.row(v) - p.row(number[static_cast<std::size_t>(v)])).norm(), 1e-9);
    EXPECT_LT((q.row(v) + RowVector2d(1e4, 0.0) - s.row(v)).norm(), 1e-8);
  }
}

TEST(Arap, HasTheSameBitsForAnyNumberOfThreads) {
  const Fixture f(test::jittered(test::planar_grid(60, 60, 5.0), 1.0));
  const ArapSystem system = f.system(three_rows(f.mesh));
  const Points2 start = shaken(f.mesh.points, 4.0, 1);
  const auto run = [&](int threads) {
    set_thread_count(threads);
    Points2 q = start;
    const double energy = system.iterate(q);
    set_thread_count(0);
    return std::pair<double, Points2>(energy, q);
  };
  const auto one = run(1);
  const auto three = run(3);
  EXPECT_EQ(one.first, three.first);
  EXPECT_TRUE((one.second.array() == three.second.array()).all());
}

// A component without a constraint has no solution: the factor says so instead of an answer.
TEST(Arap, RefusesAComponentThatNothingHolds) {
  const Fixture f(
      test::planar_cells(5, 1, 10.0, [](double x, double) { return x < 20.0 || x > 30.0; }));
  EXPECT_THROW(f.system({{{0}, {1.0}, "a"}}), Error);
}

// Obtuse triangles have negative cotangent weights; they are clamped and counted, and those of an
// equilateral mesh are 1/sqrt(3) inside.
TEST(EdgeWeights, OfCotangentsAreGuarded) {
  const PlanarMesh mesh = test::equilateral_grid(6, 6, 10.0);
  const PlanarGraph graph = make_planar_graph(mesh);
  const auto regular = edge_weights(mesh, graph, EdgeWeights::cotangent);
  EXPECT_EQ(regular.num_clamped, 0);
  EXPECT_NEAR(*std::max_element(regular.weight.begin(), regular.weight.end()), 1 / std::sqrt(3.0),
              1e-12);
  PlanarMesh flat = mesh;
  flat.points.col(1) *= 0.1;
  const auto squeezed = edge_weights(flat, graph, EdgeWeights::cotangent);
  EXPECT_GT(squeezed.num_clamped, 0);
  EXPECT_GE(*std::min_element(squeezed.weight.begin(), squeezed.weight.end()), kLeastCotangent);
}

// Sums that share vertices, with a fixed one among them: all hold, the change is the smallest.
TEST(LinearConstraints, EnforceSharedTrianglesWithTheLeastChange) {
  const std::vector<PlaceConstraint> rows = {
      {{0, 1, 2}, {0.3, 0.3, 0.4}, "a"}, {{1, 2, 3}, {0.5, 0.25, 0.25}, "b"}, {{3}, {1.0}, "c"}};
  const LinearConstraints constraints(5, rows);
  Points2 q = shaken(Points2::Zero(5, 2), 10.0, 1);
  const Points2 before = q;
  Points2 values(3, 2);
  values << 1.0, 2.0, -3.0, 4.0, 5.0, 5.0;
  constraints.enforce(q, values);
  EXPECT_LT(constraints.largest_violation(q, values), 1e-13);
  EXPECT_EQ((q.row(4) - before.row(4)).norm(), 0.0);
  // Least change: free vertices move by a combination of the weights of the rows.
  Eigen::MatrixXd c(2, 3);
  c << 0.3, 0.3, 0.4, 0.0, 0.5, 0.25;
  const Eigen::MatrixXd change = (q - before).topRows(3);
  const Eigen::MatrixXd null = Eigen::FullPivLU<Eigen::MatrixXd>(c).kernel();
  EXPECT_LT((null.transpose() * change).norm(), 1e-12);
}

TEST(LinearConstraints, RefuseMoreThanATriangleCanHold) {
  std::vector<PlaceConstraint> rows;
  for (const double w : {0.1, 0.3, 0.5, 0.7})
    rows.push_back({{0, 1, 2}, {w, 0.8 - w, 0.2}, "pin " + std::to_string(w)});
  try {
    LinearConstraints(3, rows);
    FAIL();
  } catch (const AnalysisError& error) {
    EXPECT_EQ(error.code(), "E_PINS_CROWDED");
    EXPECT_NE(std::string(error.what()).find("pin 0.5"), std::string::npos);
  }
}

}  // namespace
}  // namespace dupin
