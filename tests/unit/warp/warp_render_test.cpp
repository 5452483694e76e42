#include "dupin/warp/warp_render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "dupin/base/error.h"
#include "dupin/base/instruction_set.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/warp/pixel_filter.h"
#include "dupin/warp/warp_depth.h"

namespace dupin {
namespace {

using Eigen::Index;

// A grid of columns by rows cells of `cell` pixels, two triangles each, corner at (x, y).
PlanarMesh grid(int columns, int rows, double cell, double x = 0.0, double y = 0.0) {
  PlanarMesh mesh;
  mesh.points.resize(Index{columns + 1} * (rows + 1), 2);
  mesh.triangles.resize(Index{2} * columns * rows, 3);
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      mesh.points.row(Index{j} * (columns + 1) + i) << x + cell * i, y + cell * j;
    }
  }
  Index face = 0;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int a = j * (columns + 1) + i;
      const int b = a + columns + 1;
      mesh.triangles.row(face++) << a, a + 1, b + 1;
      mesh.triangles.row(face++) << a, b + 1, b;
    }
  }
  return mesh;
}

// Index of the first channel of a pixel.
std::size_t element(int width, int x, int y) {
  return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
              static_cast<std::size_t>(x));
}

Raster noise(int width, int height, int bit_depth, std::uint64_t seed = 1) {
  Raster raster = make_raster(width, height, bit_depth);
  Rng random(seed);
  for (std::uint8_t& v : raster.rgba8) v = static_cast<std::uint8_t>(random.uniform() * 255.99);
  for (std::uint16_t& v : raster.rgba16) v = static_cast<std::uint16_t>(random.uniform() * 65535.9);
  return raster;
}

// One colour as a function of the place of the pixel centre.
template <class Value>
Raster painted(int width, int height, const Value& value) {
  Raster raster = make_raster(width, height, 8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* const p = raster.rgba8.data() + element(width, x, y);
      const double v = value(x + 0.5, y + 0.5);
      p[0] = p[1] = p[2] = static_cast<std::uint8_t>(std::lround(v));
      p[3] = 255;
    }
  }
  return raster;
}

const std::uint8_t* pixel(const Raster& raster, int x, int y) {
  return raster.rgba8.data() + element(raster.width, x, y);
}

Points2 turned(const Points2& points, double angle_rad, double scale, double cx, double cy) {
  Points2 result = points;
  for (Index i = 0; i < points.rows(); ++i) {
    const double x = points(i, 0) - cx;
    const double y = points(i, 1) - cy;
    result.row(i) << cx + scale * (std::cos(angle_rad) * x - std::sin(angle_rad) * y),
        cy + scale * (std::sin(angle_rad) * x + std::cos(angle_rad) * y);
  }
  return result;
}

// The identity reads every pixel at its own centre, so it copies all four channels, also the colour
// of transparent pixels, whatever the corners of the mesh.
TEST(WarpRender, TheIdentityCopiesThePictureBitForBit) {
  for (const int depth : {8, 16}) {
    SCOPED_TRACE(depth);
    const Raster source = noise(97, 61, depth);
    const PlanarMesh mesh = grid(9, 7, 13.37, -3.1, -5.7);
    const WarpPicture picture = render_warp(source, mesh, mesh.points);
    EXPECT_EQ(picture.raster.rgba8, source.rgba8);
    EXPECT_EQ(picture.raster.rgba16, source.rgba16);
    EXPECT_EQ(picture.num_flipped, 0);
  }
}

// A mesh made on a picture of half the size is the same mesh when its unit is two pixels.
TEST(WarpRender, TheIdentityHoldsAtFullResolutionOfAnEditAtHalf) {
  const Raster source = noise(64, 48, 8);
  const PlanarMesh mesh = grid(4, 3, 8.0);
  WarpView view;
  view.source_scale = 2.0;
  view.target_scale = 2.0;
  EXPECT_EQ(render_warp(source, mesh, mesh.points, {}, view).raster.rgba8, source.rgba8);
}

