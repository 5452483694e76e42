#include "dupin/registration/thesis_registration.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/shapes.h"
#include "tests/support/rugged_body.h"
#include "tests/support/scan_pair.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::VectorXd;

Points box_points(const RowVector3d& half_width, Index count, std::uint64_t seed) {
  Rng rng(seed);
  Points points(count, 3);
  for (Index i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) points(i, c) = half_width[c] * rng.uniform(-1.0, 1.0);
  }
  return points;
}

VectorXd mixed_weights(Index count, std::uint64_t seed) {
  Rng rng(seed);
  VectorXd weights(count);
  for (Index i = 0; i < count; ++i) weights[i] = rng.normal();
  return weights;
}

const Mesh& bumpy() {
  static const Mesh mesh = make_bumpy_sphere(1.0, 6'000, {20, 0.12, 0.16, 3}).surface.mesh;
  return mesh;
}

/// An ellipsoid with 300 bumps and dents of many heights and widths: on one of equal, round bumps
/// frames have no direction and descriptors do not differ.
const Mesh& rugged() {
  static const Mesh mesh =
      test::rugged_body(5, 20'000, {300, 0.1, 0.05, 0.2, Eigen::Vector3d(1.0, 0.8, 0.6)});
  return mesh;
}

Mesh moved(const Mesh& mesh, const Pose& pose) {
  return {transformed(mesh.points, pose), mesh.triangles};
}

/// Features at given places, each with a frame and values of its own.
ThesisFeatures features_at(const Points& places, double radius) {
  ThesisFeatures out;
  for (Index i = 0; i < places.rows(); ++i) {
    ThesisFeature feature;
    feature.position = places.row(i);
    feature.radius = radius;
    feature.keypoint.radius = 0.2 * radius;
    feature.frame = test::random_pose(1.0, 1.0, 50 + static_cast<std::uint64_t>(i)).rotation;
    feature.values = {0.1 + static_cast<double>(i) / static_cast<double>(places.rows())};
    out.features.push_back(feature);
  }
  return out;
}

ThesisFeatures moved(const ThesisFeatures& features, const Pose& pose) {
  ThesisFeatures out = features;
  for (ThesisFeature& feature : out.features) {
    feature.position = transformed(Points(feature.position), pose).row(0);
    feature.frame = pose.rotation * feature.frame;
  }
  return out;
}

// The weighted covariance of a box is diagonal: axes by falling width, v_3 the one along the
// normal, on its side, and the frame right-handed.
TEST(PrincipalFrame, OfABoxAreItsAxes) {
  const Points points = box_points({1.0, 3.0, 0.3}, 20'000, 1);
  for (const double side : {1.0, -1.0}) {
    const Matrix3d frame = principal_frame(points, VectorXd::Ones(points.rows()), {0.1, 0.1, side});
    // Off-diagonal entries are of order s_a s_b / sqrt(3 N) of the difference of the variances.
    EXPECT_NEAR(std::abs(frame(1, 0)), 1.0, 1e-3);
    EXPECT_NEAR(std::abs(frame(0, 1)), 1.0, 1e-3);
    EXPECT_NEAR(frame(2, 2), side, 1e-3);
    EXPECT_NEAR(frame.determinant(), 1.0, 1e-12);
  }
}

// Erratum E-27: LoC of a bump and of a dent differ in sign alone; their frames must not.
TEST(PrincipalFrame, DoesNotDependOnTheSignOfTheWeights) {
  const Points points = box_points({1.0, 2.0, 0.2}, 500, 2);
  const VectorXd weights = mixed_weights(500, 3);
  const RowVector3d normal = RowVector3d::UnitZ();
  EXPECT_EQ(principal_frame(points, weights, normal), principal_frame(points, -weights, normal));
  EXPECT_EQ(principal_frame(points, weights, normal),
            principal_frame(points, weights.cwiseAbs(), normal));
}

// Rotating, moving and scaling the points turns the frame along; tangents keep their line.
TEST(PrincipalFrame, TurnsWithThePoints) {
  const Points points = box_points({1.0, 2.0, 0.2}, 500, 4);
  const VectorXd weights = mixed_weights(500, 5);
  const RowVector3d normal = RowVector3d(0.2, -0.1, 1.0).normalized();
  const Matrix3d frame = principal_frame(points, weights, normal);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Pose pose = test::random_pose(10.0, 100.0, seed);
    const Matrix3d there = principal_frame(transformed(points, pose), 7.0 * weights,
                                           turned(Points(normal), pose).row(0));
    const Matrix3d product = (pose.rotation * frame).transpose() * there;
    EXPECT_LT((product.cwiseAbs() - Matrix3d::Identity()).norm(), 1e-9);
    EXPECT_GT(product(2, 2), 0.0);
  }
}

// Gradients of a linear function are all alike: v_1 is its slope within the plane, uphill, and the
// part along the normal does not count.
TEST(GradientFrame, PointsUphill) {
  Points gradients(50, 3);
  gradients.rowwise() = RowVector3d(3.0, 4.0, 100.0);
  const Matrix3d frame = gradient_frame(gradients, VectorXd::Ones(50), RowVector3d(0.0, 0.0, 2.0));
  EXPECT_LT((frame.col(0) - Eigen::Vector3d(0.6, 0.8, 0.0)).norm(), 1e-14);
  EXPECT_EQ(frame.col(2), Eigen::Vector3d::UnitZ());
  EXPECT_NEAR(frame.determinant(), 1.0, 1e-14);
  // All along the normal: what rounding leaves in the plane is no direction, the frame is one.
  gradients.rowwise() = RowVector3d(0.1, 0.2, 0.3);
  const Matrix3d steep = gradient_frame(gradients, VectorXd::Ones(50), {0.1, 0.2, 0.3});
  EXPECT_EQ(steep, gradient_frame(Points::Zero(50, 3), VectorXd::Ones(50), {0.1, 0.2, 0.3}));
  // Where nothing rises any tangent will do, but it is a frame.
  const Matrix3d flat = gradient_frame(Points::Zero(50, 3), VectorXd::Ones(50), {1.0, 1.0, 0.0});
  EXPECT_LT((flat.transpose() * flat - Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_THROW(gradient_frame(gradients, VectorXd::Ones(49), {0.0, 0.0, 1.0}), InvalidArgument);
}

// By hand: four values in four bins over [-2, 2], middles -3/4, -1/4, 1/4, 3/4 of the range; what
// lies beyond the range counts at its end.
TEST(LocHistogram, WeighsSharesByTheirLoc) {
  const VectorXd histogram = loc_histogram({-5.0, 0.5, 0.7, 1.9}, 2.0, 4);
  EXPECT_EQ(histogram, (VectorXd(4) << -0.1875, 0.0, 0.125, 0.1875).finished());
  EXPECT_EQ(loc_histogram({}, 1.0, 3), VectorXd::Zero(3));
  EXPECT_THROW(loc_histogram({1.0}, 0.0, 3), InvalidArgument);
  EXPECT_THROW(loc_histogram({1.0}, 1.0, 0), InvalidArgument);
}

// A rigid motion keeps vertices, levels and values of the features and turns their frames.
TEST(ThesisFeatures, MoveWithTheSurface) {
  const Pose pose = test::random_pose(3.0, 1.0, 17);
  const ThesisFeatures here = describe_by_thesis(surface_graph(bumpy()));
  const ThesisFeatures there = describe_by_thesis(surface_graph(moved(bumpy(), pose)));
  ASSERT_GE(here.features.size(), 20U);
  ASSERT_EQ(here.features.size(), there.features.size());
  for (std::size_t i = 0; i < here.features.size(); ++i) {
    const ThesisFeature& a = here.features[i];
    const ThesisFeature& b = there.features[i];
    ASSERT_EQ(a.keypoint.vertex, b.keypoint.vertex);
    EXPECT_EQ(a.keypoint.level, b.keypoint.level);
    ASSERT_EQ(a.values.size(), b.values.size());
    for (std::size_t j = 0; j < a.values.size(); ++j) EXPECT_NEAR(a.values[j], b.values[j], 1e-8);
    const Matrix3d product = (pose.rotation * a.frame).transpose() * b.frame;
    EXPECT_NEAR(product(2, 2), 1.0, 1e-6);
  }
}

// Tangents of every rule turn with the surface; those of gradients keep their sign as well. A
// tangent is sure where the rule singles out one direction: on the rugged body it does for most.
TEST(ThesisFeatures, TangentsOfAllRulesMoveWithTheSurface) {
  const Pose pose = test::random_pose(3.0, 1.0, 18);
  const SurfaceGraph surface = surface_graph(rugged());
  const SurfaceGraph turned_surface = surface_graph(moved(rugged(), pose));
  std::vector<Matrix3d> first;
  for (const FrameRule rule :
       {FrameRule::loc, FrameRule::uniform, FrameRule::gaussian, FrameRule::gradient}) {
    ThesisFeatureOptions options;
    options.frame = rule;
    const ThesisFeatures here = describe_by_thesis(surface, options);
    const ThesisFeatures there = describe_by_thesis(turned_surface, options);
    ASSERT_GE(here.features.size(), 20U);
    ASSERT_EQ(here.features.size(), there.features.size());
    for (std::size_t i = 0; i < here.features.size(); ++i) {
      const Eigen::Vector3d expected = pose.rotation * here.features[i].frame.col(0);
      const double cosine = expected.dot(there.features[i].frame.col(0));
      EXPECT_GT(rule == FrameRule::gradient ? cosine : std::abs(cosine), 1.0 - 1e-6);
    }
    first.push_back(here.features.front().frame);
  }
  // Four rules, four frames.
  for (std::size_t a = 0; a < first.size(); ++a) {
    for (std::size_t b = a + 1; b < first.size(); ++b) EXPECT_FALSE(first[a] == first[b]);
  }
}

// The smoothed signal of a sphere of any size is H; its value without a unit, H times a radius, is
// that of the feature over that of the sphere. On a bumpy sphere all values lie about it.
TEST(ThesisFeatures, CountTheCurvatureWhereAsked) {
  ThesisFeatureOptions options;
  options.value = DescriptorValue::signal;
  const ThesisFeatures found = describe_by_thesis(surface_graph(bumpy()), options);
  ASSERT_GE(found.features.size(), 20U);
  double sum = 0.0;
  double count = 0.0;
  for (const ThesisFeature& feature : found.features) {
    for (const double value : feature.values) sum += value / feature.keypoint.radius;
    count += static_cast<double>(feature.values.size());
  }
  // Neighbourhoods of bumps and of dents; between them H is 1 on average.
  EXPECT_NEAR(sum / count, 1.0, 0.5);
}

// A value of a neighbourhood is tau LoC times a radius: it does not change with the unit.
TEST(ThesisFeatures, ValuesHaveNoUnit) {
  Pose larger;
  larger.scale = 1000.0;
  const ThesisFeatures here = describe_by_thesis(surface_graph(bumpy()));
  const ThesisFeatures there = describe_by_thesis(surface_graph(moved(bumpy(), larger)));
  ASSERT_EQ(here.features.size(), there.features.size());
  for (std::size_t i = 0; i < here.features.size(); ++i) {
    EXPECT_NEAR(there.features[i].radius / here.features[i].radius, 1000.0, 1e-6);
    EXPECT_NEAR(here.features[i].values.back(), there.features[i].values.back(), 1e-8);
  }
}

// The same features in another place: three exact pairs give the pose exactly.
TEST(ThesisRegistration, RecoversACopyInAnyPose) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const Pose truth = test::random_pose(3.0, 1.0, seed);
    const ThesisRegistration found =
        register_by_thesis(surface_graph(bumpy()), surface_graph(moved(bumpy(), truth)));
    ASSERT_TRUE(found.is_found);
    EXPECT_LT(rotation_angle(found.pose.rotation, truth.rotation), 1e-8);
    EXPECT_LT((found.pose.translation - truth.translation).norm(), 1e-8);
    EXPECT_LT(found.score, 1e-8);
    EXPECT_EQ(found.overlap, 1.0);
  }
}

// C1: parts of a bumpy solid that share 70 %, with noise of a tenth of an edge on each, without
// refinement: within five degrees and two edges.
TEST(ThesisRegistration, BringsPartialScansTogether) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const test::ScanPair pair = test::make_scan_pair(
        rugged(), {.overlap = 0.7, .noise_percent = 10.0, .has_face_centers = false, .seed = seed});
    const ThesisRegistration found =
        register_by_thesis(surface_graph(pair.moving), surface_graph(pair.fixed));
    ASSERT_TRUE(found.is_found) << seed;
    const test::PoseError error = test::pose_error(found.pose, pair.truth, pair.moving.points);
    EXPECT_LT(error.rotation_deg, 5.0) << seed;
    EXPECT_LT(error.translation, 2.0 * pair.edge) << seed;
  }
}

