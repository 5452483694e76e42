// What takes long at 200,000 triangles stops when it is told to, and leaves nothing behind.
#include <gtest/gtest.h>

#include <functional>

#include "dupin/base/error.h"
#include "dupin/warp/warp_quality.h"
#include "dupin/warp/warper.h"
#include "tests/support/planar_shapes.h"

namespace dupin {
namespace {

RunControl cancelled_run() {
  const RunControl run = RunControl::create();
  run.cancel();
  return run;
}

bool is_interrupted(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.errc() == Errc::interrupted;
  }
  return false;
}

std::vector<Pin> two_pins() {
  std::vector<Pin> pins(2);
  pins[0].source = pins[0].target = {10.0, 10.0};
  pins[1].source = {40.0, 40.0};
  pins[1].target = {50.0, 35.0};
  return pins;
}

TEST(Interrupt, StopsDistancesAndPreparation) {
  const PlanarMesh mesh = test::planar_grid(6, 6, 10.0);
  const PlanarGraph graph = make_planar_graph(mesh);
  const MeshPoint source = locate(mesh, {10.0, 10.0}).value();
  for (const auto method : {GeodesicMethod::exact, GeodesicMethod::edges}) {
    EXPECT_TRUE(
        is_interrupted([&] { geodesic_distances(mesh, graph, source, method, cancelled_run()); }));
  }
  EXPECT_TRUE(is_interrupted([&] { Warper(mesh, two_pins(), {}, {}, cancelled_run()); }));
  const Eigen::MatrixXd distances = Eigen::MatrixXd::Ones(mesh.points.rows(), 1);
  EXPECT_TRUE(is_interrupted([&] {
    MlsWarp(mesh.points, mesh.points.topRows(1), {{0, 0, 0.0}}, Eigen::VectorXd::Ones(1), distances,
            Eigen::VectorXd::Ones(1), {}, cancelled_run());
  }));
}

// A drag that was stopped is as if it had not begun: the next one gives the bits of the one before.
TEST(Interrupt, StopsADragAndNotTheNextOne) {
  const PlanarMesh mesh = test::planar_grid(6, 6, 10.0);
  for (const auto mode : {RotationMode::held, RotationMode::thesis}) {
    std::vector<Pin> pins = two_pins();
    pins[0].rotation = 0.3;
    WarpOptions options;
    options.rotation = mode;
    const Warper warper(mesh, pins, {}, options);
    const Points2 before = warper.drag(warper.targets()).points;
    EXPECT_TRUE(is_interrupted([&] { warper.drag(warper.targets(), {}, true, cancelled_run()); }));
    EXPECT_TRUE((warper.drag(warper.targets()).points.array() == before.array()).all());
  }
}

TEST(Interrupt, StopsThePolish) {
  const PlanarMesh mesh = test::planar_grid(6, 6, 10.0);
  const Warper warper(mesh, two_pins());
  Points2 folded = mesh.points;
  folded.row(14) += Eigen::RowVector2d(25.0, 25.0);
  EXPECT_GT(measure_warp(mesh, folded).flipped.size(), 0U);
  EXPECT_TRUE(is_interrupted(
      [&] { polish_folds(warper.arap(), mesh, folded, PolishOptions{}, cancelled_run()); }));
}

}  // namespace
}  // namespace dupin