// Moving by (5, -3) pixels moves the pixels.
TEST(WarpRender, WholePixelsAreCopied) {
  const Raster source = noise(40, 30, 16);
  const PlanarMesh mesh = grid(4, 3, 10.0);
  Points2 target = mesh.points;
  target.rowwise() += Eigen::RowVector2d(5.0, -3.0);
  const Raster moved = render_warp(source, mesh, target).raster;
  for (int y = 0; y < 27; ++y) {
    for (int x = 5; x < 40; ++x) {
      for (std::size_t k = 0; k < 4; ++k) {
        ASSERT_EQ(moved.rgba16[element(40, x, y) + k],
                  source.rgba16[element(40, x - 5, y + 3) + k]);
      }
    }
  }
}

// The sum over all triangles of their pixels is the number of pixels inside: none twice, none
// missed, for corners anywhere, on pixel centres and on pixel corners.
TEST(WarpRender, EveryPixelCentreBelongsToOneTriangle) {
  for (const double cell : {8.0, 7.5, 6.93}) {
    SCOPED_TRACE(cell);
    const PlanarMesh mesh = grid(6, 6, cell, 3.5, 3.5);
    Rng random(7);
    Points2 target = mesh.points;
    for (int j = 1; j < 6; ++j) {
      for (int i = 1; i < 6; ++i) {
        target(Index{j} * 7 + i, 0) += std::floor(5.0 * random.uniform()) * 0.5 - 1.0;
        target(Index{j} * 7 + i, 1) += std::floor(5.0 * random.uniform()) * 0.5 - 1.0;
      }
    }
    // Half transparent: a pixel painted twice would be more opaque, one left out transparent.
    Raster source = make_raster(60, 60, 8);
    std::fill(source.rgba8.begin(), source.rgba8.end(), std::uint8_t{128});
    const Raster out = render_warp(source, mesh, target).raster;
    const double end = 3.5 + 6.0 * cell;
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 60; ++x) {
        // Top and left borders are inclusive.
        const bool inside = x + 0.5 >= 3.5 && x + 0.5 < end && y + 0.5 >= 3.5 && y + 0.5 < end;
        ASSERT_EQ(pixel(out, x, y)[3], inside ? 128 : 0) << x << ", " << y;
      }
    }
  }
}

// Catmull-Rom interpolation reproduces quadratic functions; 8 bits round source and output, by half
// a step each, and the absolute weights of the kernel sum to at most 1.25^2.
TEST(WarpRender, AnAffineWarpOfARampIsThatRamp) {
  const auto ramp = [](double x, double y) { return 20.0 + 1.1 * x + 0.9 * y; };
  const Raster source = painted(100, 100, ramp);
  const PlanarMesh mesh = grid(5, 5, 18.0, 5.0, 5.0);
  const Points2 target = turned(mesh.points, 0.3, 1.1, 50.0, 50.0);
  const Raster out = render_warp(source, mesh, target).raster;
  int num_checked = 0;
  for (int y = 30; y < 70; ++y) {
    for (int x = 30; x < 70; ++x) {
      const double dx = (x + 0.5 - 50.0) / 1.1;
      const double dy = (y + 0.5 - 50.0) / 1.1;
      const double u = 50.0 + std::cos(0.3) * dx + std::sin(0.3) * dy;
      const double v = 50.0 - std::sin(0.3) * dx + std::cos(0.3) * dy;
      EXPECT_NEAR(pixel(out, x, y)[0], ramp(u, v), 0.5 + 0.5 * 1.25 * 1.25 + 0.01);
      ++num_checked;
    }
  }
  EXPECT_EQ(num_checked, 1600);
}

