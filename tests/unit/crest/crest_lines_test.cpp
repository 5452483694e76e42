#include "dupin/crest/crest_lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mesh/topology.h"
#include "tests/support/crest_surfaces.h"

namespace dupin {
namespace {

using Eigen::Index;
using test::CrestSurface;

constexpr Index kSize = 6000;

CrestSet crest_of(const Mesh& mesh, const CrestOptions& options = {}) {
  return find_crest_lines(surface_graph(mesh), options);
}

double edge_of(const Mesh& mesh) { return surface_graph(mesh).mean_edge; }

Index count(const CrestSet& set, CrestKind kind) {
  return std::count_if(set.lines.begin(), set.lines.end(),
                       [&](const CrestLine& line) { return line.kind == kind; });
}

// What was promised: 90 % of the length within 1.5 mean edges on the clean surface, 75 % under
// noise of half an edge; both ways, so that nothing is missing and nothing is too much.
void expect_agreement(const CrestSurface& surface) {
  const double edge = edge_of(surface.mesh);
  const test::LineAgreement clean =
      test::agreement(surface, crest_of(surface.mesh).lines, 1.5 * edge);
  EXPECT_GE(clean.found_near_true, 0.9) << surface.name;
  EXPECT_GE(clean.true_near_found, 0.9) << surface.name;
  const NoisyMesh noisy = add_noise(surface.mesh, {.percent = 50.0, .seed = 100});
  CrestOptions options;
  options.noise_sigma = noisy.sigma;
  const test::LineAgreement found =
      test::agreement(surface, crest_of(noisy.mesh, options).lines, 1.5 * edge);
  EXPECT_GE(found.found_near_true, 0.75) << surface.name;
  EXPECT_GE(found.true_near_found, 0.75) << surface.name;
}

TEST(CrestLines, OfAnEllipsoidAreItsSharpRim) {
  const CrestSurface surface = test::crest_ellipsoid(kSize);
  expect_agreement(surface);
  const CrestSet set = crest_of(surface.mesh);
  ASSERT_EQ(set.lines.size(), 1U);
  EXPECT_EQ(set.lines[0].kind, CrestKind::ridge);
  EXPECT_TRUE(set.lines[0].is_closed);
}

TEST(CrestLines, OfATorusOfEllipticSectionAreTwoCircles) {
  // The ridges' radius of curvature, 0.33, is three edges and a half.
  const CrestSurface surface = test::crest_torus(20'000);
  expect_agreement(surface);
  const CrestSet set = crest_of(surface.mesh);
  ASSERT_EQ(set.lines.size(), 2U);
  for (const CrestLine& line : set.lines) {
    EXPECT_TRUE(line.is_closed);
    // A circle of radius 4, as a chain of chords across triangles.
    EXPECT_NEAR(line.length, 8.0 * M_PI, 0.02 * 8.0 * M_PI);
  }
}

// The ridges' radius of curvature is 2.4 edges: averages of tensors over ten edges have their
// ridges elsewhere (not one of them within reach), and the bend limits the scale.
TEST(CrestLines, OfACoarselySampledTorusAreThoseTwoCircles) {
  const CrestSurface surface = test::crest_torus(10'000);
  const test::LineAgreement found =
      test::agreement(surface, crest_of(surface.mesh).lines, 1.5 * edge_of(surface.mesh));
  EXPECT_GE(found.found_near_true, 0.9);
  EXPECT_GE(found.true_near_found, 0.9);
}

TEST(CrestLines, OfAGaussianRidgeAreItAndTwoValleys) {
  const CrestSurface surface = test::crest_gaussian_ridge(kSize);
  expect_agreement(surface);
  const CrestSet set = crest_of(surface.mesh);
  EXPECT_EQ(count(set, CrestKind::ridge), 1);
  EXPECT_EQ(count(set, CrestKind::valley), 2);
}

TEST(CrestLines, OfARoundedCubeAreItsTwelveEdges) {
  // Fine enough that lines would pass the umbilics in the corners.
  const CrestSurface surface = test::crest_rounded_cube(20'000);
  expect_agreement(surface);
  const CrestSet set = crest_of(surface.mesh);
  EXPECT_EQ(set.lines.size(), 12U);
  EXPECT_EQ(count(set, CrestKind::valley), 0);
}

// Constant principal curvatures along their own lines: the extremality vanishes everywhere, and
// there is no line.
TEST(CrestLines, OfPlanesSpheresAndCylindersAreNone) {
  EXPECT_TRUE(crest_of(make_plane({.num_vertices = kSize, .jitter = 0.25}).mesh).lines.empty());
  EXPECT_TRUE(crest_of(make_sphere(1.0, kSize).mesh).lines.empty());
  EXPECT_TRUE(crest_of(make_cylinder(1.0, 4.0, kSize).mesh).lines.empty());
  const NoisyMesh plane = add_noise(make_plane({.num_vertices = kSize}).mesh, {.percent = 50.0});
  CrestOptions options;
  options.noise_sigma = plane.sigma;
  EXPECT_TRUE(crest_of(plane.mesh, options).lines.empty());
}

// Valleys beside a ridge move away from it with tau, at most by the factor sqrt(s^2 + tau e^2 / 2)
// / s: at level 12, tau = 45, and s = 10 edges 1.8 of 17.4 edges. At their own scale, tau = 74,
// they would be 2.9 edges away on one level. Drawn there and extrapolated they are within 0.6.
TEST(CrestLines, StayWhereTheyAreOnTheSurfaceWhenItIsSmoothed) {
  const CrestSurface surface = test::crest_gaussian_ridge(20'000);
  const double edge = edge_of(surface.mesh);
  const double valley = surface.lines[1].points(0, 0);
  const auto drift = [&](const CrestOptions& options) {
    double sum = 0.0;
    double count = 0.0;
    for (const CrestLine& line : crest_of(surface.mesh, options).lines) {
      if (line.kind != CrestKind::valley) continue;
      for (const CrestPoint& p : line.points) {
        if (std::abs(p.position[1]) > 0.8) continue;
        sum += std::abs(p.position[0]) - valley;
        count += edge;
      }
    }
    return sum / count;
  };
  CrestOptions one_level;
  one_level.level = 12;
  EXPECT_GT(drift(one_level), 1.3);
  CrestOptions wide;
  wide.drawn_share = 1.0;  // at the scale, not extrapolated
  EXPECT_GT(drift(wide), 0.7);
  EXPECT_LT(std::abs(drift({})), 0.6);
}

// The curvature across a straight profile z(x), smoothed with a Gaussian of std sigma, and hence
// radius sqrt(tau) e = sqrt(2) sigma, is largest at: E-30.
double median_radius(const CrestSet& set, CrestKind kind, double* share_of_peaks) {
  std::vector<double> radius;
  double peaks = 0.0;
  for (const CrestLine& line : set.lines) {
    if (line.kind != kind) continue;
    for (const CrestPoint& p : line.points) {
      if (std::abs(p.position[1]) > 0.5) continue;  // the ends of the sheet
      radius.push_back(p.radius);
      peaks += p.is_scale_peak ? 1.0 : 0.0;
    }
  }
  *share_of_peaks = radius.empty() ? 0.0 : peaks / static_cast<double>(radius.size());
  if (radius.empty()) return 0.0;
  std::nth_element(radius.begin(), radius.begin() + static_cast<std::ptrdiff_t>(radius.size() / 2),
                   radius.end());
  return radius[radius.size() / 2];
}

// t^{1/2} k of a Gaussian ridge of std s: (s^2 + sigma^2)^{-3/2} sigma has its maximum at
// sigma = s / sqrt 2, radius s. The implicit filter is no Gaussian and levels are 20 % apart: 10 %.
TEST(CrestScale, OfAGaussianRidgeIsItsWidth) {
  const double s = 0.15;
  const CrestSurface surface = test::crest_gaussian_ridge(kSize, s, 0.02, 0.0);
  CrestOptions options;
  options.high = 0.01;
  options.low = 0.01;
  double peaks = 0.0;
  const double radius = median_radius(crest_of(surface.mesh, options), CrestKind::ridge, &peaks);
  EXPECT_NEAR(radius, s, 0.1 * s);
  EXPECT_EQ(peaks, 1.0);
}

// A rounded crease turns by its angle at every scale: t^{1/2} k grows towards a constant and has
// no maximum, t^{1/4} k, sigma^{1/2} (s^2 + sigma^2)^{-1/2}, has one at sigma = s, radius sqrt 2 s.
TEST(CrestScale, OfARoundedCreaseNeedsASmallerGamma) {
  const double s = 0.12;
  Mesh mesh = make_plane({.num_vertices = kSize}).mesh;
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    // z'' = -0.5 / (s sqrt(2 pi)) exp(-x^2 / (2 s^2)): slopes from 0.25 to -0.25.
    const double x = mesh.points(v, 0) / (s * std::sqrt(2.0));
    mesh.points(v, 2) =
        -0.25 * s * std::sqrt(2.0) * (x * std::erf(x) + std::exp(-x * x) / std::sqrt(M_PI));
  }
  double peaks = 0.0;
  CrestOptions options;
  median_radius(crest_of(mesh, options), CrestKind::ridge, &peaks);
  EXPECT_LT(peaks, 0.05);
  options.gamma = 0.5;
  const double radius = median_radius(crest_of(mesh, options), CrestKind::ridge, &peaks);
  EXPECT_GT(peaks, 0.95);
  EXPECT_NEAR(radius, std::sqrt(2.0) * s, 0.15 * std::sqrt(2.0) * s);
}

Mesh small_ridge() {
  return add_noise(test::crest_gaussian_ridge(2500).mesh, {.percent = 5.0, .seed = 5}).mesh;
}

// Powers of two change no bit of a mantissa.
TEST(CrestLines, DoNotDependOnTheUnitOfLength) {
  const Mesh mesh = small_ridge();
  Mesh scaled = mesh;
  scaled.points *= 1024.0;
  const CrestSet a = crest_of(mesh);
  const CrestSet b = crest_of(scaled);
  ASSERT_GE(a.lines.size(), 3U);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_EQ(1024.0 * a.lines[i].length, b.lines[i].length);
    EXPECT_EQ(1024.0 * a.lines[i].mean_scale, b.lines[i].mean_scale);
    EXPECT_EQ(a.lines[i].strength, b.lines[i].strength);
    EXPECT_EQ(a.lines[i].sharpness, b.lines[i].sharpness);
    EXPECT_EQ(a.lines[i].points.size(), b.lines[i].points.size());
  }
}

// Rotation changes roundings in single precision, 1e-6 of the tensor, whose second differences
// place the line: a hundredth of an edge.
TEST(CrestLines, MoveWithTheSurface) {
  const Mesh mesh = small_ridge();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  Mesh moved = mesh;
  moved.points = mesh.points * turn.transpose();
  moved.points.rowwise() += Eigen::RowVector3d(3.0, -1.0, 2.0);
  const CrestSet a = crest_of(mesh);
  const CrestSet b = crest_of(moved);
  ASSERT_GE(a.lines.size(), 3U);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_NEAR(a.lines[i].length, b.lines[i].length, 0.01 * a.lines[i].length);
    EXPECT_NEAR(a.lines[i].strength, b.lines[i].strength, 1e-3 * a.lines[i].strength);
    EXPECT_EQ(a.lines[i].kind, b.lines[i].kind);
  }
}

// Inside out: ridges are valleys at the same places.
TEST(CrestLines, ChangeTheirKindWithTheOrientation) {
  const Mesh mesh = small_ridge();
  Mesh turned = mesh;
  turned.triangles.col(1).swap(turned.triangles.col(2));
  const CrestSet a = crest_of(mesh);
  const CrestSet b = crest_of(turned);
  ASSERT_GE(a.lines.size(), 3U);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  EXPECT_EQ(count(a, CrestKind::ridge), count(b, CrestKind::valley));
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_NEAR(a.lines[i].length, b.lines[i].length, 1e-3 * a.lines[i].length);
    EXPECT_NE(a.lines[i].kind, b.lines[i].kind);
    EXPECT_LT(a.lines[i].points[0].curvature * b.lines[i].points[0].curvature, 0.0);
  }
}

// Numbers of vertices and the order of faces say nothing about a surface; sums in another order
// differ by roundings.
TEST(CrestLines, DoNotDependOnTheNumberingOfTheVertices) {
  const Mesh mesh = small_ridge();
  std::vector<std::int32_t> number(static_cast<std::size_t>(mesh.points.rows()));
  std::iota(number.begin(), number.end(), 0);
  Rng rng(1);
  for (std::size_t i = number.size(); i > 1; --i) std::swap(number[i - 1], number[rng.below(i)]);
  Mesh other = mesh;
  for (Index v = 0; v < mesh.points.rows(); ++v)
    other.points.row(number[static_cast<std::size_t>(v)]) = mesh.points.row(v);
  for (Index i = 0; i < other.triangles.size(); ++i)
    other.triangles.data()[i] = number[static_cast<std::size_t>(mesh.triangles.data()[i])];
  const CrestSet a = crest_of(mesh);
  const CrestSet b = crest_of(other);
  ASSERT_GE(a.lines.size(), 3U);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i)
    EXPECT_NEAR(a.lines[i].length, b.lines[i].length, 0.01 * a.lines[i].length);
}

TEST(CrestLines, AreTheSameForAnyNumberOfThreads) {
  const Mesh mesh = small_ridge();
  const int before = thread_count();
  set_thread_count(1);
  const CrestSet a = crest_of(mesh);
  set_thread_count(3);
  const CrestSet b = crest_of(mesh);
  set_thread_count(before);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_EQ(a.lines[i].length, b.lines[i].length);
    EXPECT_EQ(a.lines[i].strength, b.lines[i].strength);
    EXPECT_EQ(a.lines[i].sharpness, b.lines[i].sharpness);
  }
}

