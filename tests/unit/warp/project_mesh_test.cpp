#include "dupin/warp/project_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/project_stages.h"
#include "dupin/warp/sha256.h"
#include "dupin/warp/warp_render.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr int kWidth = 150;
constexpr int kHeight = 120;

// A disc with a hole and, apart from it, a bar; hard edges, every pixel of another colour,
// transparent ones black.
Raster disc_and_bar() {
  Raster raster = make_raster(kWidth, kHeight, 8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double from_middle = std::hypot(x + 0.5 - 60.0, y + 0.5 - 60.0);
      const bool is_bar = x >= 120 && x < 130 && y >= 30 && y < 90;
      if (!is_bar && (from_middle > 45.0 || from_middle < 12.0)) continue;
      std::uint8_t* pixel = &raster.rgba8[4 * static_cast<std::size_t>(y * kWidth + x)];
      pixel[0] = static_cast<std::uint8_t>(x);
      pixel[1] = static_cast<std::uint8_t>(y);
      pixel[2] = static_cast<std::uint8_t>((7 * x + 13 * y) % 256);
      pixel[3] = 255;
    }
  }
  return raster;
}

WarpProject project_for(const Raster& raster) {
  WarpProject project;
  project.image = {"a.png", sha256_hex(""), raster.width, raster.height};
  project.contour.all_components = true;
  project.mesh.triangles = 600;
  return project;
}

WarpPin pin_at(double x, double y, double to_x, double to_y) {
  WarpPin pin;
  pin.source << x, y;
  pin.target << to_x, to_y;
  return pin;
}

struct Warped {
  ProjectMesh mesh;
  Deformation deformation;
  Raster raster;
};

Warped warped(const WarpProject& project, const Raster& raster) {
  Warped made;
  made.mesh = make_project_mesh(project, raster);
  made.deformation = deform(made.mesh.meshed.mesh, stages_of(project, made.mesh.anchors),
                            deform_options_of(project));
  made.raster = render_warp(raster, made.mesh.meshed.mesh, made.deformation.points,
                            made.deformation.paint_order)
                    .raster;
  return made;
}

// Four pins on the disc and one on the bar, off the pixel grid, moved by (dx, dy).
std::vector<WarpPin> pins_moved_by(double dx, double dy) {
  std::vector<WarpPin> pins;
  for (const auto& [x, y] :
       {std::pair(30.3, 50.7), {91.1, 60.2}, {60.9, 25.4}, {61.7, 98.6}, {125.2, 60.1}})
    pins.push_back(pin_at(x, y, x + dx, y + dy));
  return pins;
}

// Closed form: a lattice triangle of side h covers sqrt(3) / 4 h^2. The border of a large square
// changes the number by a share of perimeter h / area, which is 10 % here.
TEST(ProjectMesh, SpacingGivesTheWantedNumberOfTriangles) {
  EXPECT_NEAR(spacing_for(1e6, 1e6 / (std::sqrt(3.0) / 4.0)), 1.0, 1e-12);
  EXPECT_EQ(spacing_for(1.0, 1e6), 0.5);
  EXPECT_EQ(spacing_for(1e15, 16.0), 16384.0);
  Raster square = make_raster(400, 400, 8);
  for (std::size_t i = 3; i < square.rgba8.size(); i += 4) square.rgba8[i] = 255;
  square.rgba8[3] = 0;
  for (const int wanted : {600, 2500, 10000}) {
    WarpProject project = project_for(square);
    project.mesh.triangles = wanted;
    const ProjectMesh mesh = make_project_mesh(project, square);
    EXPECT_NEAR(static_cast<double>(mesh.meshed.mesh.triangles.rows()), wanted, 0.1 * wanted);
    project.mesh.spacing = 25.0;
    EXPECT_EQ(make_project_mesh(project, square).spacing_px, 25.0);
  }
}

