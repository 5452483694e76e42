#include "dupin/surface/signal_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

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

// The bias of the height signal is -2 h times the expected growth of the mean edge. What the edges
// do in sixteen replicas and their opposites, so that first orders cancel: 16 x 3 x 900 edges, each
// as much as its mean, leave 1 %; neighbouring edges share ends, hence 4 %.
TEST(SignalNoise, KnowsThatNoiseLengthensTheMeanEdge) {
  for (const NoiseModel model : {NoiseModel::isotropic, NoiseModel::along_normal}) {
    const SurfaceGraph graph = bumpy(0.3);
    const SignalNoise noise =
        make_signal_noise(graph, Signal::height, {.sigma = 0.01 * graph.mean_edge, .model = model});
    double growth = 0.0;
    for (Index r = 0; r < 16; ++r) {
      for (const double sign : {-1.0, 1.0}) {
        const Mesh moved{graph.points + sign * noise.displacement(r), graph.triangles};
        growth += (surface_graph(moved).mean_edge / graph.mean_edge - 1.0) / 32.0;
      }
    }
    const VectorXd height = compute_signal(graph, Signal::height);
    const VectorXd expected = -2.0 * growth * height;
    EXPECT_LT((noise.bias - expected).norm(), 0.04 * expected.norm());
  }
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

// What rounding really did: 2700 coordinates know a standard deviation to 1.4 %; errors are uniform
// but for the binade of the smallest coordinates.
TEST(EstimateRounding, IsWhatRoundingDid) {
  const Points exact = bumpy(0.3).points.array() * 3.7 + 0.1;
  const auto deviation = [&](const Points& rounded) {
    return std::sqrt((rounded - exact).array().square().mean());
  };
  const Points single = exact.cast<float>().cast<double>();
  EXPECT_NEAR(estimate_rounding(single), deviation(single), 0.1 * deviation(single));
  for (const double step : {1e-3, 1e-6}) {
    const Points decimal = exact.unaryExpr([=](double x) { return step * std::round(x / step); });
    EXPECT_NEAR(estimate_rounding(decimal), deviation(decimal), 0.1 * deviation(decimal));
    EXPECT_NEAR(estimate_rounding(1e3 * decimal), 1e3 * deviation(decimal),
                100.0 * deviation(decimal));
  }
  const Points both = (exact * 1e4)
                          .unaryExpr([](double x) { return std::round(x) / 1e4; })
                          .cast<float>()
                          .cast<double>();
  EXPECT_NEAR(estimate_rounding(both), deviation(both), 0.1 * deviation(both));
  EXPECT_LT(estimate_rounding(exact), 1e-15);
  EXPECT_GT(estimate_rounding(exact), 1e-17);
}

// A lattice of few steps is a shape, not a rounding; nothing is rounded where nothing is.
TEST(EstimateRounding, DoesNotTakeAShapeForRounding) {
  Points cube(2, 3);
  cube << 0, 0, 0, 1, 1, 1;
  EXPECT_LT(estimate_rounding(cube), 1e-7);
  EXPECT_EQ(estimate_rounding(Points::Zero(5, 3)), 0.0);
  EXPECT_EQ(estimate_rounding(Points(0, 3)), 0.0);
  cube(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(estimate_rounding(cube), InvalidArgument);
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
