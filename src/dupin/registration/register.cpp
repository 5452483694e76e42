#include "dupin/registration/register.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/registration/assessment.h"
#include "dupin/registration/height_maps.h"
#include "dupin/registration/icp.h"
#include "dupin/registration/pose_search.h"
#include "dupin/registration/scan_samples.h"

namespace dupin {
namespace {

using detail::AssessmentBounds;
using detail::FeatureMatch;
using detail::PoseHypothesis;
using detail::ScanSamples;
using Eigen::Index;
using std::size_t;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr int kRings = 8;        // height maps for a known scale
constexpr int kScaleRings = 12;  // for an unknown one

void check(const RegistrationOptions& options) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw InvalidArgument(what);
  };
  require(std::isfinite(options.scale) && options.scale > 0.0, "scale must be finite and > 0");
  require(std::isfinite(options.given_pose.scale) && options.given_pose.scale > 0.0,
          "the scale of given_pose must be finite and > 0");
  require(options.max_rotation >= 0.0, "max_rotation must be >= 0");
  require(options.min_confidence >= 0.0 && options.min_confidence <= 1.0,
          "min_confidence must be in [0, 1]");
}

std::vector<FeatureMatch> find_matches(const ScanFeatures& moving, const ScanFeatures& fixed,
                                       const RegistrationOptions& options, bool is_flipped,
                                       const RunControl& run) {
  detail::MapMatchOptions wanted;
  int rings = kRings;
  double base_fixed = 4.0 * std::max(fixed.mean_edge, options.scale * moving.mean_edge);
  double base_moving = base_fixed / options.scale;
  if (options.estimate_scale) {
    rings = kScaleRings;
    wanted.max_shift = 3;
    base_fixed = 3.0 * fixed.mean_edge;
    base_moving = 3.0 * moving.mean_edge;
  }
  const detail::HeightMaps of_fixed = detail::build_height_maps(fixed, base_fixed, rings, run);
  detail::HeightMaps of_moving = detail::build_height_maps(moving, base_moving, rings, run);
  if (run.cancelled()) return {};
  if (is_flipped) of_moving = detail::flipped(of_moving);
  std::vector<FeatureMatch> matches =
      detail::match_height_maps(moving, of_moving, fixed, of_fixed, is_flipped, wanted, run);
  if (matches.size() > 800) matches.resize(800);
  return matches;
}

double score_of(const PoseFit& fit) {
  return (fit.overlap_moving + fit.overlap_fixed) * std::exp(-fit.conflict / 0.06);
}

// The least resistance to a motion over the mean resistance, from the information of ICP.
double stability_of(const IcpResult& icp, bool with_scale) {
  const Index size = with_scale ? 7 : 6;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      icp.information.topLeftCorner(size, size));
  if (!(icp.information.trace() > 0.0)) return 0.0;
  return std::max(0.0, eigen.eigenvalues()[0]) * static_cast<double>(size) /
         icp.information.trace();
}

// Each pair of patches averages the noise of the points below it; what remains of the pose is as if
// all points of the overlap had voted (docs/methods/registration.md).
Matrix7 covariance_of(const IcpResult& icp, const SurfaceSamples& moving,
                      const SurfaceSamples& fixed, const PoseFit& fit, bool with_scale) {
  const Index size = with_scale ? 7 : 6;
  Matrix7 covariance = Matrix7::Zero();
  const double moving_points = fit.overlap_moving * static_cast<double>(moving.num_points);
  const double fixed_points = fit.overlap_fixed * static_cast<double>(fixed.num_points);
  if (!(moving_points > 0.0) || !(fixed_points > 0.0) || !(icp.extent > 0.0)) return covariance;
  const double moving_sigma = icp.pose.scale * moving.noise_sigma;
  const double variance = moving_sigma * moving_sigma / moving_points +
                          fixed.noise_sigma * fixed.noise_sigma / fixed_points;
  const Eigen::MatrixXd information = icp.information.topLeftCorner(size, size);
  covariance.topLeftCorner(size, size) =
      information.completeOrthogonalDecomposition().pseudoInverse() * variance;
  Eigen::Matrix<double, 7, 1> unit;
  unit << Eigen::Vector3d::Constant(1.0 / icp.extent), Eigen::Vector3d::Ones(), 1.0 / icp.extent;
  return unit.asDiagonal() * covariance * unit.asDiagonal();
}

