#include "dupin/render/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/render/legend.h"
#include "dupin/render/shading.h"

namespace dupin {
namespace {

using Eigen::Index;

// A sphere of radius 1 about the origin as a grid of latitudes and longitudes.
Mesh globe(int rings) {
  const int sectors = 2 * rings;
  Mesh mesh;
  mesh.points.resize((rings + 1) * sectors, 3);
  mesh.triangles.resize(2 * rings * sectors, 3);
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const double a = std::numbers::pi * i / rings;
      const double b = 2.0 * std::numbers::pi * j / sectors;
      mesh.points.row(i * sectors + j) << std::sin(a) * std::cos(b), std::cos(a),
          -std::sin(a) * std::sin(b);
    }
  }
  Index face = 0;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const int k = (j + 1) % sectors;
      mesh.triangles.row(face++) << i * sectors + j, (i + 1) * sectors + j, (i + 1) * sectors + k;
      mesh.triangles.row(face++) << i * sectors + j, (i + 1) * sectors + k, i * sectors + k;
    }
  }
  return mesh;
}

// The square |x|, |y| <= 1 in the plane z.
SceneSurface square(double z, const Rgb& color) {
  SceneSurface surface;
  surface.points.resize(4, 3);
  surface.points << -1, -1, z, 1, -1, z, 1, 1, z, -1, 1, z;
  surface.triangles.resize(2, 3);
  surface.triangles << 0, 1, 2, 0, 2, 3;
  surface.color = color;
  return surface;
}

Scene scene_of(const Mesh& mesh) {
  Scene scene;
  scene.surfaces.emplace_back();
  scene.surfaces[0].points = mesh.points;
  scene.surfaces[0].triangles = mesh.triangles;
  return scene;
}

RenderOptions plain(int side) {
  RenderOptions options;
  options.width = side;
  options.height = side;
  options.camera.perspective = 0.0;
  options.background = Background::transparent;
  return options;
}

double covered_pixels(const Image& image) {
  double sum = 0.0;
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) sum += image.rgba[i] / 255.0;
  return sum;
}

const std::uint8_t* pixel(const Image& image, int x, int y) {
  return &image.rgba[static_cast<std::size_t>(4 * (y * image.width + x))];
}

// Radius of the fitted unit ball in pixels: a margin of 2.5 % a side and 2 % of slack.
double fitted_radius(int side) { return 0.5 * 0.95 * side * 0.98; }

// An exact ray-sphere silhouette has the area pi r^2; sampling errs by O(r^-3/2), rounding of
// alpha averages out. In perspective a ball on the axis is seen under sin a = r / d, so its picture
// has the radius r / sqrt(1 - p^2) in the plane of its centre, with p = r / d.
TEST(Renderer, SphereSilhouetteHasTheAreaOfACircle) {
  for (const double perspective : {0.0, 0.3}) {
    Scene scene;
    scene.spheres.push_back({Eigen::Vector3d(3.0, -2.0, 7.0), 2.0, Rgb(0.8, 0.2, 0.1), 1.0});
    RenderOptions options = plain(400);
    options.camera.perspective = perspective;
    const auto fit = detail::lay_out(scene, 400, 400).picture;
    Eigen::Matrix<double, 1, 3, Eigen::RowMajor> center(3.0, -2.0, 7.0);
    const Projection projection =
        fit_projection(center, Eigen::VectorXd::Constant(1, 2.0), options.camera, fit);
    const double p = perspective * 2.0 * projection.unit;
    const double radius = 2.0 * projection.pixels_per_unit() / std::sqrt(1.0 - p * p);
    const double area = std::numbers::pi * radius * radius;
    EXPECT_NEAR(covered_pixels(render_surface(scene, options)) / area, 1.0, 0.005) << perspective;
  }
}

// The same for a mesh: the outline of a fine globe is a polygon of area (1 - O(n^-2)) pi r^2.
TEST(Renderer, MeshSilhouetteHasTheAreaOfACircle) {
  const Image image = render_surface(scene_of(globe(64)), plain(300));
  const double area = std::numbers::pi * std::pow(fitted_radius(300), 2);
  EXPECT_NEAR(covered_pixels(image) / area, 1.0, 0.005);
}

