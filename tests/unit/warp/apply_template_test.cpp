#include "dupin/warp/apply_template.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/warp/planar_graph.h"
#include "tests/support/garments.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

// A project about an outline: polylines need no pixels.
WarpProject project_of(const Points2& outline) {
  WarpProject project;
  project.program = "test";
  project.image = {"x.png", std::string(64, '0'), 8, 8};
  project.contour.source = ContourSource::polyline;
  project.contour.loops = {outline};
  project.mesh.triangles = 800;
  return project;
}

Raster no_picture() { return make_raster(8, 8, 8); }

WarpPin pin_at(const RowVector2d& source, const RowVector2d& target, const std::string& name = "") {
  WarpPin pin;
  pin.name = name;
  pin.source = source;
  pin.target = target;
  return pin;
}

// The marks inside a garment as pins, two of them moved.
WarpProject template_of(const test::SyntheticGarment& garment) {
  WarpProject project = project_of(garment.outline);
  WarpStage stage;
  for (Index i = garment.num_outline; i < garment.marks.rows(); ++i)
    stage.pins.push_back(pin_at(garment.marks.row(i), garment.marks.row(i),
                                garment.names[static_cast<std::size_t>(i)]));
  stage.pins.front().target += RowVector2d(20.0, -15.0);
  stage.pins.back().target += RowVector2d(-10.0, 12.0);
  project.stages.push_back(stage);
  return project;
}

PoseTemplate pose_of(const WarpProject& project) {
  return make_pose_template(project, make_project_mesh(project, no_picture()));
}

test::SyntheticGarment mean_garment(test::Garment kind) {
  test::GarmentOptions mean;
  mean.variation = 0.0;
  mean.noise_px = 0.0;  // noise may make an outline cross itself
  return test::make_garment(kind, 1, mean);
}

test::SyntheticGarment another_garment(test::Garment kind, std::uint64_t seed) {
  test::GarmentOptions options;
  options.noise_px = 0.0;
  return test::make_garment(kind, seed, options);
}

// On the shape it was made for a template is the project again: pins to the accuracy of the
// 512 samples of the contour (their chords lie within 0.1 px of it), the same warped outline, no
// doubt (0.5 would be between two places).
TEST(ApplyTemplate, OnItsOwnShapeIsTheProject) {
  for (int kind = 0; kind < 3; ++kind) {
    const WarpProject project = template_of(mean_garment(static_cast<test::Garment>(kind)));
    const PoseTemplate pose = pose_of(project);
    const AppliedTemplate applied = apply_template(pose, project, no_picture());
    ASSERT_EQ(applied.status, Status::ok);
    ASSERT_EQ(applied.project.stages.size(), 1U);
    for (std::size_t m = 0; m < project.stages[0].pins.size(); ++m) {
      const WarpPin& before = project.stages[0].pins[m];
      const WarpPin& after = applied.project.stages[0].pins[m];
      EXPECT_EQ(after.name, before.name);
      EXPECT_LT((after.source - before.source).norm(), 0.2);
      EXPECT_LT((after.target - before.target).norm(), 0.2);
      EXPECT_GT(applied.pins[0][m].confidence, 0.6);
      EXPECT_EQ(applied.pins[0][m].moved_px, 0.0);
    }
    EXPECT_GT(applied.overlap.iou, 0.998);
    EXPECT_EQ(applied.deformation.quality.flipped.size(), 0U);
    EXPECT_FALSE(applied.warnings.contains("W_PIN_MOVED"));
  }
}

// Scaled by s and moved by t, a relative target is scaled and moved too, an absolute one stays;
// the overlap of `relative` does not see s and t.
TEST(ApplyTemplate, FollowsScaleAndPlaceByTheRule) {
  const WarpProject project = template_of(mean_garment(test::Garment::dress));
  const PoseTemplate pose = pose_of(project);
  const double s = 1.5;
  const RowVector2d t(400.0, 100.0);
  const WarpProject larger = project_of((s * project.contour.loops[0]).rowwise() + t);
  ApplyOptions options;
  const AppliedTemplate relative = apply_template(pose, larger, no_picture(), options);
  options.rule = TargetRule::absolute;
  const AppliedTemplate absolute = apply_template(pose, larger, no_picture(), options);
  for (std::size_t m = 0; m < project.stages[0].pins.size(); ++m) {
    const WarpPin& pin = project.stages[0].pins[m];
    EXPECT_LT((relative.project.stages[0].pins[m].source - s * pin.source - t).norm(), 0.5);
    EXPECT_LT((relative.project.stages[0].pins[m].target - s * pin.target - t).norm(), 0.5);
    EXPECT_EQ(absolute.project.stages[0].pins[m].target, pin.target);
  }
  EXPECT_GT(relative.overlap.iou, 0.995);
}