// Stripes of one pixel shrunk to a third have a period of 2/3 px: no output can show them, so it is
// their mean. Reading single pixels would give 0 or 255. The kernel widened three times passes
// less than 5 % of that frequency.
TEST(WarpRender, StripesThatShrinkBeyondThePixelsGreyOut) {
  const Raster source = painted(
      240, 240, [](double x, double) { return static_cast<int>(x) % 2 == 0 ? 0.0 : 255.0; });
  const PlanarMesh mesh = grid(6, 6, 40.0);
  for (const double angle : {0.0, 0.4}) {
    SCOPED_TRACE(angle);
    const Points2 target = turned(mesh.points, angle, 1.0 / 3.0, 120.0, 120.0);
    const Raster out = render_warp(source, mesh, target).raster;
    for (int y = 105; y < 135; ++y) {
      for (int x = 105; x < 135; ++x) EXPECT_NEAR(pixel(out, x, y)[0], 127.5, 13.0);
    }
  }
}

// A constant stays that constant at any shrinking: weights sum to one.
TEST(WarpRender, ConstantsAreKeptAtAnyScale) {
  const Raster source = painted(200, 200, [](double, double) { return 77.0; });
  const PlanarMesh mesh = grid(4, 4, 50.0);
  for (const double scale : {0.07, 0.3, 0.83, 0.95, 1.0, 1.7}) {
    SCOPED_TRACE(scale);
    const Raster out =
        render_warp(source, mesh, turned(mesh.points, 0.2, scale, 100.0, 100.0)).raster;
    for (int k = 0; k < 3; ++k) EXPECT_EQ(pixel(out, 100, 100)[k], 77);
    EXPECT_EQ(pixel(out, 100, 100)[3], 255);
  }
}

// Colours are weighted by alpha: red beside transparent green stays red, with falling alpha.
TEST(WarpRender, TransparentColoursDoNotBleed) {
  Raster source = make_raster(20, 20, 8);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      std::uint8_t* const p = source.rgba8.data() + element(20, x, y);
      p[0] = x < 10 ? 200 : 0;
      p[1] = x < 10 ? 0 : 255;
      p[3] = x < 10 ? 255 : 0;
    }
  }
  const PlanarMesh mesh = grid(2, 2, 10.0);
  Points2 target = mesh.points;
  target.rowwise() += Eigen::RowVector2d(0.5, 0.0);
  const Raster out = render_warp(source, mesh, target).raster;
  EXPECT_EQ(pixel(out, 10, 9)[0], 200);
  EXPECT_EQ(pixel(out, 10, 9)[1], 0);
  // Half way between 255 and 0: the kernel has -1/16 + 9/16 of its weight on each side.
  EXPECT_EQ(pixel(out, 10, 9)[3], 128);
}

// Two ropes that cross twice, over at one place and under at the other: at each crossing the rope
// with the larger depth covers the other one, pixel by pixel.
TEST(WarpRender, CrossingRopesLieInTheOrderOfTheirDepth) {
  // Rope 0 runs along x, rope 1 is a U that crosses it twice; colours are those of the source.
  Raster source = make_raster(64, 64, 8);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      std::uint8_t* const p = source.rgba8.data() + element(64, x, y);
      p[y < 32 ? 0 : 1] = 255;
      p[3] = 255;
    }
  }
  PlanarMesh mesh;
  mesh.points.resize(12, 2);
  mesh.points << 0, 0, 64, 0, 64, 8, 0, 8,  // rope 0: red
      0, 40, 32, 40, 32, 48, 0, 48,         // left leg of rope 1: green
      32, 40, 64, 40, 64, 48, 32, 48;       // right leg
  mesh.triangles.resize(6, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 8, 9, 10, 8, 10, 11;
  Points2 target = mesh.points;
  target.middleRows(0, 4) << 0, 28, 64, 28, 64, 36, 0, 36;
  target.middleRows(4, 4) << 20, 10, 20, 54, 12, 54, 12, 10;
  target.middleRows(8, 4) << 50, 10, 50, 54, 42, 54, 42, 10;
  Eigen::VectorXd depth(12);
  depth << 0, 0, 0, 0, 1, 1, 1, 1, -1, -1, -1, -1;
  const auto order = paint_order(mesh.triangles, depth);
  EXPECT_EQ(order, (std::vector<std::int32_t>{4, 5, 0, 1, 2, 3}));
  const Raster out = render_warp(source, mesh, target, order).raster;
  for (int y = 28; y < 36; ++y) {
    for (int x = 12; x < 20; ++x) EXPECT_EQ(pixel(out, x, y)[1], 255) << "left leg is over";
    for (int x = 42; x < 50; ++x) EXPECT_EQ(pixel(out, x, y)[0], 255) << "right leg is under";
  }
}