// A square of two triangles that fills its place has no hole and no seam: every inner pixel is
// opaque, for any turn of the picture.
TEST(Renderer, SharedEdgesLeaveNoSeam) {
  for (const double azimuth : {0.0, 13.0, 45.0}) {
    RenderOptions options = plain(200);
    options.camera.azimuth_deg = azimuth;
    options.occlusion = 0.0;
    Scene scene;
    scene.surfaces.push_back(square(0.0, Rgb(0.5, 0.5, 0.5)));
    const Image image = render_surface(scene, options);
    for (int y = 40; y < 160; ++y) {
      for (int x = 60; x < 140; ++x) ASSERT_EQ(pixel(image, x, y)[3], 255) << x << " " << y;
    }
  }
}

// The nearer of two parallel planes wins everywhere, in either order, down to a gap of 1e-5 of the
// scene (depths are floats of 6e-8).
TEST(Renderer, DepthOrderIsExact) {
  for (const double gap : {0.5, 1e-3, 1e-5}) {
    for (const bool is_near_first : {true, false}) {
      Scene scene;
      const SceneSurface near = square(gap, Rgb(1, 0, 0));
      const SceneSurface far = square(0.0, Rgb(0, 0, 1));
      scene.surfaces = is_near_first ? std::vector{near, far} : std::vector{far, near};
      RenderOptions options = plain(96);
      options.camera.perspective = 0.2;
      options.occlusion = 0.0;
      options.edges = 0.0;
      const Image image = render_surface(scene, options);
      for (int y = 10; y < 86; ++y) {
        for (int x = 10; x < 86; ++x) {
          ASSERT_GT(pixel(image, x, y)[0], 2 * pixel(image, x, y)[2])
              << gap << " " << x << " " << y;
        }
      }
    }
  }
}

// Balls, lines and surfaces hide each other by depth, not by the order in which they are given.
TEST(Renderer, LinesAndBallsAreDepthTested) {
  Scene scene;
  scene.surfaces.push_back(square(0.0, Rgb(0.5, 0.5, 0.5)));
  ScenePolyline line;
  line.points.resize(2, 3);
  line.points << -0.8, 0.5, -0.2, 0.8, 0.5, -0.2;
  line.thickness_px = Eigen::VectorXd::Constant(1, 6.0);
  line.color = Rgb(1, 0, 0);
  scene.polylines.push_back(line);
  scene.spheres.push_back({Eigen::Vector3d(0, -0.5, -0.5), 0.2, Rgb(0, 0, 1), 1.0});
  const RenderOptions options = plain(200);
  const Image hidden = render_surface(scene, options);
  scene.polylines[0].points.col(2).setConstant(0.2);
  scene.spheres[0].center.z() = 0.5;
  const Image shown = render_surface(scene, options);
  const int up = 100 - static_cast<int>(std::lround(0.5 * fitted_radius(200)));
  EXPECT_EQ(pixel(hidden, 100, up)[0], pixel(hidden, 100, up)[1]);
  EXPECT_GT(pixel(shown, 100, up)[0], 200);
  EXPECT_LT(pixel(shown, 100, up)[1], 60);
  EXPECT_EQ(pixel(hidden, 100, 200 - up)[2], pixel(hidden, 100, 200 - up)[1]);
  EXPECT_GT(pixel(shown, 100, 200 - up)[2], 2 * pixel(shown, 100, 200 - up)[1]);
}

// The line is as thick as asked: a vertical cut through it sums to its thickness.
TEST(Renderer, LinesHaveTheirThickness) {
  Scene scene;
  ScenePolyline line;
  line.points.resize(3, 3);
  line.points << -1, 0, 0, 0, 0, 0, 1, 0, 0;
  line.thickness_px.resize(3);
  line.thickness_px << 4.0, 4.0, 12.0;
  scene.polylines.push_back(line);
  const Image image = render_surface(scene, plain(240));
  const auto cut = [&](int x) {
    double sum = 0.0;
    for (int y = 0; y < 240; ++y) sum += pixel(image, x, y)[3] / 255.0;
    return sum;
  };
  EXPECT_NEAR(cut(60), 4.0, 0.35);
  EXPECT_NEAR(cut(120 + static_cast<int>(0.5 * fitted_radius(240))), 8.0, 0.5);
}