// The thesis's 7.4.1 takes the largest part; what is left out is told with its area.
TEST(ProjectMesh, TakesTheShapeThatTheSettingsSay) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  const ProjectMesh all = make_project_mesh(project, raster);
  EXPECT_EQ(all.shape.part_areas.size(), 2U);
  EXPECT_EQ(all.shape.num_left_out, 0);
  EXPECT_EQ(all.shape.num_holes, 1);
  project.contour.all_components = false;
  const ProjectMesh largest = make_project_mesh(project, raster);
  EXPECT_EQ(largest.shape.part_areas.size(), 1U);
  EXPECT_EQ(largest.shape.num_left_out, 1);
  EXPECT_EQ(largest.shape.left_out_area, 600.0);
  EXPECT_TRUE(largest.warnings.contains("W_COMPONENTS"));
  project.contour.keep_holes = false;
  EXPECT_EQ(make_project_mesh(project, raster).shape.num_holes, 0);
  // Outward by 2 px and by 5 px: the disc of radius 45 grows by a ring, to half a pixel.
  const auto area_of = [&](double expansion) {
    project.contour.expansion = expansion;
    return signed_area(make_project_mesh(project, raster).shape.outline);
  };
  EXPECT_NEAR(area_of(5.0) - area_of(2.0), std::numbers::pi * (50.0 * 50.0 - 47.0 * 47.0),
              2.0 * std::numbers::pi * 50.0 * 0.5);
}

// Pins at rest become vertices, held where they are to the grid of the mesher.
TEST(ProjectMesh, PinsAtRestAreVertices) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  project.stages = {{StageMode::fine, {}}, {StageMode::coarse, pins_moved_by(3.0, 1.0)}};
  const ProjectMesh mesh = make_project_mesh(project, raster);
  ASSERT_EQ(mesh.anchors.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(mesh.anchors[i].has_value());
    EXPECT_EQ(mesh.anchors[i]->weights.maxCoeff(), 1.0);
    const Eigen::Vector2d place =
        position(mesh.meshed.mesh.points, mesh.meshed.mesh.triangles, *mesh.anchors[i]);
    EXPECT_LE((place.transpose() - project.stages[1].pins[i].source).cwiseAbs().maxCoeff(),
              std::ldexp(1.0, -16));
  }
  const auto stages = stages_of(project, mesh.anchors);
  EXPECT_FALSE(stages[1].pins[0].anchor->weights.isZero());
  EXPECT_THROW(stages_of(project, {std::nullopt}), InvalidArgument);
}

// Pins that do not move leave the cut-out as it is, to the last bit, whatever the method.
TEST(ProjectMesh, PinsAtRestGiveTheCutOutBitForBit) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  EXPECT_EQ(warped(project, raster).raster.rgba8, raster.rgba8);
  project.stages = {{StageMode::coarse, pins_moved_by(0.0, 0.0)}};
  for (const WarpMethod method : {WarpMethod::arap, WarpMethod::mls, WarpMethod::image_mls}) {
    project.deformation.method = method;
    const Warped made = warped(project, raster);
    EXPECT_EQ(made.raster.rgba8, raster.rgba8);
    EXPECT_TRUE(made.deformation.quality.flipped.empty());
  }
}

// All pins moved by whole pixels: the picture moved, bit for bit.
TEST(ProjectMesh, ATranslationOfAllPinsMovesThePicture) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  constexpr int kRight = 7;
  constexpr int kDown = -4;
  project.stages = {{StageMode::coarse, pins_moved_by(kRight, kDown)}};
  const Warped made = warped(project, raster);
  Raster expected = make_raster(kWidth, kHeight, 8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x - kRight < 0 || y - kDown >= kHeight) continue;
      for (int k = 0; k < 4; ++k)
        expected.rgba8[static_cast<std::size_t>(4 * (y * kWidth + x) + k)] =
            raster.rgba8[static_cast<std::size_t>(4 * ((y - kDown) * kWidth + x - kRight) + k)];
    }
  }
  EXPECT_EQ(made.raster.rgba8, expected.rgba8);
}

// Rigid motions of all pins are rigid motions of every part that has two of them.
TEST(ProjectMesh, ARotationOfAllPinsTurnsTheMesh) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  project.contour.all_components = false;
  const double angle = 0.7;
  Eigen::Matrix2d turn;
  turn << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  const Eigen::Vector2d middle(60.0, 60.0);
  WarpStage stage;
  for (WarpPin pin : pins_moved_by(0.0, 0.0)) {
    if (pin.source.x() > 110.0) continue;  // the bar is not there
    pin.target = (turn * (pin.source.transpose() - middle) + middle).transpose();
    stage.pins.push_back(pin);
  }
  // A target says its angle, in degrees from x towards y.
  stage.pins[0].rotation_deg = angle * 180.0 / std::numbers::pi;
  project.stages = {stage};
  const Warped made = warped(project, raster);
  const Points2 rest = made.mesh.meshed.mesh.points;
  for (Index v = 0; v < rest.rows(); ++v) {
    const Eigen::Vector2d expected = turn * (rest.row(v).transpose() - middle) + middle;
    // The anchors lie up to 2^-16 px beside the pins.
    ASSERT_LE((made.deformation.points.row(v).transpose() - expected).norm(), 1e-4) << v;
  }
}

