#include "dupin/render/range_view.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;

RangeCamera camera_at(double distance, bool is_orthographic) {
  RangeCamera camera;
  camera.position = {0.0, 0.0, distance};
  camera.rows = 90;
  camera.cols = 120;
  camera.is_orthographic = is_orthographic;
  camera.pixel = is_orthographic ? 0.03 : 0.03 / distance;
  return camera;
}

Index num_valid(const RangeView& view) {
  return std::count(view.grid.is_valid.begin(), view.grid.is_valid.end(), std::uint8_t{1});
}

Points to_world(const Points& points, const RangeCamera& camera) {
  return (points * camera.rotation).rowwise() + camera.position.transpose();
}

/// A rectangle |x|, |y| <= half_width at height z, facing +z.
Mesh square(double half_width, double z) {
  Mesh mesh;
  mesh.points.resize(4, 3);
  mesh.points << -half_width, -half_width, z, half_width, -half_width, z, half_width, half_width, z,
      -half_width, half_width, z;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

// From distance d a sphere of radius r is seen up to the cone sin a = r / d; every point lies on
// its ray and on the sphere, short of it by at most the sagitta of a facet; the nearest is d - r.
TEST(RangeView, OfASphereIsTheSphere) {
  const Mesh sphere = make_icosphere(1.0, 6).mesh;
  const double sagitta = 1.0 - std::sqrt(1.0 - 0.02 * 0.02);  // facets fit in a circle of 0.02
  for (const bool is_orthographic : {false, true}) {
    const RangeCamera camera = camera_at(3.0, is_orthographic);
    const RangeView view = scan_range_view(sphere, camera);
    const Points world = to_world(view.grid.points, camera);
    const double limit = is_orthographic ? 1.0 : std::tan(std::asin(1.0 / 3.0));
    for (Index row = 0; row < camera.rows; ++row) {
      for (Index col = 0; col < camera.cols; ++col) {
        const Index i = row * camera.cols + col;
        const double x = (static_cast<double>(col) - 59.5) * camera.pixel;
        const double y = (44.5 - static_cast<double>(row)) * camera.pixel;
        const double aside = std::hypot(x, y);
        const bool is_seen = view.grid.is_valid[static_cast<std::size_t>(i)] != 0;
        EXPECT_FALSE(is_seen && aside > limit) << row << ' ' << col;
        EXPECT_FALSE(!is_seen && aside < 0.995 * limit) << row << ' ' << col;
        if (!is_seen) continue;
        EXPECT_LE(world.row(i).norm(), 1.0 + 1e-12);
        EXPECT_GE(world.row(i).norm(), 1.0 - sagitta);
        const double depth = is_orthographic ? 1.0 : -view.grid.points(i, 2);
        EXPECT_NEAR(view.grid.points(i, 0), x * depth, 1e-12);
        EXPECT_NEAR(view.grid.points(i, 1), y * depth, 1e-12);
        // The near side: towards the camera.
        const double towards = is_orthographic
                                   ? world(i, 2)
                                   : world.row(i).dot(camera.position.transpose() - world.row(i));
        EXPECT_GT(towards, -0.02);
      }
    }
  }
}

// A ray meets a plane where linear algebra says so: no interpolation in the picture, hence exact
// also where depth varies by a factor of two over one triangle.
TEST(RangeView, MeetsAPlaneExactly) {
  Mesh mesh = square(2.0, 0.0);
  const Eigen::Matrix3d tilt = Eigen::AngleAxisd(50.0 * kDegree, Vector3d::UnitX()).matrix();
  mesh.points = mesh.points * tilt.transpose();
  const Vector3d normal = tilt.col(2);
  const RangeCamera camera = camera_at(4.0, false);
  const RangeView view = scan_range_view(mesh, camera);
  const Points world = to_world(view.grid.points, camera);
  ASSERT_GT(num_valid(view), 1000);
  for (Index i = 0; i < world.rows(); ++i) {
    if (view.grid.is_valid[static_cast<std::size_t>(i)] == 0) continue;
    EXPECT_NEAR(world.row(i).dot(normal), 0.0, 1e-14);
  }
}

// Rays through the shared diagonal and vertices leave no hole.
TEST(RangeView, LeavesNoHoleBetweenTriangles) {
  for (const bool is_orthographic : {false, true}) {
    RangeCamera camera = camera_at(2.0, is_orthographic);
    camera.rows = camera.cols = 64;
    camera.pixel = is_orthographic ? 0.0625 : 0.03125;  // the corner of the square at the corner
    const RangeView view = scan_range_view(square(2.0, 0.0), camera);
    EXPECT_EQ(num_valid(view), 64 * 64);
    EXPECT_EQ(view.mesh.triangles.rows(), 2 * 63 * 63);
  }
}

// The nearer of two squares hides the other, whatever their order; the jump between them carries no
// triangle.
TEST(RangeView, ShowsWhatIsInFront) {
  for (const bool is_turned : {false, true}) {
    const Mesh a = square(is_turned ? 1.0 : 0.4, is_turned ? 0.0 : 0.5);
    const Mesh b = square(is_turned ? 0.4 : 1.0, is_turned ? 0.5 : 0.0);
    Mesh both{Points(8, 3), Triangles(4, 3)};
    both.points << a.points, b.points;
    both.triangles << a.triangles, b.triangles.array() + 4;
    const RangeCamera camera = camera_at(5.0, true);
    const RangeView view = scan_range_view(both, camera);
    for (Index i = 0; i < view.grid.points.rows(); ++i) {
      if (view.grid.is_valid[static_cast<std::size_t>(i)] == 0) continue;
      const double x = view.grid.points(i, 0);
      const double y = view.grid.points(i, 1);
      const bool is_front = std::abs(x) < 0.4 && std::abs(y) < 0.4;
      EXPECT_NEAR(view.grid.points(i, 2), is_front ? -4.5 : -5.0, 1e-14);
    }
    for (Index f = 0; f < view.mesh.triangles.rows(); ++f) {
      double low = 0.0;
      double high = -10.0;
      for (int c = 0; c < 3; ++c) {
        const double z = view.mesh.points(view.mesh.triangles(f, c), 2);
        low = std::min(low, z);
        high = std::max(high, z);
      }
      EXPECT_LT(high - low, 1e-12);
      const Vector3d p = view.mesh.points.row(view.mesh.triangles(f, 0));
      const Vector3d q = view.mesh.points.row(view.mesh.triangles(f, 1));
      const Vector3d r = view.mesh.points.row(view.mesh.triangles(f, 2));
      EXPECT_GT((q - p).cross(r - p).z(), 0.0);
    }
  }
}

// Moving the camera and the mesh together changes nothing but rounding.
TEST(RangeView, DependsOnTheRelativePoseOnly) {
  const Mesh mesh = make_bumpy_sphere(1.0, 3000, {8, 0.2, 0.3, 1}).surface.mesh;
  const RangeCamera camera = fit_range_camera(mesh.points, {30.0, 20.0, 0.3, 1.0}, 60, 80);
  const RangeView view = scan_range_view(mesh, camera);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.0, Vector3d(1.0, 2.0, -1.0).normalized()).matrix();
  const Vector3d shift(3.0, -4.0, 5.0);
  Mesh other = mesh;
  other.points = (mesh.points * turn.transpose()).rowwise() + shift.transpose();
  RangeCamera moved = camera;
  moved.rotation = camera.rotation * turn.transpose();
  moved.position = turn * camera.position + shift;
  const RangeView again = scan_range_view(other, moved);
  Index num_changed = 0;  // rays that graze an edge of the silhouette
  for (Index i = 0; i < view.grid.points.rows(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (view.grid.is_valid[at] != again.grid.is_valid[at]) {
      ++num_changed;
    } else if (view.face[at] == again.face[at]) {
      EXPECT_LT((view.grid.points.row(i) - again.grid.points.row(i)).norm(), 1e-9);
    }
  }
  EXPECT_LE(num_changed, 1);
  // And all points, taken back to the world, lie on the triangle that was met.
  const Points world = to_world(view.grid.points, camera);
  for (Index i = 0; i < world.rows(); ++i) {
    const std::int32_t f = view.face[static_cast<std::size_t>(i)];
    if (f < 0) continue;
    const Vector3d a = mesh.points.row(mesh.triangles(f, 0));
    const Vector3d b = mesh.points.row(mesh.triangles(f, 1));
    const Vector3d c = mesh.points.row(mesh.triangles(f, 2));
    const Vector3d normal = (b - a).cross(c - a).normalized();
    EXPECT_NEAR((world.row(i).transpose() - a).dot(normal), 0.0, 1e-12);
  }
}

// fit_range_camera() shows everything: no vertex projects outside the picture, and the scene fills
// most of it.
TEST(RangeView, FittedCameraSeesEverything) {
  const Mesh mesh = make_ellipsoid(1.0, 0.3, 0.6, 2000).mesh;
  for (const double perspective : {0.0, 0.3, 0.7}) {
    for (const double azimuth : {0.0, 77.0, 200.0}) {
      const RangeCamera camera =
          fit_range_camera(mesh.points, {azimuth, 35.0, perspective, 1.0}, 100, 150);
      double widest = 0.0;
      for (Index v = 0; v < mesh.points.rows(); ++v) {
        const Vector3d p = camera.rotation * (mesh.points.row(v).transpose() - camera.position);
        ASSERT_LT(p.z(), 0.0);
        const double depth = camera.is_orthographic ? 1.0 : -p.z();
        const double x = std::abs(p.x() / depth / camera.pixel) / 75.0;
        const double y = std::abs(p.y() / depth / camera.pixel) / 50.0;
        widest = std::max({widest, x, y});
      }
      EXPECT_LE(widest, 1.0);
      EXPECT_GE(widest, 0.8);
    }
  }
}

// Noise moves points along their rays only, with the stated deviation on the ray, also where it is
// twice as long as its depth; the limit of incidence keeps the pixels within asin of it on a
// sphere.
TEST(RangeView, NoiseLiesAlongTheRays) {
  const Mesh plane = square(9.0, 0.0);
  const RangeCamera camera = camera_at(1.0, false);  // rays up to 66 degrees off the axis
  RangeViewOptions options;
  options.noise_sigma = 0.01;
  options.seed = 5;
  const RangeView clean = scan_range_view(plane, camera);
  const RangeView noisy = scan_range_view(plane, camera, options);
  ASSERT_EQ(num_valid(clean), 90 * 120);
  EXPECT_EQ(clean.grid.is_valid, noisy.grid.is_valid);
  double squares = 0.0;
  for (Index i = 0; i < clean.grid.points.rows(); ++i) {
    const Eigen::RowVector3d p = clean.grid.points.row(i);
    const Eigen::RowVector3d q = noisy.grid.points.row(i);
    EXPECT_LT(p.cross(q).norm(), 1e-12);
    squares += (p - q).squaredNorm();
  }
  // 10,800 pixels: five standard errors of a deviation are 3.4 %.
  EXPECT_NEAR(std::sqrt(squares / 10'800.0), 0.01, 3.4e-4);

  RangeViewOptions steep;
  steep.max_incidence_deg = 30.0;
  const Mesh sphere = make_icosphere(1.0, 5).mesh;
  const RangeCamera flat = camera_at(3.0, true);
  const RangeView part = scan_range_view(sphere, flat, steep);
  for (Index i = 0; i < part.grid.points.rows(); ++i) {
    if (part.grid.is_valid[static_cast<std::size_t>(i)] == 0) continue;
    // Facets of 0.04 turn from the sphere by 0.04 at most.
    EXPECT_LE(part.grid.points.row(i).head<2>().norm(), std::sin(30.0 * kDegree) + 0.04);
  }
  EXPECT_GT(num_valid(part), 0);
}

// Nothing in the picture: looking away, behind the camera, no triangle at all.
TEST(RangeView, MayBeEmpty) {
  const Mesh sphere = make_icosphere(1.0, 2).mesh;
  RangeCamera away = camera_at(3.0, false);
  away.position.z() = -3.0;
  for (const bool is_orthographic : {false, true}) {
    away.is_orthographic = is_orthographic;
    const RangeView view = scan_range_view(sphere, away);
    EXPECT_EQ(num_valid(view), 0);
    EXPECT_EQ(view.mesh.points.rows(), 0);
    EXPECT_EQ(view.mesh.triangles.rows(), 0);
  }
  EXPECT_EQ(num_valid(scan_range_view(Mesh{}, camera_at(3.0, false))), 0);
}

// A camera inside sees the inside, also through triangles that reach behind it.
TEST(RangeView, SeesTheInsideFromWithin) {
  RangeCamera camera = camera_at(1.0, false);
  camera.position.setZero();
  const RangeView view = scan_range_view(make_icosphere(1.0, 1).mesh, camera);
  EXPECT_EQ(num_valid(view), 90 * 120);
}

// A wall at x = 1 that reaches past the camera is met by the rays to the right of the axis alone,
// not backwards by those to the left.
TEST(RangeView, LooksForwardOnly) {
  Mesh wall = square(100.0, 1.0);
  wall.points.col(0).swap(wall.points.col(2));
  RangeCamera camera = camera_at(1.0, false);
  camera.position.setZero();
  const RangeView view = scan_range_view(wall, camera);
  for (Index i = 0; i < view.grid.points.rows(); ++i) {
    const bool is_right = i % camera.cols >= camera.cols / 2;
    EXPECT_EQ(view.grid.is_valid[static_cast<std::size_t>(i)] != 0, is_right);
    EXPECT_NEAR(view.grid.points(i, 0), is_right ? 1.0 : 0.0, 1e-12);
  }
}

TEST(RangeView, DoesNotDependOnThreads) {
  const Mesh mesh = make_bumpy_sphere(1.0, 3000, {8, 0.2, 0.3, 1}).surface.mesh;
  const RangeCamera camera = fit_range_camera(mesh.points, {30.0, 20.0, 0.3, 1.0}, 120, 160);
  RangeViewOptions options;
  options.noise_sigma = 0.01;
  const int before = thread_count();
  set_thread_count(1);
  const RangeView one = scan_range_view(mesh, camera, options);
  set_thread_count(4);
  const RangeView four = scan_range_view(mesh, camera, options);
  set_thread_count(before);
  EXPECT_EQ(one.grid.points, four.grid.points);
  EXPECT_EQ(one.face, four.face);
  EXPECT_EQ(one.mesh.triangles, four.mesh.triangles);
}

TEST(RangeView, StopsWhenCancelled) {
  const RunControl run = RunControl::create();
  run.cancel();
  const RangeView view =
      scan_range_view(make_icosphere(1.0, 2).mesh, camera_at(3.0, false), {}, run);
  EXPECT_EQ(view.status, Status::cancelled);
  EXPECT_EQ(view.grid.points.rows(), 0);
}

TEST(RangeView, RefusesWhatIsOutOfRange) {
  const Mesh sphere = make_icosphere(1.0, 1).mesh;
  const auto refused = [&](auto change) {
    RangeCamera camera = camera_at(3.0, false);
    RangeViewOptions options;
    change(camera, options);
    try {
      scan_range_view(sphere, camera, options);
    } catch (const InvalidArgument&) {
      return true;
    }
    return false;
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(refused([](auto&, auto&) {}));
  EXPECT_TRUE(refused([](auto& c, auto&) { c.rows = 0; }));
  EXPECT_TRUE(refused([](auto& c, auto&) { c.cols = 40'000; }));
  EXPECT_TRUE(refused([](auto& c, auto&) { c.pixel = 0.0; }));
  EXPECT_TRUE(refused([](auto& c, auto&) { c.position.x() = kNaN; }));
  EXPECT_TRUE(refused([](auto& c, auto&) { c.rotation *= 2.0; }));
  EXPECT_TRUE(refused([](auto&, auto& o) { o.noise_sigma = -1.0; }));
  EXPECT_TRUE(refused([](auto&, auto& o) { o.max_incidence_deg = 0.0; }));
  EXPECT_TRUE(refused([](auto&, auto& o) { o.grid.max_depth_jump = kNaN; }));
  EXPECT_THROW(fit_range_camera(Points(0, 3), {}, 10, 10), InvalidArgument);
  EXPECT_THROW(fit_range_camera(Points::Zero(3, 3), {}, 10, 10), InvalidArgument);
  EXPECT_THROW(fit_range_camera(sphere.points, {}, 2, 10), InvalidArgument);
}

}  // namespace
}  // namespace dupin