RegistrationResult cancelled_result() {
  RegistrationResult result;
  result.status = Status::cancelled;
  return result;
}

// A pose on its way from the features to the surfaces.
struct Trial {
  PoseCandidate candidate;
  Pose start;  // what the features say
  std::vector<FeaturePair> pairs;
};

class Search {
 public:
  Search(const ScanFeatures& moving, const ScanFeatures& fixed, const RegistrationOptions& options,
         const RunControl& run)
      : moving_(moving), fixed_(fixed), options_(options), run_(run) {}

  RegistrationResult solve() {
    RegistrationResult result;
    const double scale = options_.estimate_scale && moving_.mean_edge > 0.0
                             ? fixed_.mean_edge / moving_.mean_edge
                             : options_.scale;
    samples_ = detail::sample_coarsely(moving_, fixed_, scale, run_.stage(0.0, 0.2));
    // Of bare points nobody knows which side is outward: the other one is tried where the first
    // did not convince. After that every hypothesis gets its chance, not only the best supported.
    const bool is_sure = moving_.has_sides && fixed_.has_sides;
    std::vector<Trial> starts = propose(false, result);
    try_starts(starts);
    if (!is_convincing() && !is_sure) {
      const std::vector<Trial> others = propose(true, result);
      try_starts(others);
      starts.insert(starts.end(), others.begin(), others.end());
    }
    if (!is_convincing()) try_all(starts);
    if (run_.cancelled()) return cancelled_result();
    if (!trials_.empty()) conclude(result);
    return run_.cancelled() ? cancelled_result() : result;
  }

 private:
  std::vector<Trial> propose(bool is_flipped, RegistrationResult& result) {
    const std::vector<FeatureMatch>& matches = matches_[is_flipped ? 1 : 0] =
        find_matches(moving_, fixed_, options_, is_flipped, run_.stage(0.2, 0.5));
    result.num_matches += static_cast<Index>(matches.size());
    detail::PoseSearchOptions search;
    search.position_error =
        options_.estimate_scale
            ? 4.0 * fixed_.mean_edge
            : 3.0 * std::max(fixed_.mean_edge, options_.scale * moving_.mean_edge);
    search.with_scale = options_.estimate_scale;
    search.scale = options_.scale;
    std::vector<PoseHypothesis> found =
        detail::search_poses(moving_, fixed_, matches, search, run_.stage(0.5, 0.6));
    if (options_.try_given_pose) {
      PoseHypothesis given;
      given.pose = options_.given_pose;
      given.is_flipped = is_flipped;
      found.push_back(given);
    }
    std::vector<Trial> starts;
    for (const PoseHypothesis& hypothesis : found) starts.push_back(start(hypothesis, matches));
    return starts;
  }

  bool is_convincing() const {
    return std::any_of(trials_.begin(), trials_.end(), [](const Trial& trial) {
      return trial.candidate.confidence > 0.95 && trial.candidate.fit.conflict < 0.05;
    });
  }

  // Steps of ICP on every so many samples, and how the surfaces lie then.
  void refine_roughly(PoseCandidate& candidate, int max_iterations, Index wanted_samples) {
    IcpOptions icp;
    icp.with_scale = options_.estimate_scale;
    icp.is_flipped = candidate.is_flipped;
    icp.start_distance = 3.0 * samples_.fixed.spacing;
    icp.max_iterations = max_iterations;
    icp.every = std::max<Index>(1, samples_.moving.points.rows() / wanted_samples);
    icp.tolerance = 1e-2;
    candidate.pose =
        refine_pose(samples_.moving, samples_.fixed, candidate.pose, icp, run_.stage(0.6, 0.6))
            .pose;
    candidate.fit = detail::assess_pose(samples_.moving, samples_.fixed, candidate.pose,
                                        candidate.is_flipped, samples_.bounds, icp.every);
  }