// Pins of a second stage lie on what the first one left, on the template and on every other shape:
// outside the shape at rest, inside the moved one.
TEST(ApplyTemplate, LaterStagesBeginWhereTheFirstEnded) {
  const test::SyntheticGarment garment = mean_garment(test::Garment::t_shirt);
  WarpProject project = template_of(garment);
  const RowVector2d all(700.0, 0.0);
  for (WarpPin& pin : project.stages[0].pins) pin.target = pin.source + all;
  const WarpStage first = project.stages[0];
  WarpStage second;
  for (const WarpPin& pin : first.pins)
    second.pins.push_back(pin_at(pin.target, pin.target + RowVector2d(0.0, 5.0), pin.name));
  project.stages.push_back(second);
  WarpStage fine;
  fine.mode = StageMode::fine;
  for (Index i = 0; i < garment.num_outline; ++i) {
    const RowVector2d place = garment.marks.row(i) + all + RowVector2d(0.0, 5.0);
    WarpPin pin = pin_at(place, place + RowVector2d(3.0, 0.0));
    pin.kind = PinKind::exterior;
    fine.pins.push_back(pin);
  }
  project.stages.push_back(fine);
  const PoseTemplate pose = pose_of(project);
  const test::SyntheticGarment other = another_garment(test::Garment::t_shirt, 40000);
  const AppliedTemplate applied = apply_template(pose, project_of(other.outline), no_picture());
  ASSERT_EQ(applied.status, Status::ok);
  ASSERT_EQ(applied.project.stages.size(), 3U);
  for (std::size_t m = 0; m < first.pins.size(); ++m) {
    const WarpPin& one = applied.project.stages[0].pins[m];
    const WarpPin& two = applied.project.stages[1].pins[m];
    EXPECT_LT((two.source - one.target).norm(), 0.05 * other.height);
    EXPECT_GT((two.source - one.source).norm(), 0.5 * other.height);
  }
  EXPECT_EQ(applied.deformation.num_done, 3U);
  EXPECT_EQ(applied.deformation.quality.flipped.size(), 0U);
}

// Every garment of a collection gets every pin inside itself and not one triangle turned over.
TEST(ApplyTemplate, PosesACollection) {
  for (int kind = 0; kind < 3; ++kind) {
    const PoseTemplate pose = pose_of(template_of(mean_garment(static_cast<test::Garment>(kind))));
    for (const std::uint64_t seed : {40000U, 40003U, 40006U}) {
      const test::SyntheticGarment other = another_garment(static_cast<test::Garment>(kind),
                                                           seed + static_cast<std::uint64_t>(kind));
      const AppliedTemplate applied = apply_template(pose, project_of(other.outline), no_picture());
      EXPECT_EQ(applied.status, Status::ok);
      EXPECT_GT(applied.overlap.iou, 0.5);
      EXPECT_EQ(applied.deformation.quality.flipped.size(), 0U);
      for (const WarpPin& pin : applied.project.stages[0].pins)
        EXPECT_TRUE(locate(applied.mesh.meshed.mesh, pin.source.transpose()).has_value());
    }
  }
}

// A notch that is deep on the second shape only: what lay below it falls into the air, goes to the
// shape, and is named.
TEST(ApplyTemplate, PinsOutsideGoInside) {
  const auto notched = [](double depth) {
    Points2 outline(8, 2);
    outline << 0, 0, 80, 0, 90, depth, 110, depth, 120, 0, 200, 0, 200, 300, 0, 300;
    return outline;
  };
  WarpProject project = project_of(notched(30.0));
  project.stages.push_back(
      {StageMode::coarse,
       {pin_at({100.0, 60.0}, {100.0, 50.0}, "below"), pin_at({20.0, 280.0}, {20.0, 280.0}),
        pin_at({180.0, 280.0}, {180.0, 280.0})}});
  const PoseTemplate pose = pose_of(project);
  bool is_moved = false;
  for (const double depth : {150.0, 200.0, 250.0}) {
    const AppliedTemplate applied = apply_template(pose, project_of(notched(depth)), no_picture());
    const bool is_told = applied.warnings.contains("W_PIN_MOVED");
    EXPECT_EQ(applied.pins[0][0].moved_px > 0.0, is_told);
    is_moved = is_moved || is_told;
    for (const WarpPin& pin : applied.project.stages[0].pins)
      EXPECT_TRUE(locate(applied.mesh.meshed.mesh, pin.source.transpose()).has_value());
  }
  EXPECT_TRUE(is_moved);
}

TEST(ApplyTemplate, RefusesAndStops) {
  const WarpProject project = template_of(mean_garment(test::Garment::dress));
  EXPECT_THROW(apply_template(PoseTemplate{}, project, no_picture()), Error);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(make_pose_template(project, make_project_mesh(project, no_picture()), run).status,
            Status::cancelled);
  const PoseTemplate pose = pose_of(project);
  EXPECT_EQ(apply_template(pose, project, no_picture(), {}, run).status, Status::cancelled);
  // A circle has no key points: any turn would do as well.
  Points2 circle(90, 2);
  for (Index i = 0; i < 90; ++i) {
    const double angle = 0.0698131700797732 * static_cast<double>(i);
    circle.row(i) << 100.0 + 90.0 * std::cos(angle), 100.0 + 90.0 * std::sin(angle);
  }
  EXPECT_THROW(apply_template(pose, project_of(circle), no_picture()), AnalysisError);
}

}  // namespace
}  // namespace dupin