// Each kind of pin acts in its kind of stage; loops are closed polygons of their own.
TEST(ProjectStages, TakeThePinsOfTheirKindAndCloseEveryLoop) {
  WarpProject project;
  WarpStage coarse{StageMode::coarse, {pin_at(1, 2, 3, 4), pin_at(5, 6, 7, 8), pin_at(9, 9, 9, 9)}};
  coarse.pins[0].kind = PinKind::exterior;
  coarse.pins[1].rotation_deg = 90.0;
  coarse.pins[2].name = "hem";
  WarpStage fine{StageMode::fine, {}};
  for (int i = 0; i < 6; ++i) {
    fine.pins.push_back(pin_at(i, 0, i, 1));
    fine.pins.back().kind = PinKind::exterior;
    fine.pins.back().loop = i % 2 == 0 ? 4 : 0;
  }
  fine.pins.push_back(pin_at(8, 0, 8, 1));
  fine.pins.back().kind = PinKind::exterior;
  fine.pins.back().loop = 9;
  fine.pins.push_back(pin_at(7, 7, 7, 7));
  project.stages = {coarse, fine};

  const std::vector<DeformStage> stages = stages_of(project);
  ASSERT_EQ(stages.size(), 2U);
  EXPECT_EQ(stages[0].mode, DeformMode::coarse);
  ASSERT_EQ(stages[0].pins.size(), 2U);
  EXPECT_EQ(stages[0].pins[0].name, "1 of stage 0");
  EXPECT_EQ(stages[0].pins[1].name, "hem");
  EXPECT_NEAR(*stages[0].pins[0].rotation, std::numbers::pi / 2.0, 1e-15);
  EXPECT_FALSE(stages[0].pins[1].rotation);
  EXPECT_TRUE(stages[0].lines.empty());
  ASSERT_EQ(stages[1].pins.size(), 7U);
  std::string lines;
  for (const ControlLine& line : stages[1].lines)
    lines += std::to_string(line.first) + std::to_string(line.second) + " ";
  EXPECT_EQ(lines, "13 35 51 02 24 40 66 ");
  const WarningList warnings = ignored_pins(project);
  ASSERT_EQ(warnings.all().size(), 1U);
  EXPECT_EQ(warnings.all()[0].count, 2);
}

// A part of the control polygon that moves takes the border beside it along, and the other loop of
// the outline stays: exterior pins at the hole are a loop of their own.
TEST(ProjectStages, ExteriorPinsMoveTheContourBesideThem) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  project.contour.all_components = false;
  WarpStage stage{StageMode::fine, {}};
  for (const double radius : {48.0, 10.0}) {
    for (int i = 0; i < 8; ++i) {
      const double a = i * std::numbers::pi / 4.0;
      const double x = 60.0 + radius * std::cos(a);
      const double y = 60.0 + radius * std::sin(a);
      WarpPin pin = pin_at(x, y, x, y);
      pin.kind = PinKind::exterior;
      pin.loop = radius > 20.0 ? 0 : 1;
      if (radius > 20.0 && i == 0) pin.target.x() += 20.0;
      stage.pins.push_back(pin);
    }
  }
  project.stages = {stage};
  const Warped made = warped(project, raster);
  const Points2 moved = made.deformation.points - made.mesh.meshed.mesh.points;
  double most = 0.0;
  for (Index v = 0; v < moved.rows(); ++v) {
    const Eigen::Vector2d from = made.mesh.meshed.mesh.points.row(v).transpose();
    if ((from - Eigen::Vector2d(107.0, 60.0)).norm() < 3.0) most = std::max(most, moved(v, 0));
    if ((from - Eigen::Vector2d(60.0, 60.0)).norm() < 11.0) {
      EXPECT_LE(moved.row(v).norm(), 2.0);
    }
  }
  EXPECT_GE(most, 12.0);
}

