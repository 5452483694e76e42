#include "dupin/registration/pose_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "dupin/registration/consistency.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::RowVector3d;
using std::size_t;

constexpr double kFrameAngle = 40.0 * std::numbers::pi / 180.0;  // of two frames of one pose
constexpr double kNormalCosine = 0.4;  // difference of cosines between normals and distances
constexpr double kScaleFactor = 1.35;  // of the scales of two matches of one pose

// Matches as arrays: places, normals, rotations.
struct MatchTable {
  Points p, q, np, nq;
  std::vector<Matrix3d> rotation;
  std::vector<double> log_scale;
  std::vector<double> weight;
  std::vector<std::uint8_t> flipped;

  MatchTable(const ScanFeatures& moving, const ScanFeatures& fixed,
             const std::vector<FeatureMatch>& matches) {
    const auto count = static_cast<Index>(matches.size());
    for (Points* points : {&p, &q, &np, &nq}) points->resize(count, 3);
    for (Index i = 0; i < count; ++i) {
      const FeatureMatch& match = matches[static_cast<size_t>(i)];
      const Anchor& a = moving.anchors[static_cast<size_t>(match.moving)];
      const Anchor& b = fixed.anchors[static_cast<size_t>(match.fixed)];
      p.row(i) = a.position;
      q.row(i) = b.position;
      np.row(i) = match.is_flipped ? RowVector3d(-a.normal) : a.normal;
      nq.row(i) = b.normal;
      rotation.push_back(match.rotation);
      log_scale.push_back(std::log(match.scale));
      weight.push_back(match.weight);
      flipped.push_back(match.is_flipped ? 1 : 0);
    }
  }
};

class Consistency {
 public:
  Consistency(const MatchTable& table, const PoseSearchOptions& options)
      : table_(&table), options_(options) {}

  bool operator()(Index i, Index j) const {
    const MatchTable& t = *table_;
    const auto a = static_cast<size_t>(i);
    const auto b = static_cast<size_t>(j);
    if (t.flipped[a] != t.flipped[b]) return false;
    const RowVector3d d = t.p.row(j) - t.p.row(i);
    const RowVector3d e = t.q.row(j) - t.q.row(i);
    const double length_d = d.norm();
    const double length_e = e.norm();
    if (!(length_d > 0.0) || !(length_e > 2.0 * options_.position_error)) return false;
    double scale = options_.scale;
    if (options_.with_scale) {
      scale = length_e / length_d;
      const double log = std::log(scale);
      const double bound = std::log(kScaleFactor);
      if (std::abs(log - t.log_scale[a]) > bound || std::abs(log - t.log_scale[b]) > bound)
        return false;
    } else if (std::abs(scale * length_d - length_e) > 2.0 * options_.position_error) {
      return false;
    }
    for (const Index k : {i, j}) {
      const double before = t.np.row(k).dot(d) / length_d;
      const double after = t.nq.row(k).dot(e) / length_e;
      if (std::abs(before - after) > kNormalCosine) return false;
    }
    // |R_i - R_j|^2 = 8 sin^2(angle / 2)
    const double sine = std::sin(kFrameAngle / 2.0);
    return (t.rotation[a] - t.rotation[b]).squaredNorm() < 8.0 * sine * sine;
  }

 private:
  const MatchTable* table_;
  PoseSearchOptions options_;
};

// Least-squares pose of matches with their frames: each stands for its place and, with a small
// weight, for points along its normal and a tangent, so that even one match determines a pose.
Pose fit_frames(const MatchTable& t, const std::vector<std::int32_t>& members,
                const PoseSearchOptions& options) {
  double scale = options.scale;
  if (options.with_scale) {
    double sum = 0.0;
    double mass = 0.0;
    for (const std::int32_t m : members) {
      sum += t.weight[static_cast<size_t>(m)] * t.log_scale[static_cast<size_t>(m)];
      mass += t.weight[static_cast<size_t>(m)];
    }
    scale = std::exp(mass > 0.0 ? sum / mass : t.log_scale[static_cast<size_t>(members[0])]);
  }
  const double arm = 3.0 * options.position_error;  // [mu of fixed]
  const auto count = static_cast<Index>(members.size());
  Points from(4 * count, 3);
  Points to(4 * count, 3);
  Eigen::VectorXd weight(4 * count);
  for (Index k = 0; k < count; ++k) {
    const Index m = members[static_cast<size_t>(k)];
    const Matrix3d& rotation = t.rotation[static_cast<size_t>(m)];
    from.row(4 * k) = t.p.row(m);
    to.row(4 * k) = t.q.row(m);
    weight[4 * k] = t.weight[static_cast<size_t>(m)] + 1e-6;
    for (Index axis = 0; axis < 3; ++axis) {
      const RowVector3d step = RowVector3d::Unit(axis);
      from.row(4 * k + 1 + axis) = t.p.row(m) + arm / scale * step;
      to.row(4 * k + 1 + axis) = t.q.row(m) + arm * (rotation * step.transpose()).transpose();
      weight[4 * k + 1 + axis] = 0.1 * weight[4 * k];
    }
  }
  const bool fits_scale = options.with_scale && count >= 3;
  Pose pose = fit_pose(from, to, weight, fits_scale);
  if (!fits_scale) {
    // fit_pose() took the scale as 1: the centres hold with any.
    const double total = weight.sum();
    const Eigen::Vector3d a = from.transpose() * weight / total;
    const Eigen::Vector3d b = to.transpose() * weight / total;
    pose.scale = scale;
    pose.translation = b - scale * (pose.rotation * a);
  }
  return pose;
}

