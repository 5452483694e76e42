#include "dupin/registration/register_all.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"
#include "dupin/render/range_view.h"
#include "tests/support/rugged_body.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

struct Views {
  std::vector<Mesh> scans;  // each in a frame of its own
  std::vector<Pose> truth;  // from there to the frame of the body
  double diameter = 0.0;
};

// Range scans of a body from `count` directions on a circle, each in a random pose.
Views scan_around(const Mesh& body, int count, int cols) {
  Views views;
  views.diameter = (body.points.colwise().maxCoeff() - body.points.colwise().minCoeff()).norm();
  Rng rng(17);
  for (int k = 0; k < count; ++k) {
    Camera direction;
    direction.azimuth_deg = 360.0 * k / count;
    direction.elevation_deg = 10.0;
    const RangeCamera camera = fit_range_camera(body.points, direction, cols * 3 / 4, cols);
    const RangeView view = scan_range_view(body, camera);
    const Pose to_world{1.0, camera.rotation.transpose(), camera.position};
    Pose scramble;
    scramble.rotation = rotation_of(Vector3d(rng.normal(), rng.normal(), rng.normal()));
    scramble.translation = Vector3d(rng.normal(), rng.normal(), rng.normal());
    Mesh scan = view.mesh;
    scan.points = transformed(scan.points, scramble);
    views.scans.push_back(scan);
    views.truth.push_back(compose(to_world, inverse(scramble)));
  }
  return views;
}

// Largest distance of a point from its place, when the reference scan lies where it belongs.
double largest_error(const Views& views, const RegisterAllResult& result) {
  const auto reference = static_cast<std::size_t>(result.reference);
  double largest = 0.0;
  for (std::size_t i = 0; i < views.scans.size(); ++i) {
    if (!result.poses[i]) continue;
    const Points there =
        transformed(views.scans[i].points, compose(views.truth[reference], *result.poses[i]));
    const Points truth = transformed(views.scans[i].points, views.truth[i]);
    largest = std::max(largest, (there - truth).rowwise().norm().maxCoeff());
  }
  return largest;
}

// Six views round a body, in random poses, come into one frame to one percent of the diameter; a
// scan of another body among them is left out, and nothing else is.
TEST(RegisterAll, BringsViewsIntoOneFrame) {
  const Views views = scan_around(test::rugged_body(70, 12'000), 6, 90);
  std::vector<ScanFeatures> scans;
  for (const Mesh& scan : views.scans) scans.push_back(describe_scan(scan));
  scans.push_back(describe_scan(test::rugged_body(71, 4'000)));
  const RegisterAllResult result = register_all(scans);
  ASSERT_EQ(result.status, Status::ok);
  EXPECT_EQ(result.reference, 0);
  for (std::size_t i = 0; i < views.scans.size(); ++i) EXPECT_TRUE(result.poses[i]) << i;
  EXPECT_FALSE(result.poses.back());
  EXPECT_LT(largest_error(views, result), 0.01 * views.diameter);
  EXPECT_GE(result.pairs.size(), 6U);
  // Every pair is either accepted or refused, and the other body is refused by all.
  EXPECT_EQ(result.pairs.size() + result.refused.size(), 21U);
  Index of_other = 0;
  for (const RefusedPair& pair : result.refused) {
    EXPECT_NE(pair.refusal, Refusal::none);
    of_other += pair.fixed == 6 ? 1 : 0;
  }
  EXPECT_EQ(of_other, 6);
  // Used pairs close their loops: within twice the bounds by which they were chosen.
  for (const ScanPairResult& pair : result.pairs) {
    ASSERT_TRUE(pair.loop_turn && pair.loop_shift);
    const ScanFeatures& moving = scans[static_cast<std::size_t>(pair.moving)];
    const Points center = moving.coarse.colwise().mean();
    const Pose joint = compose(inverse(*result.poses[static_cast<std::size_t>(pair.fixed)]),
                               *result.poses[static_cast<std::size_t>(pair.moving)]);
    EXPECT_NEAR(*pair.loop_shift,
                (transformed(center, joint) - transformed(center, pair.pose)).norm(), 1e-12);
    if (!pair.is_used) continue;
    EXPECT_LT(*pair.loop_turn, 0.12);
    EXPECT_LT(*pair.loop_shift, 0.04 * moving.diameter);
    EXPECT_GT(*pair.loop_turn, 0.0);
  }
}

TEST(RegisterAll, RefusesBadInputAndHeedsCancellation) {
  const ScanFeatures scan = describe_scan(test::rugged_body(72, 2'000));
  EXPECT_THROW(register_all({scan}), InvalidArgument);
  RegisterAllOptions options;
  options.max_iterations = -1;
  EXPECT_THROW(register_all({scan, scan}, options), InvalidArgument);
  options = {};
  options.min_confidence = 2.0;
  EXPECT_THROW(register_all({scan, scan}, options), InvalidArgument);
  const RunControl run = RunControl::create();
  run.cancel();
  EXPECT_EQ(register_all({scan, scan}, {}, run).status, Status::cancelled);
  // Bodies that do not belong together stay where they are.
  const RegisterAllResult apart = register_all({scan, describe_scan(test::rugged_body(73, 2'000))});
  EXPECT_EQ(apart.reference, -1);
  EXPECT_FALSE(apart.poses[0] || apart.poses[1]);
}

}  // namespace
}  // namespace dupin
