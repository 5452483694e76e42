#include "dupin/warp/shape_from_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/random.h"

namespace dupin {
namespace {

using Eigen::Index;

std::size_t alpha_at(int width, int x, int y) {
  return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
              static_cast<std::size_t>(x)) +
         3;
}

// Alpha as a function of the place of the pixel centre, in [0, 1].
Raster cut_out(int width, int height, const std::function<double(double, double)>& alpha) {
  Raster raster = make_raster(width, height, 8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      raster.rgba8[alpha_at(width, x, y)] =
          static_cast<std::uint8_t>(std::lround(255.0 * alpha(x + 0.5, y + 0.5)));
    }
  }
  return raster;
}

Raster random_mask(int width, int height, double share, std::uint64_t seed) {
  Rng random(seed);
  return cut_out(width, height,
                 [&](double, double) { return random.uniform() < share ? 1.0 : 0.0; });
}

std::int64_t num_inside(const Raster& raster) {
  std::int64_t count = 0;
  for (std::size_t i = 3; i < raster.rgba8.size(); i += 4) count += raster.rgba8[i] >= 128 ? 1 : 0;
  return count;
}

ShapeOptions all_of_it(ContourKind contour) {
  ShapeOptions options;
  options.parts = ShapeParts::all;
  options.contour = contour;
  options.minimum_area = 1.0;
  options.minimum_hole_area = 1.0;
  return options;
}

// Whether no two edges of the outline meet, but for neighbours at their corner: by trying all
// pairs.
bool is_simple(const Outline& outline) {
  struct Edge {
    Eigen::RowVector2d a, b;
    std::size_t loop;
    Index index, size;
  };
  std::vector<Edge> edges;
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    const Points2& loop = outline.loops[l];
    for (Index i = 0; i < loop.rows(); ++i)
      edges.push_back({loop.row(i), loop.row((i + 1) % loop.rows()), l, i, loop.rows()});
  }
  const auto side = [](const auto& a, const auto& b, const auto& c) {
    const double v = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
    return v > 0.0 ? 1 : (v < 0.0 ? -1 : 0);
  };
  const auto boxes_meet = [](const Edge& s, const Edge& t) {
    return std::min(s.a.x(), s.b.x()) <= std::max(t.a.x(), t.b.x()) &&
           std::min(t.a.x(), t.b.x()) <= std::max(s.a.x(), s.b.x()) &&
           std::min(s.a.y(), s.b.y()) <= std::max(t.a.y(), t.b.y()) &&
           std::min(t.a.y(), t.b.y()) <= std::max(s.a.y(), s.b.y());
  };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    for (std::size_t j = i + 1; j < edges.size(); ++j) {
      const Edge& s = edges[i];
      const Edge& t = edges[j];
      const bool are_neighbours = s.loop == t.loop && ((s.index + 1) % s.size == t.index ||
                                                       (t.index + 1) % t.size == s.index);
      if (are_neighbours || !boxes_meet(s, t)) continue;
      if (side(s.a, s.b, t.a) * side(s.a, s.b, t.b) <= 0 &&
          side(t.a, t.b, s.a) * side(t.a, t.b, s.b) <= 0)
        return false;
    }
  }
  return true;
}

// Along the edges of the pixels the outline encloses them, each once.
TEST(ShapeFromImage, PixelEdgesEncloseEveryPixelOnce) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const Raster mask = random_mask(23, 17, 0.1 + 0.02 * static_cast<double>(seed), seed);
    const ImageShape shape = shape_from_image(mask, all_of_it(ContourKind::pixel_edges));
    EXPECT_EQ(signed_area(shape.outline), static_cast<double>(num_inside(mask)));
    double sum = 0.0;
    for (const double area : shape.part_areas) sum += area;
    EXPECT_EQ(sum, static_cast<double>(num_inside(mask)));
    EXPECT_TRUE(std::is_sorted(shape.part_areas.rbegin(), shape.part_areas.rend()));
  }
}

