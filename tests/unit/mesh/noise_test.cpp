#include "dupin/mesh/noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mesh/topology.h"

namespace dupin {
namespace {

using Eigen::Index;

struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

Moments moments(const Eigen::VectorXd& values) {
  const double mean = values.mean();
  const double n = static_cast<double>(values.size());
  return {mean, std::sqrt((values.array() - mean).square().sum() / (n - 1.0))};
}

// Standard errors of mean and standard deviation of n deviates are sigma / sqrt(n) and
// sigma / sqrt(2 n); a seeded draw must lie within four of them.
void expect_normal_moments(const Eigen::VectorXd& deltas, double sigma) {
  const double n = static_cast<double>(deltas.size());
  const Moments m = moments(deltas);
  EXPECT_NEAR(m.mean, 0.0, 4.0 * sigma / std::sqrt(n));
  EXPECT_NEAR(m.deviation, sigma, 4.0 * sigma / std::sqrt(2.0 * n));
}

TEST(Noise, SigmaIsThePercentageOfTheMeanEdge) {
  const Mesh mesh = make_icosphere(2.0, 3).mesh;
  NoiseOptions options;
  options.percent = 25.0;
  const MeshTopology topology = compute_topology(mesh.triangles, mesh.points.rows());
  EXPECT_DOUBLE_EQ(add_noise(mesh, options).sigma,
                   0.25 * mean_edge_length(mesh.points, topology.ring));
}

TEST(Noise, AlongTheNormalItHasTheStatedMomentsAndNoOtherComponent) {
  const Mesh mesh = make_icosphere(1.0, 5).mesh;
  const NoisyMesh noisy = add_noise(mesh, {.percent = 50.0, .seed = 11});
  const Points normals = vertex_normals(mesh);
  const Points moved = noisy.mesh.points - mesh.points;
  const Eigen::VectorXd along = moved.cwiseProduct(normals).rowwise().sum();
  expect_normal_moments(along, noisy.sigma);
  const Points rest = moved - (normals.array().colwise() * along.array()).matrix();
  EXPECT_LE(rest.cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_TRUE(noisy.mesh.triangles == mesh.triangles);
}

TEST(Noise, DirectionalMovesEveryVertexAlongOneLine) {
  const Mesh mesh = make_icosphere(1.0, 5).mesh;
  NoiseOptions options;
  options.percent = 20.0;
  options.model = NoiseModel::directional;
  options.direction = {3.0, 0.0, 4.0};
  const NoisyMesh noisy = add_noise(mesh, options);
  const Points moved = noisy.mesh.points - mesh.points;
  EXPECT_EQ(moved.col(1).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_LE((4.0 * moved.col(0) - 3.0 * moved.col(2)).cwiseAbs().maxCoeff(), 1e-14);
  expect_normal_moments(0.6 * moved.col(0) + 0.8 * moved.col(2), noisy.sigma);
}

// Covariance sigma^2 I: equal deviations, correlations within 4 / sqrt(n) of zero.
TEST(Noise, IsotropicHasTheCovarianceOfASphere) {
  const Mesh mesh = make_icosphere(1.0, 5).mesh;
  NoiseOptions options;
  options.percent = 30.0;
  options.model = NoiseModel::isotropic;
  options.seed = 5;
  const NoisyMesh noisy = add_noise(mesh, options);
  const Points moved = noisy.mesh.points - mesh.points;
  const double n = static_cast<double>(moved.rows());
  for (Index k = 0; k < 3; ++k) {
    expect_normal_moments(moved.col(k), noisy.sigma);
    const double correlation =
        moved.col(k).dot(moved.col((k + 1) % 3)) / (n * noisy.sigma * noisy.sigma);
    EXPECT_NEAR(correlation, 0.0, 4.0 / std::sqrt(n));
  }
}

TEST(Noise, TheSeedDecidesAndZeroPercentChangesNothing) {
  const Mesh mesh = make_icosphere(1.0, 2).mesh;
  const Mesh first = add_noise(mesh, {.seed = 1}).mesh;
  EXPECT_TRUE(first.points == add_noise(mesh, {.seed = 1}).mesh.points);
  EXPECT_FALSE(first.points == add_noise(mesh, {.seed = 2}).mesh.points);
  EXPECT_TRUE(add_noise(mesh, {.percent = 0.0}).mesh.points == mesh.points);
}

TEST(Noise, RefusesWhatItCannotMean) {
  const Mesh mesh = make_icosphere(1.0, 1).mesh;
  EXPECT_THROW(add_noise(mesh, {.percent = -1.0}), InvalidArgument);
  EXPECT_THROW(add_noise(mesh, {.percent = HUGE_VAL}), InvalidArgument);
  NoiseOptions options;
  options.model = NoiseModel::directional;
  options.direction.setZero();
  EXPECT_THROW(add_noise(mesh, options), InvalidArgument);
}

}  // namespace
}  // namespace dupin