  Trial start(const PoseHypothesis& hypothesis, const std::vector<FeatureMatch>& matches) const {
    Trial trial;
    trial.start = hypothesis.pose;
    trial.candidate.pose = hypothesis.pose;
    trial.candidate.is_flipped = hypothesis.is_flipped;
    trial.candidate.matches = static_cast<int>(hypothesis.members.size());
    for (const std::int32_t m : hypothesis.members)
      trial.pairs.push_back(vertices_of(matches[static_cast<size_t>(m)]));
    return trial;
  }

  FeaturePair vertices_of(const FeatureMatch& match) const {
    return {moving_.anchors[static_cast<size_t>(match.moving)].vertex,
            fixed_.anchors[static_cast<size_t>(match.fixed)].vertex};
  }

  std::vector<FeaturePair> others_of(const RegistrationResult& result) const {
    std::set<std::pair<std::int32_t, std::int32_t>> told;
    for (const FeaturePair& pair : result.correspondences) told.emplace(pair.moving, pair.fixed);
    std::vector<FeaturePair> others;
    for (const FeatureMatch& match : matches_[result.best.is_flipped ? 1 : 0]) {
      const FeaturePair pair = vertices_of(match);
      if (told.emplace(pair.moving, pair.fixed).second) others.push_back(pair);
    }
    return others;
  }

  void finish_rough(Trial trial) {
    trial.candidate.confidence =
        detail::plain_confidence_of(trial.candidate.fit, trial.candidate.matches);
    trials_.push_back(std::move(trial));
  }

  // Half of the places go to the hypotheses that most features agree on, half to those that fit
  // best as they are: a round body fits in many poses, a scan of few features has few matches.
  void try_starts(const std::vector<Trial>& starts) {
    AssessmentBounds loose = samples_.bounds;
    loose.touching = 0.6 * samples_.fixed.spacing;
    const Index every = std::max<Index>(1, samples_.moving.points.rows() / 300);
    std::vector<std::pair<double, size_t>> ranked;
    for (size_t h = 0; h < starts.size() && !run_.cancelled(); ++h) {
      const PoseFit fit =
          detail::assess_pose(samples_.moving, samples_.fixed, starts[h].candidate.pose,
                              starts[h].candidate.is_flipped, loose, every);
      ranked.emplace_back(-(fit.overlap_moving + fit.overlap_fixed) * (1.0 - fit.conflict), h);
    }
    const auto supported = std::min<size_t>(ranked.size(), 12);
    std::sort(ranked.begin() + static_cast<std::ptrdiff_t>(supported), ranked.end());
    if (ranked.size() > 2 * supported) ranked.resize(2 * supported);
    double done = 0.0;
    for (const auto& [score, h] : ranked) {
      if (run_.cancelled()) return;
      Trial trial = starts[h];
      refine_roughly(trial.candidate, 12, 600);
      finish_rough(std::move(trial));
      run_.report(0.6 + 0.1 * ++done / static_cast<double>(ranked.size()));
    }
  }

  void try_all(std::vector<Trial> trials) {
    std::vector<std::pair<double, size_t>> ranked;
    for (size_t h = 0; h < trials.size(); ++h) {
      if (run_.cancelled()) return;
      refine_roughly(trials[h].candidate, 8, 300);
      ranked.emplace_back(-score_of(trials[h].candidate.fit), h);
      run_.report(0.7 + 0.1 * static_cast<double>(h + 1) / static_cast<double>(trials.size()));
    }
    std::sort(ranked.begin(), ranked.end());
    if (ranked.size() > 12) ranked.resize(12);
    for (const auto& [score, h] : ranked) {
      if (run_.cancelled()) return;
      refine_roughly(trials[h].candidate, 20, 1000);
      finish_rough(std::move(trials[h]));
    }
  }

  // ICP on the fine samples; judged on the coarse ones, which noise and detail disturb less.
  IcpResult refine_fully(PoseCandidate& candidate, const ScanSamples& fine, const RunControl& run) {
    IcpOptions icp;
    icp.with_scale = options_.estimate_scale;
    icp.is_flipped = candidate.is_flipped;
    icp.start_distance = 2.0 * fine.fixed.spacing;
    const IcpResult refined = refine_pose(fine.moving, fine.fixed, candidate.pose, icp, run);
    candidate.pose = refined.pose;
    candidate.fit = detail::assess_pose(samples_.moving, samples_.fixed, candidate.pose,
                                        candidate.is_flipped, samples_.bounds);
    candidate.fit.stability = stability_of(refined, options_.estimate_scale);
    candidate.confidence = detail::confidence_of(candidate.fit, candidate.matches);
    return refined;
  }