// Where no light has set, the sky, which is linear in the normal, and the two lights add up to
// a + b cos(angle to the brightest normal); a light that sets only takes away. So within 80 degrees
// of it the light falls along every great circle.
TEST(Shading, FallsMonotonicallyAwayFromTheBrightestNormal) {
  const Eigen::Vector3f brightest =
      (0.78F * detail::kKeyLight + 0.14F * detail::kFillLight + 0.12F * Eigen::Vector3f::UnitY())
          .normalized();
  const Eigen::Vector3f first = brightest.cross(Eigen::Vector3f::UnitZ()).normalized();
  const Eigen::Vector3f second = brightest.cross(first);
  for (int turn = 0; turn < 24; ++turn) {
    const double t = 2.0 * std::numbers::pi * turn / 24.0;
    const Eigen::Vector3f along =
        static_cast<float>(std::cos(t)) * first + static_cast<float>(std::sin(t)) * second;
    float previous = 10.0F;
    for (int degrees = 0; degrees <= 80; degrees += 2) {
      const double a = degrees * std::numbers::pi / 180.0;
      const Eigen::Vector3f normal =
          static_cast<float>(std::cos(a)) * brightest + static_cast<float>(std::sin(a)) * along;
      const float light = detail::diffuse_light(normal, 1.0F);
      EXPECT_LT(light, previous) << turn << " " << degrees;
      previous = light;
    }
  }
}

TEST(Shading, LessSkyIsDarkerAndBubblesAreDenserAtTheRim) {
  const Eigen::Vector3f normal = Eigen::Vector3f(0.2F, 0.3F, 0.9F).normalized();
  for (int i = 0; i < 10; ++i) {
    const float s = static_cast<float>(i) / 10.0F;
    EXPECT_LT(detail::diffuse_light(normal, s), detail::diffuse_light(normal, s + 0.1F));
    EXPECT_GE(detail::bubble_alpha(0.3F, s), detail::bubble_alpha(0.3F, s + 0.1F));
    EXPECT_EQ(detail::bubble_alpha(1.0F, s), 1.0F);
  }
}

// A cavity sees less sky than a ball: the inside of a bowl is darker at its bottom with occlusion.
TEST(Renderer, OcclusionDarkensACavityAndNotABall) {
  Scene ball = scene_of(globe(24));
  RenderOptions with = plain(120);
  RenderOptions without = with;
  without.occlusion = 0.0;
  const auto middle = [](const Scene& scene, const RenderOptions& options) {
    return static_cast<int>(pixel(render_surface(scene, options), 60, 60)[1]);
  };
  EXPECT_NEAR(middle(ball, with), middle(ball, without), 3);
  // The lower half of the globe turned inside out and seen from above: a bowl.
  Scene bowl = ball;
  auto& surface = bowl.surfaces[0];
  const Index half = surface.triangles.rows() / 2;
  surface.triangles = Triangles(surface.triangles.bottomRows(half));
  surface.triangles.col(1).swap(surface.triangles.col(2));
  with.camera = without.camera = Camera::of(View::top);
  EXPECT_LT(middle(bowl, with), middle(bowl, without) - 10);
}

Scene busy_scene() {
  Scene scene = scene_of(globe(40));
  scene.surfaces[0].scalar = scene.surfaces[0].points.col(0);
  scene.scale = {ColorMap::diverging, {-1.0, 1.0}};
  for (int i = 0; i < 12; ++i) {
    const double a = 0.5 * i;
    scene.spheres.push_back(
        {Eigen::Vector3d(std::cos(a), 0.1 * i - 0.6, std::sin(a)), 0.3, Rgb(0.1, 0.5, 0.2), 0.4});
  }
  SceneSurface cloud;
  cloud.points = 1.1 * globe(6).points;
  cloud.normals = cloud.points;
  cloud.disc_radius = 0.05;
  scene.surfaces.push_back(cloud);
  ScenePolyline line;
  line.points = globe(8).points;
  line.thickness_px = Eigen::VectorXd::Constant(1, 3.0);
  scene.polylines.push_back(line);
  scene.legend = {"Title", "Caption", "x", true, true, "mm"};
  return scene;
}

TEST(Renderer, PicturesHaveTheSameBitsForEveryThreadCount) {
  const Scene scene = busy_scene();
  RenderOptions options;
  options.width = 320;
  options.height = 200;
  set_thread_count(1);
  const Image one = render_surface(scene, options);
  for (const int threads : {2, 8}) {
    set_thread_count(threads);
    EXPECT_EQ(render_surface(scene, options).rgba, one.rgba) << threads;
  }
  set_thread_count(0);
}