// A line on an edge lies between its ends; thresholds hold for every point and line.
TEST(CrestLines, KeepTheirThresholds) {
  CrestOptions options;
  options.low = 0.05;
  options.high = 0.2;
  options.min_sharpness = 0.3;
  const Mesh mesh = small_ridge();
  const double edge = edge_of(mesh);
  const CrestSet set = crest_of(mesh, options);
  ASSERT_GE(set.lines.size(), 1U);
  for (const CrestLine& line : set.lines) {
    double strongest = 0.0;
    for (const CrestPoint& p : line.points) {
      EXPECT_GE(p.strength, options.low);
      EXPECT_GE(p.anisotropy, options.min_anisotropy);
      EXPECT_GE(p.edge.weight, 0.0);
      EXPECT_LE(p.edge.weight, 1.0);
      EXPECT_EQ(p.curvature > 0.0, line.kind == CrestKind::ridge);
      strongest = std::max(strongest, p.strength);
    }
    EXPECT_GE(strongest, options.high);
    EXPECT_GE(line.sharpness, options.min_sharpness);
    EXPECT_GE(line.length, options.min_length * edge);
  }
  EXPECT_LT(set.lines.size(), crest_of(mesh).lines.size());
}

TEST(CrestLines, OfOneLevelAreDrawnThere) {
  CrestOptions options;
  options.level = 12;
  const CrestSet set = crest_of(small_ridge(), options);
  ASSERT_GE(set.lines.size(), 3U);
  for (const CrestLine& line : set.lines) {
    for (const CrestPoint& p : line.points) EXPECT_EQ(p.level, 12.0);
  }
}