  bool is_same(const Pose& a, const Pose& b) const {
    const Points center = moving_.coarse.colwise().mean();
    return rotation_angle(a.rotation, b.rotation) < 0.1 &&
           (transformed(center, a) - transformed(center, b)).norm() < 0.05 * fixed_.diameter &&
           std::abs(std::log(a.scale / b.scale)) < 0.1;
  }

  void conclude(RegistrationResult& result) {
    // What turns too far counts only if nothing else is there.
    const auto is_allowed = [&](const Trial& trial) { return turns_within(trial.candidate.pose); };
    std::stable_sort(trials_.begin(), trials_.end(), [&](const Trial& a, const Trial& b) {
      if (is_allowed(a) != is_allowed(b)) return is_allowed(a);
      return score_of(a.candidate.fit) > score_of(b.candidate.fit);
    });
    Trial& winner = trials_.front();
    if (options_.estimate_scale) refine_roughly(winner.candidate, 30, 1000);
    const ScanSamples fine_samples =
        detail::sample_finely(moving_, fixed_, winner.candidate.pose.scale, run_.stage(0.8, 0.9));
    if (run_.cancelled()) return;
    const IcpResult fine = refine_fully(winner.candidate, fine_samples, run_.stage(0.9, 1.0));
    const double score = score_of(winner.candidate.fit);
    for (size_t k = 1; k < trials_.size() && result.alternatives.size() < 8; ++k) {
      PoseCandidate other = trials_[k].candidate;
      if (score_of(other.fit) < 0.6 * score || is_same(other.pose, winner.candidate.pose)) continue;
      refine_fully(other, fine_samples, run_.stage(0.9, 0.9));
      const auto is_known = [&](const PoseCandidate& known) {
        return is_same(known.pose, other.pose);
      };
      if (score_of(other.fit) < 0.9 * score || is_known(winner.candidate) ||
          std::any_of(result.alternatives.begin(), result.alternatives.end(), is_known)) {
        continue;
      }
      result.alternatives.push_back(other);
    }
    result.best = winner.candidate;
    if (!options_.refine) result.best.pose = winner.start;
    result.pose = result.best.pose;
    result.correspondences = std::move(winner.pairs);
    result.other_matches = others_of(result);
    result.center = fine.center;
    result.refusal = judge(result.best);
    result.accepted = result.refusal == Refusal::none;
    if (result.accepted && options_.refine) {
      result.covariance = covariance_of(fine, fine_samples.moving, fine_samples.fixed,
                                        result.best.fit, options_.estimate_scale);
    }
  }

  Refusal judge(const PoseCandidate& best) const {
    if (best.fit.num_pairs < detail::kFewestPairs)
      return best.matches == 0 ? Refusal::no_features : Refusal::no_overlap;
    if (best.fit.stability < 1e-3) return Refusal::undetermined;
    if (best.confidence < options_.min_confidence)
      return best.fit.conflict > 0.05 ? Refusal::contradicted : Refusal::unsure;
    return turns_within(best.pose) ? Refusal::none : Refusal::rotation;
  }

  bool turns_within(const Pose& pose) const {
    return rotation_angle(Eigen::Matrix3d::Identity(), pose.rotation) <= options_.max_rotation;
  }

  const ScanFeatures& moving_;
  const ScanFeatures& fixed_;
  const RegistrationOptions& options_;
  const RunControl& run_;
  ScanSamples samples_;
  std::vector<Trial> trials_;
  std::array<std::vector<FeatureMatch>, 2> matches_;  // as the normals are, and flipped
};

}  // namespace

RegistrationResult register_scans(const ScanFeatures& moving, const ScanFeatures& fixed,
                                  const RegistrationOptions& options, RunControl run) {
  check(options);
  if (moving.status == Status::cancelled || fixed.status == Status::cancelled)
    return cancelled_result();
  if (moving.coarse.rows() == 0 || fixed.coarse.rows() == 0)
    throw InvalidArgument("a scan has no points: describe_scan() makes its features");
  return Search(moving, fixed, options, run).solve();
}

}  // namespace dupin