// Bare points are described through their neighbour graph.
TEST(ThesisRegistration, TakesPointClouds) {
  const Pose truth = test::random_pose(3.0, 1.0, 21);
  const SurfaceGraph here = surface_graph(PointCloud{bumpy().points, {}});
  const SurfaceGraph there =
      surface_graph(PointCloud{transformed(bumpy().points, inverse(truth)), {}});
  const ThesisRegistration found = register_by_thesis(there, here);
  ASSERT_TRUE(found.is_found);
  EXPECT_LT(rotation_angle(found.pose.rotation, truth.rotation), 1e-8);
}

// Tangents have no orientation: turning v_1 or v_2 of any feature over must not matter, bit for
// bit, since all signs are tried on both sides.
TEST(ThesisRegistration, TriesAllSigns) {
  const ThesisFeatures fixed = features_at(box_points({1.0, 1.0, 1.0}, 30, 8), 0.7);
  const Pose truth = test::random_pose(2.0, 1.0, 9);
  const ThesisFeatures moving = moved(fixed, inverse(truth));
  const ThesisRegistration found = register_by_thesis(moving, fixed);
  ASSERT_TRUE(found.is_found);
  EXPECT_LT(rotation_angle(found.pose.rotation, truth.rotation), 1e-9);
  for (const int side : {0, 1, 2}) {  // v_1, v_2, both
    ThesisFeatures other = moving;
    for (std::size_t i = 0; i < other.features.size(); i += 2) {
      if (side != 1) other.features[i].frame.col(0) *= -1.0;
      if (side != 0) other.features[i].frame.col(1) *= -1.0;
    }
    const ThesisRegistration again = register_by_thesis(other, fixed);
    EXPECT_EQ(again.num_hypotheses, found.num_hypotheses);
    EXPECT_EQ(again.score, found.score);
    EXPECT_LT(rotation_angle(again.pose.rotation, truth.rotation), 1e-9);
  }
}