// The map tells where each pixel was read: an affine map gives its inverse to the rounding of
// float.
TEST(WarpMap, InvertsAnAffineWarp) {
  const PlanarMesh mesh = grid(5, 5, 18.0, 5.0, 5.0);
  const Points2 target = turned(mesh.points, 0.3, 1.1, 50.0, 50.0);
  WarpView view;
  view.width = 100;
  view.height = 100;
  const WarpMap map = warp_map(mesh, target, {}, view);
  for (int y = 30; y < 70; ++y) {
    for (int x = 30; x < 70; ++x) {
      const double dx = (x + 0.5 - 50.0) / 1.1;
      const double dy = (y + 0.5 - 50.0) / 1.1;
      const float* const uv = map.source_xy.data() + element(100, x, y) / 2;
      EXPECT_NEAR(uv[0], 50.0 + std::cos(0.3) * dx + std::sin(0.3) * dy, 1e-5);
      EXPECT_NEAR(uv[1], 50.0 - std::sin(0.3) * dx + std::cos(0.3) * dy, 1e-5);
    }
  }
  EXPECT_TRUE(std::isnan(map.source_xy[0]));
}

// A mirror turns every triangle over: its back is drawn, or nothing, and all are counted.
TEST(WarpRender, FlippedTrianglesShowTheirBackOrNothing) {
  const Raster source = noise(32, 32, 8);
  const PlanarMesh mesh = grid(4, 4, 8.0);
  Points2 target = mesh.points;
  target.col(0) = 32.0 - target.col(0).array();
  WarpPicture picture = render_warp(source, mesh, target);
  EXPECT_EQ(picture.num_flipped, 32);
  for (int x = 1; x < 31; ++x)
    EXPECT_EQ(pixel(picture.raster, x, 9)[0], pixel(source, 31 - x, 9)[0]);
  WarpView view;
  view.draw_flipped = false;
  picture = render_warp(source, mesh, target, {}, view);
  EXPECT_EQ(picture.raster.rgba8, std::vector<std::uint8_t>(4 * 32 * 32, 0));
}

// A triangle squeezed to a line or a point covers nothing; one of a hair's width reads only from
// its own part of the source.
TEST(WarpRender, SliversAreHarmless) {
  const Raster source = noise(32, 32, 8);
  const PlanarMesh mesh = grid(1, 1, 32.0);
  Points2 target = mesh.points;
  target.col(0).setConstant(5.0);
  EXPECT_EQ(render_warp(source, mesh, target).num_degenerate, 2);
  for (const double width : {1e-300, 1e-9, 0.003, 0.004, 0.02}) {
    target.col(0) = 5.5 + width * (mesh.points.col(0).array() / 32.0 - 0.5);
    const WarpPicture out = render_warp(source, mesh, target);
    EXPECT_EQ(out.status, Status::ok);
    // No pixel but those of the column that the hair lies in, where it may cover a centre.
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        if (x == 5) continue;
        EXPECT_EQ(pixel(out.raster, x, y)[3], 0) << x << " " << y << " " << width;
      }
    }
  }
}