std::vector<std::int32_t> agreeing(const MatchTable& t, const PoseHypothesis& found,
                                   const PoseSearchOptions& options, double bound) {
  const Points moved = transformed(t.p, found.pose);
  const Points normals = turned(t.np, found.pose);
  std::vector<std::int32_t> members;
  for (Index m = 0; m < moved.rows(); ++m) {
    const auto k = static_cast<size_t>(m);
    if ((t.flipped[k] != 0) != found.is_flipped) continue;
    if ((moved.row(m) - t.q.row(m)).norm() > bound * options.position_error) continue;
    if (normals.row(m).dot(t.nq.row(m)) < 0.8) continue;
    if (rotation_angle(t.rotation[k], found.pose.rotation) > kFrameAngle) continue;
    members.push_back(static_cast<std::int32_t>(m));
  }
  return members;
}

PoseHypothesis grow(const MatchTable& t, std::vector<std::int32_t> members,
                    const PoseSearchOptions& options) {
  PoseHypothesis found;
  found.is_flipped = t.flipped[static_cast<size_t>(members[0])] != 0;
  found.pose = fit_frames(t, members, options);
  found.members = members;
  for (const double bound : {3.0, 2.0, 2.0}) {
    std::vector<std::int32_t> inside = agreeing(t, found, options, bound);
    if (inside.size() < 2) break;  // the frames of one match are the better guess
    found.members = std::move(inside);
    found.pose = fit_frames(t, found.members, options);
  }
  for (const std::int32_t m : found.members) found.support += t.weight[static_cast<size_t>(m)];
  return found;
}

bool is_same(const PoseHypothesis& a, const PoseHypothesis& b, const RowVector3d& center,
             double distance) {
  if (a.is_flipped != b.is_flipped) return false;
  if (rotation_angle(a.pose.rotation, b.pose.rotation) > 8.0 * std::numbers::pi / 180.0)
    return false;
  const Points at = center;
  return (transformed(at, a.pose) - transformed(at, b.pose)).norm() < distance &&
         std::abs(std::log(a.pose.scale / b.pose.scale)) < 0.1;
}

}  // namespace

std::vector<PoseHypothesis> search_poses(const ScanFeatures& moving, const ScanFeatures& fixed,
                                         const std::vector<FeatureMatch>& matches,
                                         const PoseSearchOptions& options, const RunControl& run) {
  std::vector<PoseHypothesis> found;
  if (matches.empty()) return found;
  const MatchTable table(moving, fixed, matches);
  const ConsistencyGraph graph(table.p.rows(), Consistency(table, options), run);
  Eigen::VectorXd support = graph.support(run);
  if (run.cancelled()) return found;
  std::vector<std::int32_t> order(matches.size());
  std::iota(order.begin(), order.end(), 0);
  // A match without partners may still be right: its own weight orders those.
  for (size_t m = 0; m < matches.size(); ++m) support[static_cast<Index>(m)] += matches[m].weight;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return support[a] > support[b]; });
  const RowVector3d center = moving.coarse.colwise().mean();
  const size_t tries =
      std::min<size_t>(order.size(), 2 * static_cast<size_t>(options.max_hypotheses));
  for (size_t k = 0; k < tries && !run.cancelled(); ++k) {
    PoseHypothesis grown = grow(table, graph.partners(order[k], 16), options);
    const auto same = std::find_if(found.begin(), found.end(), [&](const PoseHypothesis& other) {
      return is_same(grown, other, center, 4.0 * options.position_error);
    });
    if (same == found.end()) {
      found.push_back(std::move(grown));
    } else if (grown.support > same->support) {
      *same = std::move(grown);
    }
  }
  std::stable_sort(
      found.begin(), found.end(),
      [](const PoseHypothesis& a, const PoseHypothesis& b) { return a.support > b.support; });
  if (found.size() > static_cast<size_t>(options.max_hypotheses))
    found.resize(static_cast<size_t>(options.max_hypotheses));
  return found;
}

}  // namespace dupin::detail