// Marching squares at a half cut 1/8 off each convex corner of a mask and add it at each concave
// one; a loop of right angles has four more convex than concave ones, a hole four fewer. All is in
// eighths, so the sum is exact.
TEST(ShapeFromImage, SubPixelLoopsEncloseThePixelsLessHalfTheEulerNumber) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const Raster mask = random_mask(23, 17, 0.1 + 0.02 * static_cast<double>(seed), seed);
    const ImageShape shape = shape_from_image(mask, all_of_it(ContourKind::sub_pixel));
    const auto euler = static_cast<double>(shape.num_parts - shape.num_holes);
    EXPECT_EQ(signed_area(shape.outline), static_cast<double>(num_inside(mask)) - euler / 2.0);
    EXPECT_TRUE(is_simple(shape.outline));
    validate(shape.outline);
  }
}

// Also of noise in alpha, with values at the threshold itself, loops never meet.
TEST(ShapeFromImage, SubPixelLoopsAreSimpleAndDisjoint) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    Rng random(seed);
    const Raster mask =
        cut_out(20, 20, [&](double, double) { return static_cast<double>(random.below(5)) / 4.0; });
    ShapeOptions options = all_of_it(ContourKind::sub_pixel);
    for (const double threshold : {0.0, 127.0 / 255.0, 0.5, 128.0 / 255.0, 0.99}) {
      options.alpha_threshold = threshold;
      EXPECT_TRUE(is_simple(shape_from_image(mask, options).outline)) << threshold;
    }
  }
}

// A half plane whose alpha falls linearly over four pixels: the outline is where it is a half.
TEST(ShapeFromImage, TheOutlineOfARampIsWhereAlphaPassesTheThreshold) {
  for (const double place : {20.0, 20.3, 20.77}) {
    const Raster ramp = cut_out(
        40, 40, [&](double x, double) { return std::clamp(0.5 - (x - place) / 4.0, 0.0, 1.0); });
    const Points2 loop = shape_from_image(ramp).outline.loops.at(0);
    int num_on_ramp = 0;
    for (Index i = 0; i < loop.rows(); ++i) {
      if (loop(i, 0) < 10.0 || loop(i, 1) < 2.0 || loop(i, 1) > 38.0) continue;
      // Alpha is rounded to 1/255, twice half a step over a slope of 1/4.
      EXPECT_NEAR(loop(i, 0), place, 4.0 / 255.0);
      ++num_on_ramp;
    }
    EXPECT_GE(num_on_ramp, 35);
  }
}

// A disk drawn with a soft edge: the area is that of the disk, and chords lose O(1/r) of it.
TEST(ShapeFromImage, TheAreaOfADiskConverges) {
  double error = 1.0;
  for (const double r : {20.0, 40.0, 80.0}) {
    const Raster disk = cut_out(200, 200, [&](double x, double y) {
      return std::clamp(0.5 + r - std::hypot(x - 100.3, y - 99.8), 0.0, 1.0);
    });
    const double area = signed_area(shape_from_image(disk).outline);
    const double now = std::abs(area / (M_PI * r * r) - 1.0);
    EXPECT_LT(now, 0.5 / r);
    EXPECT_LT(now, error);
    error = now;
  }
}

// A square with a hole and an island in the hole, and a speck.
Raster three_parts() {
  return cut_out(60, 60, [](double x, double y) {
    const double d = std::max(std::abs(x - 30.0), std::abs(y - 30.0));
    return (d < 25.0 && d > 15.0) || d < 6.0 || (x < 2.0 && y < 2.0) ? 1.0 : 0.0;
  });
}

TEST(ShapeFromImage, PartsAreNumberedByFallingAreaWithTheirHoles) {
  ShapeOptions options = all_of_it(ContourKind::pixel_edges);
  options.minimum_area = 16.0;
  const ImageShape shape = shape_from_image(three_parts(), options);
  ASSERT_EQ(shape.outline.loops.size(), 3U);
  EXPECT_EQ(shape.outline.component, (std::vector<std::int32_t>{0, 0, 1}));
  EXPECT_EQ(signed_area(shape.outline.loops[0]), 2500.0);
  EXPECT_EQ(signed_area(shape.outline.loops[1]), -900.0);
  EXPECT_EQ(signed_area(shape.outline.loops[2]), 144.0);
  EXPECT_EQ(shape.part_areas, (std::vector<double>{1600.0, 144.0}));
  EXPECT_EQ(shape.num_parts, 2);
  EXPECT_EQ(shape.num_holes, 1);
  EXPECT_TRUE(shape.warnings.contains("W_COMPONENTS"));
  EXPECT_TRUE(shape.warnings.contains("W_SPECK"));
}