// Nesting by parity: a loop in a loop is a hole, a loop in a hole a part of its own.
TEST(OutlineFromPolylines, TellsHolesByWhatIsAroundThem) {
  const auto square = [](double x, double y, double side, bool turned) {
    Points2 loop(4, 2);
    loop << x, y, x + side, y, x + side, y + side, x, y + side;
    return turned ? Points2(loop.colwise().reverse()) : loop;
  };
  const ImageShape shape = outline_from_polylines({
      square(40, 40, 20, false),  // in the hole
      square(30, 30, 40, false),  // the hole
      square(0, 0, 100, true),    // around all, the wrong way
      square(200, 0, 10, false),  // apart
      square(45, 45, 10, true),   // a hole of the one in the hole
  });
  ASSERT_EQ(shape.outline.loops.size(), 5U);
  EXPECT_EQ(shape.num_parts, 3);
  EXPECT_EQ(shape.num_holes, 2);
  EXPECT_EQ(shape.outline.component, (std::vector<std::int32_t>{0, 0, 1, 1, 2}));
  EXPECT_EQ(shape.part_areas, (std::vector<double>{400.0 - 100.0, 10000.0 - 1600.0, 100.0}));
  EXPECT_EQ(signed_area(shape.outline.loops[3]), -1600.0);
  EXPECT_TRUE(shape.warnings.contains("W_ORIENTATION_FIXED"));
  EXPECT_EQ(shape.warnings.all()[0].count, 1);
}

// The sweep runs along the axis in which edges are shorter: both ways all crossings are found.
TEST(OutlineFromPolylines, CrossingsAreFoundInLyingAndStandingCombs) {
  constexpr Index kTeeth = 2000;
  Points2 comb(2 * kTeeth + 2, 2);
  for (Index i = 0; i < kTeeth; ++i) {
    comb.row(2 * i) << 0.5 * static_cast<double>(i), 10.0;
    comb.row(2 * i + 1) << 0.5 * static_cast<double>(i) + 0.25, 30000.0;
  }
  comb.row(2 * kTeeth) << 0.5 * kTeeth, 0.0;
  comb.row(2 * kTeeth + 1) << 0.0, 0.0;
  EXPECT_EQ(outline_from_polylines({comb}).num_parts, 1);
  Points2 lying = comb.rowwise().reverse();
  EXPECT_EQ(outline_from_polylines({lying}).num_parts, 1);
  for (Points2* each : {&comb, &lying}) {
    Points2 crossed = *each;
    crossed.row(100).swap(crossed.row(102));
    EXPECT_THROW(outline_from_polylines({crossed}), AnalysisError);
  }
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(outline_from_polylines({comb}, run).status, Status::cancelled);
}

TEST(OutlineFromPolylines, LoopsThatMeetAreRefusedByName) {
  Points2 big(3, 2);
  big << 0, 0, 10, 0, 0, 10;
  const auto refusal = [&](const Points2& other) {
    try {
      outline_from_polylines({big, other});
    } catch (const AnalysisError& error) {
      return error.code() + ": " + error.what();
    }
    return std::string();
  };
  Points2 across(3, 2);
  across << 1, 1, 12, 1, 1, 2;
  EXPECT_EQ(refusal(across).substr(0, 60),
            "E_OUTLINE_CROSSED: loop 0, edge 1 (points 1 and 2) meets loo");
  Points2 touching(3, 2);
  touching << 0, 5, 2, 5, 2, 6;
  EXPECT_EQ(refusal(touching).substr(0, 17), "E_OUTLINE_CROSSED");
  EXPECT_EQ(refusal(0.25 * big + Points2::Constant(3, 2, 1.0)), "");
  EXPECT_THROW(outline_from_polylines({}), InvalidArgument);
}

// As a project: the polylines decide, not what the picture shows.
TEST(ProjectMesh, IsMadeOfThePolylinesOfTheProject) {
  const Raster raster = disc_and_bar();
  WarpProject project = project_for(raster);
  Points2 outer(4, 2);
  outer << 10, 10, 110, 10, 110, 110, 10, 110;
  Points2 inner(4, 2);
  inner << 50, 50, 70, 50, 70, 70, 50, 70;
  project.contour.source = ContourSource::polyline;
  project.contour.loops = {outer, inner};
  const ProjectMesh mesh = make_project_mesh(project, raster);
  EXPECT_EQ(mesh.shape.num_holes, 1);
  EXPECT_EQ(exact_area(mesh.outline), 2 * 9600 * std::int64_t{65536});
}

TEST(ProjectMesh, ACancelledRunGivesNothing) {
  const RunControl run = RunControl::create();
  run.cancel();
  const Raster raster = disc_and_bar();
  const ProjectMesh mesh = make_project_mesh(project_for(raster), raster, run);
  EXPECT_EQ(mesh.status, Status::cancelled);
  EXPECT_TRUE(mesh.outline.loops.empty());
}

}  // namespace
}  // namespace dupin
