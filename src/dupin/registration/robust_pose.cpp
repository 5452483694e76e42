#include "dupin/registration/robust_pose.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "dupin/base/error.h"
#include "dupin/registration/consistency.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using std::size_t;

constexpr Index kMaxMatches = 8192;

void check(const Points& from, const Points& to, const RobustPoseOptions& options) {
  if (from.rows() != to.rows()) {
    throw InvalidArgument("there are " + std::to_string(from.rows()) + " points and " +
                          std::to_string(to.rows()) + " places");
  }
  for (const Points* points : {&from, &to}) {
    for (Index i = 0; i < points->size(); ++i) {
      if (!(std::abs(points->data()[i]) <= 1e150))
        throw InvalidArgument("a coordinate is not finite or beyond 1e150");
    }
  }
  if (!std::isfinite(options.noise_bound) || !(options.noise_bound > 0.0))
    throw InvalidArgument("noise_bound must be finite and > 0");
  if (options.seeds < 1) throw InvalidArgument("seeds is below 1");
  if (from.rows() > kMaxMatches) {
    throw Error(Errc::over_limit, "E_TOO_LARGE",
                std::to_string(from.rows()) + " matches, at most " + std::to_string(kMaxMatches));
  }
}

// Scales that stand out in the histogram of log distance ratios: right matches agree on one, wrong
// ones spread. The background is what neighbouring bins hold.
std::vector<double> vote_scales(const Points& from, const Points& to, double noise_bound,
                                const RunControl& run) {
  constexpr double kBin = 0.02;
  constexpr Index kHalf = 1000;  // e^-20 .. e^20
  VectorXd votes = VectorXd::Zero(2 * kHalf + 1);
  for (Index i = 0; i < from.rows() && !run.cancelled(); ++i) {
    for (Index j = i + 1; j < from.rows(); ++j) {
      const double a = (from.row(i) - from.row(j)).norm();
      const double b = (to.row(i) - to.row(j)).norm();
      // A short distance says little of the scale.
      if (!(a > 0.0) || !(b > 6.0 * noise_bound)) continue;
      const double bin = std::log(b / a) / kBin + kHalf;
      if (!(bin >= 0.0 && bin <= 2 * kHalf)) continue;
      votes[static_cast<Index>(std::lround(bin))] += 1.0;
    }
  }
  VectorXd excess = VectorXd::Zero(votes.size());
  for (Index k = 1; k + 1 < votes.size(); ++k) {
    double around = 0.0;
    Index count = 0;
    for (Index d = 4; d <= 12; ++d) {
      for (const Index m : {k - d, k + d}) {
        if (m < 0 || m >= votes.size()) continue;
        around += votes[m];
        ++count;
      }
    }
    const double mean = around / static_cast<double>(std::max<Index>(count, 1));
    excess[k] = (votes.segment(k - 1, 3).sum() - 3.0 * mean) / std::sqrt(3.0 * mean + 1.0);
  }
  std::vector<double> scales;
  for (int n = 0; n < 4; ++n) {
    Index peak = 0;
    if (!(excess.maxCoeff(&peak) > 0.0)) break;
    scales.push_back(std::exp(kBin * static_cast<double>(peak - kHalf)));
    for (Index k = std::max<Index>(0, peak - 3); k <= std::min(peak + 3, votes.size() - 1); ++k)
      excess[k] = 0.0;
  }
  return scales;
}

std::vector<std::int32_t> within(const Points& from, const Points& to, const Pose& pose,
                                 double bound) {
  const Points moved = transformed(from, pose);
  std::vector<std::int32_t> inside;
  for (Index i = 0; i < from.rows(); ++i) {
    if ((moved.row(i) - to.row(i)).norm() <= bound) inside.push_back(static_cast<std::int32_t>(i));
  }
  return inside;
}

// Fit to `members`; false if they determine none.
bool fit_members(const Points& from, const Points& to, const std::vector<std::int32_t>& members,
                 bool with_scale, Pose& pose) {
  if (members.size() < 3) return false;
  Points a(static_cast<Index>(members.size()), 3);
  Points b(a.rows(), 3);
  for (Index k = 0; k < a.rows(); ++k) {
    a.row(k) = from.row(members[static_cast<size_t>(k)]);
    b.row(k) = to.row(members[static_cast<size_t>(k)]);
  }
  try {
    pose = fit_pose(a, b, {}, with_scale);
  } catch (const AnalysisError&) {
    return false;  // on one line: another seed may do better
  }
  return true;
}

// Grows a pose from the most consistent partners of one seed.
void grow(const Points& from, const Points& to, const RobustPoseOptions& options,
          const std::vector<std::int32_t>& start, RobustPose& best) {
  Pose pose;
  std::vector<std::int32_t> members = start;
  double bound = 3.0 * options.noise_bound;
  for (int round = 0; round < 6; ++round) {
    if (!fit_members(from, to, members, options.with_scale, pose)) return;
    std::vector<std::int32_t> inside = within(from, to, pose, bound);
    if (round >= 2 && inside == members) break;
    members = std::move(inside);
    bound = options.noise_bound;
  }
  members = within(from, to, pose, options.noise_bound);
  if (members.size() <= best.inliers.size()) return;
  best.inliers = std::move(members);
  best.pose = pose;
}

RobustPose cancelled_result() {
  RobustPose result;
  result.status = Status::cancelled;
  return result;
}

}  // namespace

RobustPose robust_pose(const Points& from, const Points& to, const RobustPoseOptions& options,
                       RunControl run) {
  check(from, to, options);
  RobustPose best;
  const std::vector<double> scales = options.with_scale
                                         ? vote_scales(from, to, options.noise_bound, run)
                                         : std::vector<double>{1.0};
  for (const double scale : scales) {
    if (run.cancelled()) return cancelled_result();
    const detail::ConsistencyGraph graph(
        from.rows(),
        [&](Index i, Index j) {
          const double a = scale * (from.row(i) - from.row(j)).norm();
          const double b = (to.row(i) - to.row(j)).norm();
          const double slack = options.with_scale ? 0.03 * b : 0.0;
          // Matches of one point with two places cannot both be right.
          return a > 0.0 && b > 0.0 && std::abs(a - b) <= 1.5 * options.noise_bound + slack;
        },
        run);
    const VectorXd support = graph.support(run);
    std::vector<std::int32_t> order(static_cast<size_t>(from.rows()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t i, std::int32_t j) { return support[i] > support[j]; });
    const auto count = std::min<size_t>(order.size(), static_cast<size_t>(options.seeds));
    for (size_t k = 0; k < count && !run.cancelled(); ++k)
      grow(from, to, options, graph.partners(order[k], 24), best);
  }
  if (run.cancelled()) return cancelled_result();
  best.is_found = best.inliers.size() >= (from.rows() <= 10 ? 3U : 4U);
  return best;
}

}  // namespace dupin