TEST(ShapeFromImage, OnlyTheLargestPartIsKeptUnlessAllAreWanted) {
  ShapeOptions options;
  ImageShape shape = shape_from_image(three_parts(), options);
  EXPECT_EQ(shape.outline.loops.size(), 2U);
  EXPECT_EQ(shape.num_parts, 2);
  options.keep_holes = false;
  shape = shape_from_image(three_parts(), options);
  ASSERT_EQ(shape.outline.loops.size(), 1U);
  EXPECT_EQ(shape.part_areas, (std::vector<double>{2500.0}));
}

// Counting and measuring needs no outline: all numbers are those with it, to the bit.
TEST(ShapeFromImage, NumbersDoNotNeedTheOutline) {
  for (const double expansion : {0.0, 2.0}) {
    ShapeOptions options;
    options.parts = ShapeParts::all;
    options.minimum_area = 3.0;
    options.minimum_hole_area = 2.0;
    options.expansion_px = expansion;
    const Raster mask = random_mask(90, 70, 0.55, 21);
    const ImageShape whole = shape_from_image(mask, options);
    options.keep_outline = false;
    const ImageShape numbers = shape_from_image(mask, options);
    EXPECT_FALSE(whole.outline.loops.empty());
    EXPECT_TRUE(numbers.outline.loops.empty());
    EXPECT_EQ(numbers.area, signed_area(whole.outline));
    EXPECT_EQ(whole.area, numbers.area);
    EXPECT_EQ(numbers.part_areas, whole.part_areas);
    EXPECT_EQ(numbers.num_parts, whole.num_parts);
    EXPECT_EQ(numbers.num_holes, whole.num_holes);
    ASSERT_EQ(numbers.warnings.all().size(), whole.warnings.all().size());
    for (std::size_t i = 0; i < whole.warnings.all().size(); ++i) {
      EXPECT_EQ(numbers.warnings.all()[i].count, whole.warnings.all()[i].count);
      EXPECT_EQ(numbers.warnings.all()[i].first, whole.warnings.all()[i].first);
    }
  }
}

TEST(ShapeFromImage, SmallHolesAreClosedAndCounted) {
  const Raster mask = cut_out(30, 30, [](double x, double y) {
    const bool is_hole = std::abs(x - 15.0) < 1.0 && std::abs(y - 15.0) < 1.0;
    return x > 5.0 && x < 25.0 && y > 5.0 && y < 25.0 && !is_hole ? 1.0 : 0.0;
  });
  const ImageShape shape = shape_from_image(mask);
  EXPECT_EQ(shape.num_holes, 0);
  EXPECT_EQ(shape.part_areas, (std::vector<double>{400.0}));
  EXPECT_TRUE(shape.warnings.contains("W_HOLE_CLOSED"));
}

bool is_moved(const Outline& a, const Outline& b, double dx, double dy) {
  if (a.loops.size() != b.loops.size() || a.component != b.component) return false;
  for (std::size_t l = 0; l < a.loops.size(); ++l) {
    if (a.loops[l].rows() != b.loops[l].rows()) return false;
    for (Index i = 0; i < a.loops[l].rows(); ++i) {
      if (a.loops[l](i, 0) + dx != b.loops[l](i, 0) || a.loops[l](i, 1) + dy != b.loops[l](i, 1))
        return false;
    }
  }
  return true;
}

// Beyond the picture all is transparent, so padding moves the outline, bit for bit, expanded or
// not.
TEST(ShapeFromImage, PaddingMovesTheOutline) {
  Rng random(5);
  const Raster mask = cut_out(30, 20, [&](double, double) { return random.uniform(); });
  Raster padded = make_raster(50, 40, 8);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x)
      padded.rgba8[alpha_at(50, x + 13, y + 7)] = mask.rgba8[alpha_at(30, x, y)];
  }
  for (const double expansion : {0.0, 2.0, 3.7}) {
    ShapeOptions options = all_of_it(ContourKind::sub_pixel);
    options.expansion_px = expansion;
    const Outline outline = shape_from_image(mask, options).outline;
    EXPECT_TRUE(is_moved(outline, shape_from_image(padded, options).outline, 13.0, 7.0));
  }
}