TEST(CrestLines, StopWhenCancelled) {
  const RunControl run = RunControl::create();
  run.cancel();
  const CrestSet set = find_crest_lines(surface_graph(small_ridge()), {}, run);
  EXPECT_EQ(set.status, Status::cancelled);
  EXPECT_TRUE(set.lines.empty());
}

TEST(CrestLines, OfDegenerateSurfacesAreNone) {
  Points points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0;
  Triangles one(1, 3);
  one << 0, 1, 2;
  EXPECT_TRUE(crest_of({points, one}).lines.empty());
  Triangles thin(1, 3);
  thin << 0, 1, 1;
  EXPECT_TRUE(crest_of({points, thin}).lines.empty());
  EXPECT_TRUE(crest_of({Points::Zero(4, 3), one}).lines.empty());
  Triangles three(3, 3);  // an edge with three faces
  three << 0, 1, 2, 1, 0, 3, 0, 1, 2;
  EXPECT_TRUE(crest_of({points, three}).lines.empty());
}

TEST(CrestLines, RefuseWhatTheyCannotDo) {
  const AnalyticSurface sphere = make_sphere(1.0, 500);
  const SurfaceGraph cloud = surface_graph(PointCloud{sphere.mesh.points, sphere.normals});
  EXPECT_THROW(find_crest_lines(cloud), AnalysisError);
  const auto refused = [&](auto&& change) {
    CrestOptions options;
    change(options);
    EXPECT_THROW(crest_of(sphere.mesh, options), InvalidArgument);
  };
  refused([](CrestOptions& o) { o.level = 24; });
  refused([](CrestOptions& o) { o.level = -1; });
  refused([](CrestOptions& o) { o.finest = 0; });
  refused([](CrestOptions& o) { o.gamma = 0.0; });
  refused([](CrestOptions& o) { o.gamma = std::nan(""); });
  refused([](CrestOptions& o) { o.high = 0.01; });
  refused([](CrestOptions& o) { o.noise_sigma = -1.0; });
  refused([](CrestOptions& o) { o.drawn_share = 1.5; });
  refused([](CrestOptions& o) { o.drawn_share = 1.0 - 1e-9; });
  refused([](CrestOptions& o) { o.max_turn = 0.0; });
  refused([](CrestOptions& o) { o.min_anisotropy = 1.0; });
  refused([](CrestOptions& o) { o.schedule.num_levels = 65; });
}

}  // namespace
}  // namespace dupin