// E-28: features that only one surface has must not move the pose, however far they lie; the plain
// sum of 5.42 would be theirs.
TEST(ThesisRegistration, TrimsWhatHasNoPartner) {
  Points places = box_points({1.0, 1.0, 1.0}, 60, 10);
  const Pose truth = test::random_pose(2.0, 1.0, 11);
  ThesisFeatures moving = moved(features_at(places, 0.7), inverse(truth));
  moving.features.resize(20);
  places.bottomRows(40).array() += 30.0;
  const ThesisFeatures fixed = features_at(places, 0.7);
  const ThesisRegistration found = register_by_thesis(moving, fixed);
  ASSERT_TRUE(found.is_found);
  EXPECT_LT(rotation_angle(found.pose.rotation, truth.rotation), 1e-9);
  EXPECT_NEAR(found.overlap, 20.0 / 60.0, 1e-12);
  // All twenty moving features have their partner, and the partners are told.
  EXPECT_EQ(found.moving_overlap, 1.0);
  ASSERT_EQ(found.met.size(), 20U);
  for (std::int32_t i = 0; i < 20; ++i) {
    const MetFeatures& met = found.met[static_cast<std::size_t>(i)];
    EXPECT_EQ(met.fixed, i);
    EXPECT_EQ(met.moving, i);
    EXPECT_LT(met.distance, 1e-9);
  }
  // More than the share that has a partner cannot be asked for.
  ThesisRegistrationOptions options;
  options.min_overlap = 0.5;
  EXPECT_FALSE(register_by_thesis(moving, fixed, options).is_found);
}