// 16 bits that hold v * 257 have the alpha of 8 bits that hold v, also at the threshold.
TEST(ShapeFromImage, DepthsGiveTheSameOutline) {
  Rng random(6);
  const Raster mask = cut_out(30, 20, [&](double, double) { return random.uniform(); });
  for (const double threshold : {0.0, 0.2, 0.5, 51.0 / 255.0, 0.9}) {
    ShapeOptions options = all_of_it(ContourKind::sub_pixel);
    options.alpha_threshold = threshold;
    EXPECT_TRUE(is_moved(shape_from_image(mask, options).outline,
                         shape_from_image(with_bit_depth(mask, 16), options).outline, 0.0, 0.0));
  }
}

// The points at most e from a square of side s have the area s^2 + 4 s e + pi e^2; its pixels are
// reached from their centres, so corners are about half a pixel rounder: within a pixel of border.
TEST(ShapeFromImage, ExpansionMovesTheOutlineOutward) {
  const Raster square = cut_out(100, 100, [](double x, double y) {
    return x > 0.0 && x < 40.0 && y > 30.0 && y < 70.0 ? 1.0 : 0.0;
  });
  for (const double e : {1.0, 2.0, 5.5, 30.0}) {
    SCOPED_TRACE(e);
    ShapeOptions options;
    options.expansion_px = e;
    const ImageShape shape = shape_from_image(square, options);
    EXPECT_TRUE(is_simple(shape.outline));
    const double expected = 1600.0 + 160.0 * e + M_PI * e * e;
    EXPECT_NEAR(signed_area(shape.outline), expected, 0.02 * expected);
    // To the left the square ends at x = 0, and the outline leaves the picture.
    EXPECT_NEAR(shape.outline.loops[0].col(0).minCoeff(), -e, 0.02);
    EXPECT_NEAR(shape.outline.loops[0].col(1).maxCoeff(), 70.0 + e, 0.02);
  }
}

TEST(ShapeFromImage, PixelsThatMeetAtACornerStayApart) {
  const Raster mask =
      cut_out(16, 16, [](double x, double y) { return (x < 8.0) == (y < 8.0) ? 1.0 : 0.0; });
  const ImageShape shape = shape_from_image(mask, all_of_it(ContourKind::sub_pixel));
  EXPECT_EQ(shape.num_parts, 2);
  EXPECT_TRUE(shape.warnings.contains("W_NONMANIFOLD_VERTEX"));
  EXPECT_EQ(shape.warnings.all().back().first, "corner (8, 8)");
}

TEST(ShapeFromImage, ALineOfPixelsIsThin) {
  const Raster line = cut_out(32, 8, [](double, double y) { return y > 3 && y < 4 ? 1.0 : 0.0; });
  EXPECT_TRUE(shape_from_image(line).warnings.contains("W_THIN_SHAPE"));
  const Raster band = cut_out(32, 8, [](double, double y) { return y > 3 && y < 5 ? 1.0 : 0.0; });
  EXPECT_TRUE(shape_from_image(band).warnings.empty());
}

std::string code_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.code();
  }
  return {};
}

TEST(ShapeFromImage, SaysWhyThereIsNoShape) {
  const auto code = [](double alpha, const ShapeOptions& options = {}) {
    return code_of(
        [&] { shape_from_image(cut_out(9, 9, [&](double, double) { return alpha; }), options); });
  };
  EXPECT_EQ(code(1.0), "E_NO_ALPHA");
  EXPECT_EQ(code(0.0), "E_EMPTY_SHAPE");
  EXPECT_EQ(code(0.4), "E_EMPTY_SHAPE");
  ShapeOptions options;
  options.opaque_is_shape = true;
  EXPECT_EQ(code(1.0, options), "");
  const Raster dot = cut_out(9, 9, [](double x, double y) { return x < 1 && y < 1 ? 1.0 : 0.0; });
  EXPECT_EQ(code_of([&] { shape_from_image(dot); }), "E_SHAPE_TOO_SMALL");
}

