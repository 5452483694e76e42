#include "dupin/mesh/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/mesh/topology.h"

namespace dupin {
namespace {

using Eigen::Index;
constexpr double kPi = std::numbers::pi;

struct Closed {
  std::string name;
  std::function<AnalyticSurface(Index)> make;
  Index euler;
  double area;    // exact; 0: not closed form here
  double volume;  // exact
};

std::vector<Closed> closed_shapes() {
  BumpOptions bumps;
  bumps.num_bumps = 5;
  return {
      {"sphere", [](Index n) { return make_sphere(2.0, n); }, 2, 16 * kPi, 32.0 / 3.0 * kPi},
      {"torus", [](Index n) { return make_torus(3.0, 1.0, n); }, 0, 12 * kPi * kPi, 6 * kPi * kPi},
      {"ellipsoid", [](Index n) { return make_ellipsoid(3.0, 2.0, 1.0, n); }, 2, 0.0, 8 * kPi},
      {"bumpy sphere", [=](Index n) { return make_bumpy_sphere(1.0, n, bumps).surface; }, 2, 0.0,
       0.0},
  };
}

std::vector<std::pair<std::string, std::function<AnalyticSurface(Index)>>> open_shapes() {
  const auto plane = [](Index n) {
    PlaneOptions options;
    options.num_vertices = n;
    options.half_width = 1.5;
    return options;
  };
  const auto irregular = [plane](Index n) {
    PlaneOptions options = plane(n);
    options.jitter = 0.3;
    options.seed = 7;
    return options;
  };
  const auto square = [plane](Index n) {
    PlaneOptions options = plane(n);
    options.lattice = Lattice::square;
    return options;
  };
  return {
      {"cylinder", [](Index n) { return make_cylinder(2.0, 5.0, n); }},
      {"plane", [=](Index n) { return make_plane(plane(n)); }},
      {"irregular plane", [=](Index n) { return make_plane(irregular(n)); }},
      {"square plane", [=](Index n) { return make_plane(square(n)); }},
      {"saddle", [=](Index n) { return make_saddle(0.7, plane(n)); }},
      {"monkey saddle", [=](Index n) { return make_monkey_saddle(0.4, irregular(n)); }},
      {"paraboloid", [=](Index n) { return make_paraboloid(0.9, plane(n)); }},
      {"Gaussian bump", [=](Index n) { return make_gaussian_bump(0.5, 0.4, plane(n)); }},
      {"raised disk", [=](Index n) { return make_raised_disk(0.8, 0.3, 0.4, square(n)); }},
  };
}

Index euler(const Mesh& mesh, const MeshTopology& topology) {
  return mesh.points.rows() - topology.num_edges + mesh.triangles.rows();
}

// Integral of a vertex function over the mesh, one third of each triangle to each corner.
double integral(const Mesh& mesh, const Eigen::VectorXd& values) {
  double sum = 0.0;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const double third = triangle_area(mesh, f) / 3.0;
    for (Index k = 0; k < 3; ++k) sum += third * values(mesh.triangles(f, k));
  }
  return sum;
}

TEST(Shapes, ClosedOnesAreClosedManifoldsOfTheRightGenus) {
  for (const Closed& shape : closed_shapes()) {
    SCOPED_TRACE(shape.name);
    const AnalyticSurface surface = shape.make(3000);
    const MeshTopology topology =
        compute_topology(surface.mesh.triangles, surface.mesh.points.rows());
    EXPECT_EQ(topology.num_boundary_edges, 0);
    EXPECT_EQ(topology.num_nonmanifold_edges, 0);
    EXPECT_EQ(euler(surface.mesh, topology), shape.euler);
    EXPECT_EQ(find_components(topology.ring).count, 1);
    EXPECT_GT(enclosed_volume(surface.mesh), 0.0) << "must face outward";
  }
}

TEST(Shapes, OpenOnesAreDiscsOrAnnuliWithoutFolds) {
  for (const auto& [name, make] : open_shapes()) {
    SCOPED_TRACE(name);
    const AnalyticSurface surface = make(2000);
    const MeshTopology topology =
        compute_topology(surface.mesh.triangles, surface.mesh.points.rows());
    EXPECT_EQ(topology.num_nonmanifold_edges, 0);
    EXPECT_GT(topology.num_boundary_edges, 0);
    EXPECT_EQ(euler(surface.mesh, topology), name == "cylinder" ? 0 : 1);
  }
}

// A sweep asks for N and must get about N: one row of a square sampling is sqrt(N).
TEST(Shapes, HaveAboutAsManyVerticesAsAsked) {
  for (const Index n : {100, 2000, 30000}) {
    const double slack = 3.0 * std::sqrt(static_cast<double>(n)) + 12.0;
    for (const Closed& shape : closed_shapes()) {
      EXPECT_NEAR(static_cast<double>(shape.make(n).mesh.points.rows()), static_cast<double>(n),
                  2.0 * slack)
          << shape.name;
    }
    for (const auto& [name, make] : open_shapes()) {
      EXPECT_NEAR(static_cast<double>(make(n).mesh.points.rows()), static_cast<double>(n), slack)
          << name;
    }
  }
}

// Faces agree with the normals: every triangle turns the way the smooth surface faces.
TEST(Shapes, TrianglesFaceLikeTheirNormals) {
  auto shapes = open_shapes();
  for (const Closed& shape : closed_shapes()) shapes.emplace_back(shape.name, shape.make);
  for (const auto& [name, make] : shapes) {
    SCOPED_TRACE(name);
    const AnalyticSurface surface = make(4000);
    const Points normals = vertex_normals(surface.mesh);
    EXPECT_GT((normals.cwiseProduct(surface.normals)).rowwise().sum().minCoeff(), 0.8);
    for (Index v = 0; v < normals.rows(); ++v) {
      ASSERT_NEAR(surface.normals.row(v).norm(), 1.0, 1e-14);
    }
  }
}

// Inscribed facets of size h miss area and volume by O(h^2) = O(1/N): four times the vertices,
// a quarter of the error.
TEST(Shapes, AreaAndVolumeConvergeWithOrderTwo) {
  for (const Closed& shape : closed_shapes()) {
    if (shape.volume == 0.0) continue;
    SCOPED_TRACE(shape.name);
    const AnalyticSurface coarse = shape.make(2000);
    const AnalyticSurface fine = shape.make(32000);
    const double ratio = static_cast<double>(fine.mesh.points.rows()) /
                         static_cast<double>(coarse.mesh.points.rows());
    const auto order = [&](double coarse_error, double fine_error) {
      return 2.0 * std::log(coarse_error / fine_error) / std::log(ratio);
    };
    EXPECT_NEAR(order(shape.volume - enclosed_volume(coarse.mesh),
                      shape.volume - enclosed_volume(fine.mesh)),
                2.0, 0.1);
    if (shape.area == 0.0) continue;
    EXPECT_NEAR(order(shape.area - surface_area(coarse.mesh), shape.area - surface_area(fine.mesh)),
                2.0, 0.1);
  }
}

// Gauss-Bonnet: the integral of the stated K is 2 pi chi.
TEST(Shapes, StatedGaussCurvatureIntegratesToTwoPiChi) {
  for (const Closed& shape : closed_shapes()) {
    SCOPED_TRACE(shape.name);
    const AnalyticSurface surface = shape.make(40000);
    EXPECT_NEAR(integral(surface.mesh, surface.gauss), 2.0 * kPi * static_cast<double>(shape.euler),
                4.0 * kPi * 2e-3);
  }
}

// First variation of the area: d/dt Area(p + t n) = integral of 2 H, which ties the stated mean
// curvature and its sign to the mesh itself.
TEST(Shapes, StatedMeanCurvatureIsTheFirstVariationOfArea) {
  for (const Closed& shape : closed_shapes()) {
    SCOPED_TRACE(shape.name);
    AnalyticSurface surface = shape.make(40000);
    const double twice_mean = 2.0 * integral(surface.mesh, surface.mean);
    const double step = 1e-4;
    Mesh out = surface.mesh;
    Mesh in = surface.mesh;
    out.points += step * surface.normals;
    in.points -= step * surface.normals;
    const double variation = (surface_area(out) - surface_area(in)) / (2.0 * step);
    EXPECT_GT(twice_mean, 0.0);
    EXPECT_NEAR(variation, twice_mean, 3e-3 * twice_mean);
  }
}

// H = (k1 + k2)/2, K = k1 k2, k1 >= k2.
TEST(Shapes, CurvaturesAgreeWithEachOther) {
  auto shapes = open_shapes();
  for (const Closed& shape : closed_shapes()) shapes.emplace_back(shape.name, shape.make);
  for (const auto& [name, make] : shapes) {
    SCOPED_TRACE(name);
    const AnalyticSurface s = make(3000);
    const double scale = std::max(s.k1.cwiseAbs().maxCoeff(), s.k2.cwiseAbs().maxCoeff());
    EXPECT_LE((s.mean - 0.5 * (s.k1 + s.k2)).cwiseAbs().maxCoeff(), 1e-14 * scale);
    EXPECT_LE((s.gauss - s.k1.cwiseProduct(s.k2)).cwiseAbs().maxCoeff(), 1e-13 * scale * scale);
    EXPECT_GE((s.k1 - s.k2).minCoeff(), 0.0);
  }
}

// Normal curvature along an edge d is dn . d / |d|^2 to first order (1/r on a sphere), so it lies
// between the stated principal curvatures of its ends, and attains both as directions vary.
TEST(Shapes, StatedCurvatureBoundsTheTurningOfTheNormals) {
  auto shapes = open_shapes();
  for (const Closed& shape : closed_shapes()) shapes.emplace_back(shape.name, shape.make);
  for (const auto& [name, make] : shapes) {
    SCOPED_TRACE(name);
    const AnalyticSurface s = make(40000);
    const double scale = std::max(s.k1.cwiseAbs().maxCoeff(), s.k2.cwiseAbs().maxCoeff());
    const double slack = 0.06 * scale + 1e-12;
    double largest = -1e300;
    double smallest = 1e300;
    for (Index f = 0; f < s.mesh.triangles.rows(); ++f) {
      for (Index k = 0; k < 3; ++k) {
        const Index a = s.mesh.triangles(f, k);
        const Index b = s.mesh.triangles(f, (k + 1) % 3);
        const Eigen::RowVector3d d = s.mesh.points.row(b) - s.mesh.points.row(a);
        const double turning = (s.normals.row(b) - s.normals.row(a)).dot(d) / d.squaredNorm();
        ASSERT_LE(turning, std::max(s.k1(a), s.k1(b)) + slack);
        ASSERT_GE(turning, std::min(s.k2(a), s.k2(b)) - slack);
        largest = std::max(largest, turning);
        smallest = std::min(smallest, turning);
      }
    }
    // Edges come in directions 60 degrees apart: within 30 of any, where (k1 - k2) sin^2 = 1/4
    // of the range is lost on either side.
    EXPECT_GE(largest, s.k1.maxCoeff() - 0.51 * scale);
    EXPECT_LE(smallest, s.k2.minCoeff() + 0.51 * scale);
  }
}

Index nearest_vertex(const Mesh& mesh, const Eigen::RowVector3d& to) {
  Index nearest = 0;
  (mesh.points.rowwise() - to).rowwise().squaredNorm().minCoeff(&nearest);
  return nearest;
}

TEST(Shapes, CurvatureAtTheTextbookPlaces) {
  const AnalyticSurface sphere = make_icosphere(2.5, 2);
  EXPECT_EQ(sphere.mesh.points.rows(), 162);
  EXPECT_LE((sphere.k1.array() - 0.4).abs().maxCoeff(), 1e-14);
  EXPECT_LE((sphere.k2.array() - 0.4).abs().maxCoeff(), 1e-14);

  const AnalyticSurface cylinder = make_cylinder(4.0, 3.0, 500);
  EXPECT_LE((cylinder.k1.array() - 0.25).abs().maxCoeff(), 1e-14);
  EXPECT_LE(cylinder.k2.cwiseAbs().maxCoeff(), 1e-14);

  // Outer equator 1/r and 1/(R + r), inner equator 1/r and -1/(R - r): vertex 0 and half way round.
  const AnalyticSurface torus = make_torus(3.0, 1.0, 2400);
  const Index outer = nearest_vertex(torus.mesh, {4, 0, 0});
  EXPECT_NEAR(torus.k1(outer), 1.0, 1e-13);
  EXPECT_NEAR(torus.k2(outer), 0.25, 1e-13);
  EXPECT_NEAR(torus.gauss.minCoeff(), -0.5, 5e-3);

  // Pole of the shortest axis: c / a^2 and c / b^2.
  const AnalyticSurface ellipsoid = make_ellipsoid(3.0, 2.0, 1.0, 20000);
  const Index pole = nearest_vertex(ellipsoid.mesh, {0, 0, 1});
  EXPECT_NEAR(ellipsoid.k1(pole), 0.25, 1e-3);
  EXPECT_NEAR(ellipsoid.k2(pole), 1.0 / 9.0, 1e-3);

  PlaneOptions odd;
  odd.lattice = Lattice::square;
  odd.num_vertices = 41 * 41;  // a vertex at the origin
  const auto at_origin = [](const AnalyticSurface& s) {
    return nearest_vertex(s.mesh, {s.mesh.points(s.mesh.points.rows() / 2, 0), 0, 0});
  };
  const AnalyticSurface saddle = make_saddle(0.7, odd);
  EXPECT_NEAR(saddle.k1(at_origin(saddle)), 1.4, 1e-13);
  EXPECT_NEAR(saddle.k2(at_origin(saddle)), -1.4, 1e-13);
  const AnalyticSurface cap = make_paraboloid(0.9, odd);
  EXPECT_NEAR(cap.mean(at_origin(cap)), 0.9, 1e-13) << "a cap seen from +z is a sphere outside";
  const AnalyticSurface bump = make_gaussian_bump(0.5, 0.4, odd);
  EXPECT_NEAR(bump.mean.maxCoeff(), 0.5 / 0.16, 1e-12);
  EXPECT_NEAR(bump.mesh.points.col(2).maxCoeff(), 0.5, 1e-15);
}

TEST(Shapes, BumpsStandWhereTheySay) {
  BumpOptions options;
  options.num_bumps = 8;
  options.height = 0.1;
  options.width = 0.15;
  options.seed = 3;
  const BumpySphere sphere = make_bumpy_sphere(2.0, 20000, options);
  ASSERT_EQ(sphere.centers.rows(), 8);
  for (Index i = 0; i < 8; ++i) {
    const Index v = sphere.nearest_vertex(i);
    const auto p = sphere.surface.mesh.points.row(v);
    EXPECT_NEAR(p.norm(), 2.2, 2e-3);
    EXPECT_GT(p.normalized().dot(sphere.centers.row(i)), std::cos(0.02));
    // A bump of radial height h and angular width w: H = (1/r)(1 + h/(w^2 (1 + h))) at the top.
    EXPECT_NEAR(sphere.surface.mean(v), (1.0 + 0.1 / (0.15 * 0.15 * 1.1)) / 2.2, 0.05);
  }
  const BumpySphere again = make_bumpy_sphere(2.0, 20000, options);
  EXPECT_TRUE(again.surface.mesh.points == sphere.surface.mesh.points);
}

TEST(Shapes, ASharpDiskHasNoCurvatureArrays) {
  PlaneOptions options;
  options.half_width = 2.0;
  const AnalyticSurface disk = make_raised_disk(1.0, 0.2, 0.0, options);
  EXPECT_EQ(disk.mean.size(), 0);
  EXPECT_EQ(disk.mesh.points.col(2).maxCoeff(), 0.2);
  EXPECT_EQ(disk.mesh.points.col(2).minCoeff(), 0.0);
}

TEST(Shapes, RefuseImpossibleSizes) {
  EXPECT_THROW(make_sphere(0.0, 100), InvalidArgument);
  EXPECT_THROW(make_sphere(1.0, 11), InvalidArgument);
  EXPECT_THROW(make_icosphere(1.0, -1), InvalidArgument);
  EXPECT_THROW(make_icosphere(std::nan(""), 1), InvalidArgument);
  EXPECT_THROW(make_torus(1.0, 1.0, 100), InvalidArgument);
  EXPECT_THROW(make_cylinder(1.0, -1.0, 100), InvalidArgument);
  PlaneOptions options;
  options.jitter = 0.5;
  EXPECT_THROW(make_plane(options), InvalidArgument);
  EXPECT_THROW(make_raised_disk(2.0, 1.0, 0.0), InvalidArgument);
}

}  // namespace
}  // namespace dupin