// Alpha 128 of 255 over a white background: 255 (1 - a) + c a.
TEST(WarpRender, LaysThePictureOverABackground) {
  Raster source = make_raster(8, 8, 8);
  for (std::size_t i = 0; i < source.rgba8.size(); i += 4) {
    source.rgba8[i] = 100;
    source.rgba8[i + 3] = 128;
  }
  Raster white = make_raster(8, 8, 16);
  std::fill(white.rgba16.begin(), white.rgba16.end(), std::uint16_t{65535});
  const PlanarMesh mesh = grid(1, 1, 4.0);
  const Raster out = render_warp(source, mesh, mesh.points, {}, {}, &white).raster;
  EXPECT_EQ(pixel(out, 2, 2)[0], std::lround(255.0 * 127 / 255 + 100.0 * 128 / 255));
  EXPECT_EQ(pixel(out, 2, 2)[3], 255);
  EXPECT_EQ(pixel(out, 6, 6)[0], 255);
  EXPECT_EQ(out.bit_depth, 8);
}

// Transparent pixels around the source change nothing but the origin.
TEST(WarpRender, PaddingTheSourceChangesNothing) {
  const Raster source = noise(40, 40, 16);
  Raster padded = make_raster(60, 60, 16);
  for (std::size_t y = 0; y < 40; ++y) {
    std::copy_n(source.rgba16.begin() + static_cast<std::ptrdiff_t>(160 * y), 160,
                padded.rgba16.begin() + static_cast<std::ptrdiff_t>(4 * (60 * (y + 8) + 16)));
  }
  const PlanarMesh mesh = grid(4, 4, 10.0);
  PlanarMesh moved = mesh;
  moved.points.rowwise() += Eigen::RowVector2d(16.0, 8.0);
  const Points2 target = turned(mesh.points, 0.5, 0.9375, 20.0, 20.0);
  WarpView view;
  view.width = 48;
  view.height = 48;
  EXPECT_EQ(render_warp(source, mesh, target, {}, view).raster.rgba16,
            render_warp(padded, moved, target, {}, view).raster.rgba16);
}

// Bands are painted by whichever thread is free; what they paint does not depend on it.
TEST(WarpRender, IsTheSameForAnyNumberOfThreads) {
  const Raster source = noise(200, 150, 8);
  const PlanarMesh mesh = grid(20, 15, 10.0);
  Points2 target = mesh.points;
  Rng random(3);
  for (Index i = 0; i < target.size(); ++i) target.data()[i] += 9.0 * random.uniform();
  set_thread_count(1);
  const Raster one = render_warp(source, mesh, target).raster;
  for (const int threads : {2, 5}) {
    set_thread_count(threads);
    EXPECT_EQ(render_warp(source, mesh, target).raster.rgba8, one.rgba8);
  }
  set_thread_count(0);
}

// Sixteen bits of a picture whose 8-bit values are spread by 257 give the same picture to half a
// step of 8 bits.
TEST(WarpRender, DepthsAgree) {
  const Raster source = noise(64, 64, 8);
  const PlanarMesh mesh = grid(4, 4, 16.0);
  const Points2 target = turned(mesh.points, 0.4, 1.05, 32.0, 32.0);
  const Raster eight = render_warp(source, mesh, target).raster;
  const Raster sixteen = render_warp(with_bit_depth(source, 16), mesh, target).raster;
  for (std::size_t i = 0; i < eight.rgba8.size(); ++i) {
    ASSERT_NEAR(sixteen.rgba16[i] / 257.0, eight.rgba8[i], 0.51);
  }
}

TEST(WarpRender, CarriesTheColourProfile) {
  Raster source = noise(8, 8, 8);
  source.colour.icc = {1, 2, 3};
  source.colour.icc_name = "profile";
  const PlanarMesh mesh = grid(1, 1, 8.0);
  EXPECT_EQ(render_warp(source, mesh, mesh.points).raster.colour.icc, source.colour.icc);
}