TEST(ShapeFromImage, RefusesOptionsOutOfRange) {
  const Raster image = three_parts();
  const auto code = [&](const std::function<void(ShapeOptions&)>& set) {
    ShapeOptions options;
    set(options);
    return code_of([&] { shape_from_image(image, options); });
  };
  EXPECT_EQ(code([](ShapeOptions& o) { o.alpha_threshold = 1.0; }), "E_OPTION");
  EXPECT_EQ(code([](ShapeOptions& o) { o.alpha_threshold = -0.1; }), "E_OPTION");
  EXPECT_EQ(code([](ShapeOptions& o) { o.expansion_px = 300.0; }), "E_OPTION");
  EXPECT_EQ(code([](ShapeOptions& o) { o.minimum_area = 0.0; }), "E_OPTION");
  EXPECT_EQ(code([](ShapeOptions& o) { o.minimum_hole_area = 0.5; }), "E_OPTION");
}

TEST(ShapeFromImage, CancelledRunsGiveNoOutline) {
  const RunControl run = RunControl::create();
  run.cancel();
  const ImageShape shape = shape_from_image(three_parts(), {}, run);
  EXPECT_EQ(shape.status, Status::cancelled);
  EXPECT_TRUE(shape.outline.loops.empty());
}

Points2 polyline(std::initializer_list<std::pair<double, double>> corners) {
  Points2 points(static_cast<Index>(corners.size()), 2);
  Index i = 0;
  for (const auto& [x, y] : corners) points.row(i++) << x, y;
  return points;
}

TEST(OutlineFromPolyline, IsTurnedAndItsRepeatedPointsAreDropped) {
  const PolylineOutline result =
      outline_from_polyline(polyline({{0, 0}, {0, 10}, {0, 10}, {10, 10}, {10, 0}, {0, 0}}));
  ASSERT_EQ(result.outline.loops.size(), 1U);
  EXPECT_EQ(signed_area(result.outline.loops[0]), 100.0);
  EXPECT_EQ(result.corner, (std::vector<Index>{4, 3, 1, 0}));
  EXPECT_TRUE(result.warnings.contains("W_REPEATED_POINT"));
  EXPECT_TRUE(result.warnings.contains("W_ORIENTATION_FIXED"));
  EXPECT_TRUE(outline_from_polyline(polyline({{0, 0}, {10, 0}, {10, 10}})).warnings.empty());
}

TEST(OutlineFromPolyline, ACrossingIsRefusedWithItsEdgesAndPlace) {
  const auto message = [](const Points2& points) {
    try {
      outline_from_polyline(points);
    } catch (const AnalysisError& error) {
      return error.code() + " " + error.what();
    }
    return std::string();
  };
  EXPECT_EQ(message(polyline({{0, 0}, {10, 10}, {10, 0}, {0, 10}})),
            "E_OUTLINE_CROSSED edge 0 (points 0 and 1) meets edge 2 (points 2 and 3) at (5, 5)");
  // A corner on another edge, an edge back along the one before, two edges along each other.
  EXPECT_NE(message(polyline({{0, 0}, {10, 0}, {10, 10}, {5, 0}, {0, 10}})), "");
  EXPECT_NE(message(polyline({{0, 0}, {10, 0}, {5, 0}, {5, 10}})), "");
  EXPECT_NE(message(polyline({{0, 0}, {10, 0}, {10, 5}, {8, 5}, {8, 0}, {2, 0}, {2, 5}})), "");
  EXPECT_NE(message(polyline({{0, 0}, {10, 0}, {0, 0}, {10, 0}})), "");
  EXPECT_EQ(message(polyline({{0, 0}, {10, 0}, {20, 0}, {20, 10}, {0, 10}})), "");
}

TEST(OutlineFromPolyline, RefusesWhatEnclosesNothing) {
  EXPECT_EQ(code_of([] {
              outline_from_polyline(polyline({{0, 0}, {1, 0}}));
            }),
            "E_SHAPE_TOO_SMALL");
  EXPECT_EQ(code_of([] {
              outline_from_polyline(
                  polyline({{0, 0}, {1, std::numeric_limits<double>::infinity()}, {1, 1}}));
            }),
            "E_OPTION");
}

}  // namespace
}  // namespace dupin