// Scaling and moving the world changes nothing but the scale bar, over 60 decades. A power of two
// keeps the bits of every coordinate.
TEST(Renderer, IsInvariantUnderScaling) {
  Scene scene = scene_of(globe(12));
  const RenderOptions options = plain(64);
  const Image expected = render_surface(scene, options);
  for (const int exponent : {-100, 100}) {
    Scene scaled = scene;
    scaled.surfaces[0].points *= std::ldexp(1.0, exponent);
    EXPECT_EQ(render_surface(scaled, options).rgba, expected.rgba) << exponent;
  }
}

TEST(Renderer, HugeCoordinatesAreDrawn) {
  Scene scene = scene_of(globe(12));
  scene.surfaces[0].points *= 1e30;
  scene.legend.has_scale_bar = true;
  EXPECT_GT(covered_pixels(render_surface(scene, plain(64))), 2000.0);
}

// Half a picture looks like a whole one.
TEST(Renderer, ACancelledRunGivesNoPicture) {
  const RunControl run = RunControl::create();
  run.cancel();
  const Image image = render_surface(scene_of(globe(12)), plain(64), run);
  EXPECT_EQ(image.width, 0);
  EXPECT_TRUE(image.rgba.empty());
}

TEST(Renderer, AnEmptySceneIsAnEmptyPicture) {
  EXPECT_EQ(covered_pixels(render_surface({}, plain(40))), 0.0);
  RenderOptions white = plain(40);
  white.background = Background::white;
  for (const std::uint8_t byte : render_surface({}, white).rgba) ASSERT_EQ(byte, 255);
}

TEST(Renderer, DegenerateTrianglesAndPointsAreHarmless) {
  Scene scene = scene_of(globe(12));
  auto& surface = scene.surfaces[0];
  surface.triangles.conservativeResize(surface.triangles.rows() + 2, 3);
  surface.triangles.bottomRows(2) << 5, 5, 5, 30, 31, 30;
  EXPECT_GT(covered_pixels(render_surface(scene, plain(64))), 2000.0);
  Scene point;
  point.surfaces.emplace_back();
  point.surfaces[0].points = Points::Constant(3, 3, 7.0);
  point.surfaces[0].triangles.resize(1, 3);
  point.surfaces[0].triangles << 0, 1, 2;
  EXPECT_EQ(covered_pixels(render_surface(point, plain(64))), 0.0);
}

// Discs that overlap cover a plane like the plane itself.
TEST(Renderer, ACloudOfDiscsCoversItsSurface) {
  Scene scene;
  scene.surfaces.emplace_back();
  auto& cloud = scene.surfaces[0];
  cloud.points.resize(400, 3);
  for (Index i = 0; i < 400; ++i) {
    cloud.points.row(i) << -1.0 + 2.0 / 19.0 * static_cast<double>(i % 20),
        -1.0 + 2.0 / 19.0 * static_cast<double>(i / 20), 0.0;
  }
  cloud.normals = Points::Zero(400, 3);
  cloud.normals.col(2).setOnes();
  const Image image = render_surface(scene, plain(120));
  for (int y = 25; y < 95; ++y) {
    for (int x = 25; x < 95; ++x) ASSERT_EQ(pixel(image, x, y)[3], 255) << x << " " << y;
  }
}

TEST(Renderer, WhatIsNotFiniteIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Scene good = busy_scene();
  const auto refuses = [&](const auto& spoil) {
    Scene scene = good;
    spoil(scene);
    EXPECT_THROW(render_surface(scene, plain(32)), InvalidArgument);
  };
  refuses([&](Scene& s) { s.surfaces[0].points(4, 1) = nan; });
  refuses([&](Scene& s) { s.surfaces[0].scalar[9] = nan; });
  refuses([&](Scene& s) { s.surfaces[1].normals(2, 2) = INFINITY; });
  refuses([&](Scene& s) { s.spheres[0].center.x() = nan; });
  refuses([&](Scene& s) { s.spheres[0].radius = nan; });
  refuses([&](Scene& s) { s.polylines[0].points(0, 0) = nan; });
  refuses([&](Scene& s) { s.polylines[0].thickness_px.resize(2); });
  refuses([&](Scene& s) { s.surfaces[0].triangles(0, 0) = -1; });
  refuses([&](Scene& s) { s.surfaces[0].scalar.resize(3); });
  refuses([&](Scene& s) { s.scale.range.high = nan; });
}