TEST(WarpRender, RefusesWhatItCannotPaint) {
  const Raster source = noise(8, 8, 8);
  const PlanarMesh mesh = grid(1, 1, 8.0);
  const auto render = [&](const Points2& target, const std::vector<std::int32_t>& order,
                          const WarpView& view) { render_warp(source, mesh, target, order, view); };
  EXPECT_THROW(render(Points2(3, 2), {}, {}), InvalidArgument);
  EXPECT_THROW(render(mesh.points, {0}, {}), InvalidArgument);
  EXPECT_THROW(render(mesh.points, {0, 0}, {}), InvalidArgument);
  Points2 target = mesh.points;
  target(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(render(target, {}, {}), InvalidArgument);
  target(2, 1) = 1e9;
  EXPECT_THROW(render(target, {}, {}), InvalidArgument);
  WarpView view;
  view.width = 40000;
  EXPECT_THROW(render(mesh.points, {}, view), InvalidArgument);
  view = {};
  view.target_scale = 0.0;
  EXPECT_THROW(render(mesh.points, {}, view), InvalidArgument);
  const Raster background = make_raster(9, 8, 8);
  view = {};
  view.width = 8;
  view.height = 8;
  EXPECT_THROW(render_warp(source, mesh, mesh.points, {}, view, &background), InvalidArgument);
}

TEST(WarpRender, CancelledRunsGiveNoPicture) {
  const Raster source = noise(8, 8, 8);
  const PlanarMesh mesh = grid(1, 1, 8.0);
  const RunControl run = RunControl::create();
  run.cancel();
  const WarpPicture picture = render_warp(source, mesh, mesh.points, {}, {}, nullptr, run);
  EXPECT_EQ(picture.status, Status::cancelled);
  EXPECT_EQ(picture.raster.width, 0);
  WarpView view;
  view.width = 8;
  view.height = 8;
  EXPECT_EQ(warp_map(mesh, mesh.points, {}, view, run).status, Status::cancelled);
}

#ifdef DUPIN_X86
template <class T>
DUPIN_AVX2 detail::Colour read_with_avx2(const detail::PixelReader<T>& reader, double u, double v,
                                         const detail::FilterShape& shape) {
  return reader.read_avx2(u, v, shape);
}

template <class T>
int num_different(const std::vector<T>& pixels, int width, int height) {
  const detail::PixelReader<T> reader(pixels, width, height);
  Rng rng(31);
  int count = 0;
  for (int i = 0; i < 4000; ++i) {
    detail::RasterTriangle triangle;
    // From enlarging to shrinking by far more than the kernel is widened, and turned.
    const double strength = std::pow(10.0, 3.0 * rng.uniform() - 1.5);
    for (double& slope : triangle.slope) slope = strength * (rng.uniform() - 0.5);
    const detail::FilterShape shape = detail::filter_shape(triangle);
    const double u = (width + 20) * rng.uniform() - 10.0;
    const double v = (height + 20) * rng.uniform() - 10.0;
    const detail::Colour expected = reader.read(u, v, shape);
    const detail::Colour actual = read_with_avx2(reader, u, v, shape);
    count += std::memcmp(&expected, &actual, sizeof(expected)) == 0 ? 0 : 1;
  }
  return count;
}

// Machines with AVX2 read two rows or eight weights at a time, and get the bits of all others:
// inside, across the border and beyond it, for every kind of filter.
TEST(PixelReader, InstructionSetsGiveTheSameBits) {
  if (instruction_set() == InstructionSet::base) return;
  Rng rng(30);
  std::vector<std::uint8_t> eight(4 * 40 * 30);
  std::vector<std::uint16_t> sixteen(4 * 40 * 30);
  for (std::size_t i = 0; i < eight.size(); ++i) {
    // Alpha is often none or full, as in cut-outs.
    const double value =
        i % 4 == 3 ? std::clamp(3.0 * rng.uniform() - 1.0, 0.0, 1.0) : rng.uniform();
    eight[i] = static_cast<std::uint8_t>(255.0 * value);
    sixteen[i] = static_cast<std::uint16_t>(65535.0 * value);
  }
  EXPECT_EQ(num_different(eight, 40, 30), 0);
  EXPECT_EQ(num_different(sixteen, 40, 30), 0);
}
#endif

}  // namespace
}  // namespace dupin
