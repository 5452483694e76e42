#include "dupin/registration/register_all.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/registration/icp.h"
#include "dupin/registration/surface_samples.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using std::size_t;

constexpr double kLoopAngle = 0.06;  // [rad] closing error of three pairs that agree
constexpr double kLoopShift = 0.02;  // the same, in diameters
constexpr double kTreeFactor = 2.0;  // a pair may deviate from the tree by so much more

void check(const std::vector<ScanFeatures>& scans, const RegisterAllOptions& options) {
  if (scans.size() < 2) throw InvalidArgument("there are fewer than two scans");
  if (options.max_iterations < 0) throw InvalidArgument("max_iterations is negative");
  if (!(options.min_confidence >= 0.0) || options.min_confidence > 1.0)
    throw InvalidArgument("min_confidence must be in [0, 1]");
}

Points center_of(const ScanFeatures& scan) { return scan.coarse.colwise().mean(); }

// Do two poses of one scan agree within `factor` closing errors?
bool agrees(const Pose& a, const Pose& b, const ScanFeatures& scan, double factor) {
  const Points center = center_of(scan);
  return rotation_angle(a.rotation, b.rotation) < factor * kLoopAngle &&
         (transformed(center, a) - transformed(center, b)).norm() <
             factor * kLoopShift * scan.diameter;
}

class Assembly {
 public:
  Assembly(const std::vector<ScanFeatures>& scans, const RegisterAllOptions& options,
           const RunControl& run)
      : scans_(scans), options_(options), run_(run) {}

  RegisterAllResult solve() {
    result_.poses.resize(scans_.size());
    register_pairs();
    if (!run_.cancelled()) span();
    if (!run_.cancelled()) refine();
    if (!run_.cancelled()) close_loops();
    if (!run_.cancelled()) return std::move(result_);
    RegisterAllResult cancelled;
    cancelled.status = Status::cancelled;
    return cancelled;
  }