TEST(Renderer, OptionsOutsideTheirRangeAreRefused) {
  const auto refuses = [](const auto& spoil) {
    RenderOptions options;
    spoil(options);
    EXPECT_THROW(render_surface({}, options), InvalidArgument);
  };
  refuses([](RenderOptions& o) { o.width = 0; });
  refuses([](RenderOptions& o) { o.height = 20000; });
  refuses([](RenderOptions& o) { o.supersampling = 9; });
  refuses([](RenderOptions& o) { o.occlusion = -1.0; });
  refuses([](RenderOptions& o) { o.camera.perspective = 1.0; });
  refuses([](RenderOptions& o) { o.camera.elevation_deg = 91.0; });
  EXPECT_THROW(camera_of("sideways"), InvalidArgument);
  EXPECT_THROW(camera_of("10"), InvalidArgument);
  EXPECT_EQ(camera_of("35,-20").elevation_deg, -20.0);
}

TEST(Renderer, ACancelledRunDrawsNoSurface) {
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(covered_pixels(render_surface(scene_of(globe(12)), plain(64), run)), 0.0);
}

// Views are rotations whose third row points to the viewer.
TEST(Camera, ViewsAreRotationsTowardsTheViewer) {
  const std::pair<View, Eigen::Vector3d> expected[] = {
      {View::front, {0, 0, 1}}, {View::back, {0, 0, -1}}, {View::left, {-1, 0, 0}},
      {View::right, {1, 0, 0}}, {View::top, {0, 1, 0}},   {View::bottom, {0, -1, 0}}};
  for (const auto& [view, direction] : expected) {
    const Eigen::Matrix3d rotation = view_rotation(Camera::of(view));
    EXPECT_LT((rotation.row(2).transpose() - direction).norm(), 1e-15);
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(rotation.determinant(), 1.0, 1e-14);
  }
}

// Whatever the view, everything lies inside the viewport and touches it on two sides.
TEST(Camera, TheFitHoldsEverythingAndIsTight) {
  const Points points = globe(10).points * Eigen::DiagonalMatrix<double, 3>(3.0, 1.0, 0.5);
  const Viewport viewport{10, 20, 300, 200};
  for (const char* view : {"front", "iso", "top", "123,-40"}) {
    Camera camera = camera_of(view);
    camera.perspective = 0.4;
    const Projection fit = fit_projection(points, {}, camera, viewport);
    double left = 1e9;
    double right = -1e9;
    double top = 1e9;
    double bottom = -1e9;
    for (Index i = 0; i < points.rows(); ++i) {
      const Eigen::Vector3d p = fit.project(fit.to_view(points.row(i).transpose()));
      left = std::min(left, p.x());
      right = std::max(right, p.x());
      top = std::min(top, p.y());
      bottom = std::max(bottom, p.y());
    }
    EXPECT_NEAR(left + right, 2 * 10 + 300, 1e-9);
    EXPECT_NEAR(top + bottom, 2 * 20 + 200, 1e-9);
    EXPECT_NEAR(std::max((right - left) / 300, (bottom - top) / 200), 0.98, 1e-9) << view;
  }
}

// The grey of no value stands under the colour bar when the legend names it, in a box as wide as
// the bar, and nowhere otherwise.
TEST(Renderer, NamesWhatHasNoValueUnderTheColorBar) {
  Scene scene = scene_of(globe(8));
  scene.surfaces[0].scalar = scene.surfaces[0].points.col(0);
  scene.legend.has_color_bar = true;
  RenderOptions options;
  options.width = 400;
  options.height = 300;
  const auto grey_pixels = [&] {
    const Image image = render_surface(scene, options);
    const detail::LegendLayout layout = detail::lay_out(scene, options.width, options.height);
    int count = 0;
    for (int y = static_cast<int>(layout.bar.y + layout.bar.height) + 2; y < image.height; ++y) {
      for (int x = static_cast<int>(layout.bar.x); x < image.width; ++x) {
        const std::size_t at =
            4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                 static_cast<std::size_t>(x));
        bool is_grey = true;
        for (std::size_t k = 0; k < 3; ++k) {
          const double wanted = 255.0 * kNoValueColor[static_cast<Index>(k)];
          is_grey = is_grey && std::abs(image.rgba[at + k] - wanted) <= 0.5;
        }
        if (is_grey) ++count;
      }
    }
    const double side = layout.bar.width;
    return static_cast<double>(count) / (side * side);
  };
  EXPECT_LT(grey_pixels(), 0.05);
  scene.legend.no_value_label = "no size passes";
  EXPECT_NEAR(grey_pixels(), 1.0, 0.25);  // a side of 7.65 pixels is drawn as 8
}

}  // namespace
}  // namespace dupin