// The queue holds K matches of each fixed feature by rising distance; a copy matches itself first.
TEST(ThesisRegistration, QueuesMatchesByDistance) {
  const ThesisFeatures fixed = features_at(box_points({1.0, 1.0, 1.0}, 12, 12), 0.7);
  ThesisRegistrationOptions options;
  options.candidates = 4;
  const auto queue = register_by_thesis(fixed, fixed, options).queue;
  ASSERT_EQ(queue.size(), 48U);
  EXPECT_TRUE(std::is_sorted(queue.begin(), queue.end(),
                             [](auto& a, auto& b) { return a.distance < b.distance; }));
  for (std::int32_t i = 0; i < 12; ++i) {
    EXPECT_EQ(std::count_if(queue.begin(), queue.end(), [&](auto& m) { return m.fixed == i; }), 4);
    EXPECT_TRUE(std::any_of(queue.begin(), queue.end(), [&](auto& m) {
      return m.fixed == i && m.moving == i && m.distance == 0.0;
    }));
  }
}

// Three points of a line leave the turn about it open, on either surface.
TEST(ThesisRegistration, RejectsCollinearTriples) {
  Points line(10, 3);
  for (Index i = 0; i < 10; ++i) line.row(i) = 0.3 * static_cast<double>(i) * RowVector3d(1, 2, 3);
  const ThesisFeatures flat = features_at(line, 4.0);
  const ThesisFeatures full = features_at(box_points({1.0, 1.0, 1.0}, 20, 13), 0.7);
  for (const auto& [moving, fixed] : {std::pair{flat, flat}, {flat, full}, {full, flat}}) {
    const ThesisRegistration found = register_by_thesis(moving, fixed);
    EXPECT_FALSE(found.is_found);
    EXPECT_EQ(found.num_hypotheses, 0);
    EXPECT_EQ(found.queue.size(), 5 * fixed.features.size());
  }
}