 private:
  void register_pairs() {
    const size_t count = scans_.size() * (scans_.size() - 1) / 2;
    RegistrationOptions of_pair;
    of_pair.estimate_scale = false;
    of_pair.min_confidence = options_.min_confidence;
    size_t done = 0;
    for (size_t i = 0; i < scans_.size(); ++i) {
      for (size_t j = i + 1; j < scans_.size() && !run_.cancelled(); ++j, ++done) {
        const double from = 0.9 * static_cast<double>(done) / static_cast<double>(count);
        const double to = 0.9 * static_cast<double>(done + 1) / static_cast<double>(count);
        const RegistrationResult found =
            register_scans(scans_[i], scans_[j], of_pair, run_.stage(from, to));
        if (!found.accepted) {
          result_.refused.push_back(
              {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j), found.refusal});
          continue;
        }
        ScanPairResult pair;
        pair.moving = static_cast<std::int32_t>(i);
        pair.fixed = static_cast<std::int32_t>(j);
        pair.pose = found.pose;
        pair.fit = found.best.fit;
        pair.confidence = found.best.confidence;
        result_.pairs.push_back(pair);
        flipped_.push_back(found.best.is_flipped ? 1 : 0);
      }
    }
  }

  // The pose from scan a to scan b that the pairs hold, if there is one.
  std::optional<Pose> between(std::int32_t a, std::int32_t b) const {
    const std::int32_t k = pair_of_[place_of(std::min(a, b), std::max(a, b))];
    if (k < 0) return std::nullopt;
    const Pose& pose = result_.pairs[static_cast<size_t>(k)].pose;
    return a < b ? pose : inverse(pose);
  }

  size_t place_of(std::int32_t moving, std::int32_t fixed) const {
    return static_cast<size_t>(moving) * scans_.size() + static_cast<size_t>(fixed);
  }

  // Triangles that a pair closes without error, less those that it closes with one.
  int votes_for(const ScanPairResult& pair) const {
    int votes = 0;
    for (size_t k = 0; k < scans_.size(); ++k) {
      const auto c = static_cast<std::int32_t>(k);
      const std::optional<Pose> first = between(pair.moving, c);
      const std::optional<Pose> second = between(c, pair.fixed);
      if (!first || !second) continue;
      const ScanFeatures& scan = scans_[static_cast<size_t>(pair.moving)];
      votes += agrees(compose(*second, *first), pair.pose, scan, 1.0) ? 1 : -1;
    }
    return votes;
  }

  std::int32_t root_of(std::int32_t scan) {
    while (parent_[static_cast<size_t>(scan)] != scan) scan = parent_[static_cast<size_t>(scan)];
    return scan;
  }

  // Kruskal's tree by votes, then confidence times overlap; poses by walking it.
  void span() {
    pair_of_.assign(scans_.size() * scans_.size(), -1);
    for (size_t k = 0; k < result_.pairs.size(); ++k) {
      const ScanPairResult& pair = result_.pairs[k];
      pair_of_[place_of(pair.moving, pair.fixed)] = static_cast<std::int32_t>(k);
    }
    std::vector<std::pair<double, size_t>> order;
    for (size_t k = 0; k < result_.pairs.size(); ++k) {
      const ScanPairResult& pair = result_.pairs[k];
      const double weight = votes_for(pair) + pair.confidence * std::max(pair.fit.overlap_moving,
                                                                         pair.fit.overlap_fixed);
      order.emplace_back(-weight, k);
    }
    std::sort(order.begin(), order.end());
    parent_.resize(scans_.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    std::vector<size_t> tree;
    for (const auto& [weight, k] : order) {
      const std::int32_t a = root_of(result_.pairs[k].moving);
      const std::int32_t b = root_of(result_.pairs[k].fixed);
      if (a == b) continue;
      parent_[static_cast<size_t>(std::max(a, b))] = std::min(a, b);
      tree.push_back(k);
    }
    std::vector<int> size(scans_.size(), 0);
    for (size_t i = 0; i < scans_.size(); ++i)
      ++size[static_cast<size_t>(root_of(static_cast<std::int32_t>(i)))];
    const auto largest = std::max_element(size.begin(), size.end());
    if (*largest < 2) return;
    result_.reference = static_cast<std::int32_t>(largest - size.begin());
    result_.poses[static_cast<size_t>(result_.reference)] = Pose();
    for (size_t round = 0; round < scans_.size(); ++round) {
      for (const size_t k : tree) place_neighbor(result_.pairs[k]);
    }
    for (ScanPairResult& pair : result_.pairs) {
      const std::optional<Pose>& a = result_.poses[static_cast<size_t>(pair.moving)];
      const std::optional<Pose>& b = result_.poses[static_cast<size_t>(pair.fixed)];
      pair.is_used = a && b &&
                     agrees(compose(inverse(*b), *a), pair.pose,
                            scans_[static_cast<size_t>(pair.moving)], kTreeFactor);
    }
  }

  void place_neighbor(const ScanPairResult& pair) {
    std::optional<Pose>& a = result_.poses[static_cast<size_t>(pair.moving)];
    std::optional<Pose>& b = result_.poses[static_cast<size_t>(pair.fixed)];
    if (a && !b) b = compose(*a, inverse(pair.pose));
    if (b && !a) a = compose(*b, pair.pose);
  }

  // All poses but the reference's at once: every pair of surfaces pulls at both of its scans.
  void refine() {
    if (result_.reference < 0) return;
    double spacing = 0.0;
    for (size_t i = 0; i < scans_.size(); ++i) {
      if (!result_.poses[i]) continue;
      spacing = std::max({spacing, 2.0 * scans_[i].mean_edge, scans_[i].diameter / 90.0});
    }
    samples_.resize(scans_.size());
    for (size_t i = 0; i < scans_.size() && !run_.cancelled(); ++i) {
      if (!result_.poses[i]) continue;
      samples_[i] = sample_surface(scans_[i].coarse, scans_[i].coarse_normals,
                                   {spacing, 1.7 * spacing}, run_);
    }
    for (int it = 0; it <= options_.max_iterations && !run_.cancelled(); ++it) {
      const double bound = std::max(0.8, 2.0 * std::pow(0.8, it)) * spacing;
      const bool is_last = it == options_.max_iterations;
      const double step = pull_together(bound, !is_last);
      run_.report(0.9 + 0.1 * it / std::max(1, options_.max_iterations));
      if (step < 1e-5 * spacing && it > 8) break;
    }
  }

  void close_loops() {
    for (ScanPairResult& pair : result_.pairs) {
      const std::optional<Pose>& a = result_.poses[static_cast<size_t>(pair.moving)];
      const std::optional<Pose>& b = result_.poses[static_cast<size_t>(pair.fixed)];
      if (!a || !b) continue;
      const Pose joint = compose(inverse(*b), *a);
      const Points center = center_of(scans_[static_cast<size_t>(pair.moving)]);
      pair.loop_turn = rotation_angle(joint.rotation, pair.pose.rotation);
      pair.loop_shift = (transformed(center, joint) - transformed(center, pair.pose)).norm();
    }
  }

  // One joint step of Gauss-Newton; the largest shift that it makes. Sets rmse.
  double pull_together(double bound, bool moves) {
    const auto count = static_cast<Index>(scans_.size());
    MatrixXd normal_matrix = MatrixXd::Zero(6 * count, 6 * count);
    VectorXd right = VectorXd::Zero(6 * count);
    double squares = 0.0;
    Index num_pairs = 0;
    for (size_t k = 0; k < result_.pairs.size(); ++k) {
      const ScanPairResult& pair = result_.pairs[k];
      if (!pair.is_used) continue;
      const auto i = static_cast<size_t>(pair.moving);
      const auto j = static_cast<size_t>(pair.fixed);
      const Pose& to_frame = *result_.poses[j];
      const std::vector<detail::SurfacePair> found = detail::find_pairs(
          samples_[i], samples_[j], compose(inverse(to_frame), *result_.poses[i]), flipped_[k] != 0,
          bound);
      for (const detail::SurfacePair& one : found) {
        squares += one.distance * one.distance;
        ++num_pairs;
        const double u = one.distance / bound;
        const double weight = one.weight * (1.0 - u * u) * (1.0 - u * u);
        const Vector3d at = to_frame.rotation * one.point.transpose() + to_frame.translation;
        const Vector3d n = to_frame.rotation * one.normal.transpose();
        Eigen::Matrix<double, 6, 1> g;
        g << at.cross(n), n;
        const Index a = 6 * static_cast<Index>(i);
        const Index b = 6 * static_cast<Index>(j);
        const Eigen::Matrix<double, 6, 6> block = weight * g * g.transpose();
        normal_matrix.block<6, 6>(a, a) += block;
        normal_matrix.block<6, 6>(b, b) += block;
        normal_matrix.block<6, 6>(a, b) -= block;
        normal_matrix.block<6, 6>(b, a) -= block;
        right.segment<6>(a) -= weight * one.distance * g;
        right.segment<6>(b) += weight * one.distance * g;
      }
    }
    result_.rmse = num_pairs > 0 ? std::sqrt(squares / static_cast<double>(num_pairs)) : 0.0;
    if (!moves || num_pairs == 0) return 0.0;
    return move_all(normal_matrix, right);
  }

  double move_all(MatrixXd& normal_matrix, const VectorXd& right) {
    const auto count = static_cast<Index>(scans_.size());
    const double ridge = 1e-9 * normal_matrix.trace() / static_cast<double>(6 * count) + 1e-300;
    normal_matrix.diagonal().array() += ridge;
    const Index fixed = 6 * result_.reference;
    normal_matrix.middleRows(fixed, 6).setZero();
    normal_matrix.middleCols(fixed, 6).setZero();
    normal_matrix.block<6, 6>(fixed, fixed).setIdentity();
    VectorXd target = right;
    target.segment<6>(fixed).setZero();
    const VectorXd x = normal_matrix.ldlt().solve(target);
    double largest = 0.0;
    for (Index i = 0; i < count; ++i) {
      std::optional<Pose>& pose = result_.poses[static_cast<size_t>(i)];
      if (!pose) continue;
      Pose change;
      change.rotation = rotation_of(x.segment<3>(6 * i));
      change.translation = x.segment<3>(6 * i + 3);
      const Points center = transformed(center_of(scans_[static_cast<size_t>(i)]), *pose);
      largest = std::max(largest, (transformed(center, change) - center).norm());
      pose = compose(change, *pose);
      pose->rotation = nearest_rotation(pose->rotation);
    }
    return largest;
  }

  const std::vector<ScanFeatures>& scans_;
  const RegisterAllOptions& options_;
  const RunControl& run_;
  RegisterAllResult result_;
  std::vector<std::int32_t> pair_of_;  // by first and second scan, -1: none
  std::vector<std::uint8_t> flipped_;  // aligned with the pairs
  std::vector<std::int32_t> parent_;
  std::vector<SurfaceSamples> samples_;
};

}  // namespace

RegisterAllResult register_all(const std::vector<ScanFeatures>& scans,
                               const RegisterAllOptions& options, RunControl run) {
  check(scans, options);
  return Assembly(scans, options, run).solve();
}

}  // namespace dupin
