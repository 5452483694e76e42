#include "dupin/surface/signal_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSmall = 1e-5;  // sigma in mean edges

// What the signal does when the points really move as replica 3 says.
VectorXd real_change(const SurfaceGraph& graph, Signal signal, const SignalNoise& noise) {
  const auto at = [&](double sign) {
    SurfaceGraph moved = graph;
    moved.points += sign * noise.displacement(3);
    if (graph.is_mesh()) moved.normals = vertex_normals({moved.points, graph.triangles});
    return compute_signal(moved, signal);
  };
  return 0.5 * (at(1.0) - at(-1.0));
}

VectorXd predicted(const SignalNoise& noise) {
  return noise.unit * noise.draw(0).col(3).cast<double>();
}

SurfaceGraph bumpy(double jitter) {
  PlaneOptions options;
  options.num_vertices = 900;
  options.jitter = jitter;
  return surface_graph(make_gaussian_bump(0.4, 0.4, options).mesh);
}

// The block is the derivative of the height signal, normals and mean edge included. Single
// precision leaves 1e-5.
TEST(SignalNoise, IsTheDerivativeOfTheHeightSignal) {
  for (const NoiseModel model : {NoiseModel::isotropic, NoiseModel::along_normal}) {
    const SurfaceGraph graph = bumpy(0.3);
    const SignalNoise noise = make_signal_noise(
        graph, Signal::height, {.sigma = kSmall * graph.mean_edge, .model = model});
    const VectorXd change = real_change(graph, Signal::height, noise);
    EXPECT_LT((predicted(noise) - change).norm(), 1e-4 * change.norm());
  }
}

// Holding the normals would miss this much of an irregular surface's noise, and next to nothing of
// a regular one's: the second term is why they are not held.
TEST(SignalNoise, TheTurningOfTheNormalsCountsOnIrregularSurfaces) {
  const auto share = [](double jitter) {
    const SurfaceGraph graph = bumpy(jitter);
    const SignalNoise noise =
        make_signal_noise(graph, Signal::height, {.sigma = kSmall * graph.mean_edge});
    SurfaceGraph bare = graph;  // a cloud: normals are held
    bare.triangles.resize(0, 3);
    const SignalNoise held =
        make_signal_noise(bare, Signal::height, {.sigma = kSmall * graph.mean_edge});
    VectorXd inside = VectorXd::Ones(graph.points.rows());
    for (Index v = 0; v < inside.size(); ++v)
      if (graph.is_guarded[static_cast<std::size_t>(v)] != 0) inside[v] = 0.0;
    return (predicted(noise) - predicted(held)).cwiseProduct(inside).norm() /
           predicted(noise).cwiseProduct(inside).norm();
  };
  EXPECT_LT(share(0.0), 0.01);
  EXPECT_GT(share(0.3), 0.01);
  EXPECT_LT(share(0.3), 0.10);
}

// Taubin's signals by central difference.
TEST(SignalNoise, IsTheDerivativeOfOtherSignals) {
  const SurfaceGraph graph = bumpy(0.3);
  for (const Signal signal : {Signal::mean, Signal::gauss}) {
    const SignalNoise noise = make_signal_noise(graph, signal, {.sigma = 1e-3 * graph.mean_edge});
    const VectorXd change = real_change(graph, signal, noise);
    EXPECT_LT((predicted(noise) - change).norm(), 0.01 * change.norm());
  }
}

// Unit variance in each coordinate: 2700 x 16 deviates, 1 / sqrt(2 n) = 0.34 %; none repeats.
TEST(SignalNoise, DeviatesAreNormalAndIndependent) {
  const SurfaceGraph graph = bumpy(0.0);
  const SignalNoise noise = make_signal_noise(graph, Signal::height, {.sigma = 1.0});
  double square = 0.0;
  double fourth = 0.0;
  double cross = 0.0;
  double count = 0.0;
  Points before = noise.displacement(15);
  for (Index r = 16; r < 32; ++r) {
    const Points now = noise.displacement(r);
    square += now.array().square().sum();
    fourth += now.array().square().square().sum();
    cross += (now.array() * before.array()).sum();
    count += static_cast<double>(now.size());
    before = now;
  }
  EXPECT_NEAR(square / count, 1.0, 0.02);
  EXPECT_NEAR(fourth / count, 3.0, 0.15);
  EXPECT_NEAR(cross / count, 0.0, 0.02);
}

TEST(SignalNoise, RefusesWhatItCannotDo) {
  const SurfaceGraph graph = bumpy(0.0);
  EXPECT_THROW(make_signal_noise(graph, Signal::height, {.sigma = 0.0}), InvalidArgument);
  EXPECT_THROW(
      make_signal_noise(graph, Signal::height, {.sigma = 1.0, .model = NoiseModel::directional}),
      InvalidArgument);
  EXPECT_THROW(make_signal_noise(graph, Signal::height, {.sigma = 1.0, .normal_smoothing = -1}),
               InvalidArgument);
}

}  // namespace
}  // namespace dupin