// No features, no pose: a plane, a sphere (whose only extrema are those of its sampling), two
// features, none.
TEST(ThesisRegistration, FindsNothingWithoutFeatures) {
  const SurfaceGraph plane = surface_graph(make_plane({.num_vertices = 2000}).mesh);
  const SurfaceGraph sphere = surface_graph(make_sphere(1.0, 2000).mesh);
  const SurfaceGraph shape = surface_graph(bumpy());
  EXPECT_FALSE(register_by_thesis(plane, plane).is_found);
  EXPECT_FALSE(register_by_thesis(sphere, sphere).is_found);
  EXPECT_FALSE(register_by_thesis(shape, sphere).is_found);
  EXPECT_FALSE(register_by_thesis(plane, shape).is_found);
  const ThesisFeatures two = features_at(box_points({1.0, 1.0, 1.0}, 2, 13), 0.7);
  const ThesisFeatures many = features_at(box_points({1.0, 1.0, 1.0}, 20, 13), 0.7);
  EXPECT_FALSE(register_by_thesis(two, many).is_found);
  EXPECT_FALSE(register_by_thesis(many, two).is_found);
  EXPECT_FALSE(register_by_thesis(ThesisFeatures{}, ThesisFeatures{}).is_found);
}

TEST(ThesisRegistration, DoesNotDependOnThreads) {
  const test::ScanPair pair = test::make_scan_pair(bumpy(), {.overlap = 0.7, .seed = 4});
  const SurfaceGraph moving = surface_graph(pair.moving);
  const SurfaceGraph fixed = surface_graph(pair.fixed);
  const int before = thread_count();
  set_thread_count(1);
  const ThesisRegistration one = register_by_thesis(moving, fixed);
  set_thread_count(4);
  const ThesisRegistration four = register_by_thesis(moving, fixed);
  set_thread_count(before);
  EXPECT_EQ(one.pose.rotation, four.pose.rotation);
  EXPECT_EQ(one.pose.translation, four.pose.translation);
  EXPECT_EQ(one.score, four.score);
  EXPECT_EQ(one.num_hypotheses, four.num_hypotheses);
}

TEST(ThesisRegistration, StopsWhenCancelled) {
  const SurfaceGraph graph = surface_graph(bumpy());
  const RunControl run = RunControl::create();
  run.cancel();
  const ThesisRegistration found = register_by_thesis(graph, graph, {}, run);
  EXPECT_EQ(found.status, Status::cancelled);
  EXPECT_FALSE(found.is_found);
  const ThesisFeatures features = describe_by_thesis(graph, {}, run);
  EXPECT_EQ(features.status, Status::cancelled);
  EXPECT_TRUE(features.features.empty());
}

TEST(ThesisRegistration, RefusesOptionsOutOfRange) {
  const auto refused = [](auto change) {
    ThesisRegistrationOptions options;
    change(options);
    try {
      register_by_thesis(ThesisFeatures{}, ThesisFeatures{}, options);
      describe_by_thesis(SurfaceGraph{}, options.features);
    } catch (const InvalidArgument&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& o) { o.candidates = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.bins = 1; }));
  EXPECT_TRUE(refused([](auto& o) { o.min_overlap = 0.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.min_overlap = 1.1; }));
  EXPECT_TRUE(refused([](auto& o) { o.reach = std::numeric_limits<double>::quiet_NaN(); }));
  EXPECT_TRUE(refused([](auto& o) { o.features.neighborhood = 0.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.features.min_contrast = -1.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.features.max_features = -1; }));
  EXPECT_THROW(principal_frame(Points::Zero(2, 3), VectorXd::Zero(3), RowVector3d::UnitZ()),
               InvalidArgument);
}

}  // namespace
}  // namespace dupin
