#include "dupin/registration/thesis_registration.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kFlattest = 0.05;  // height over longest side of a triple

// The four choices of the signs of v_1 and v_2.
constexpr std::array<std::array<double, 2>, 4> kSigns = {
    {{1.0, 1.0}, {1.0, -1.0}, {-1.0, 1.0}, {-1.0, -1.0}}};

void check(const ThesisRegistrationOptions& options) {
  if (options.candidates < 1) throw InvalidArgument("candidates must be >= 1");
  if (options.bins < 2) throw InvalidArgument("bins must be >= 2");
  if (!(options.min_overlap > 0.0 && options.min_overlap <= 1.0)) {
    throw InvalidArgument("min_overlap must be in (0, 1]");
  }
  if (!std::isfinite(options.reach) || !(options.reach > 0.0)) {
    throw InvalidArgument("reach must be finite and > 0");
  }
}

Points positions(const ThesisFeatures& surface) {
  Points points(static_cast<Index>(surface.features.size()), 3);
  for (Index i = 0; i < points.rows(); ++i) {
    points.row(i) = surface.features[static_cast<std::size_t>(i)].position;
  }
  return points;
}

double largest_value(const ThesisFeatures& surface) {
  double largest = 0.0;
  for (const ThesisFeature& feature : surface.features) {
    if (feature.values.empty()) continue;
    largest = std::max({largest, -feature.values.front(), feature.values.back()});
  }
  return largest;
}

std::vector<VectorXd> descriptors(const ThesisFeatures& surface, double range, int bins) {
  std::vector<VectorXd> out;
  out.reserve(surface.features.size());
  for (const ThesisFeature& feature : surface.features) {
    out.push_back(loc_histogram(feature.values, range, bins));
  }
  return out;
}

// For each fixed feature its K moving ones with the nearest descriptors.
std::vector<ThesisMatch> find_matches(const ThesisFeatures& moving, const ThesisFeatures& fixed,
                                      const ThesisRegistrationOptions& options) {
  const double range = std::max(largest_value(moving), largest_value(fixed));
  if (range <= 0.0) return {};
  const auto fixed_words = descriptors(fixed, range, options.bins);
  const auto moving_words = descriptors(moving, range, options.bins);
  const auto by_distance = [](const ThesisMatch& a, const ThesisMatch& b) {
    return std::tie(a.distance, a.fixed, a.moving) < std::tie(b.distance, b.fixed, b.moving);
  };
  std::vector<ThesisMatch> queue;
  std::vector<ThesisMatch> row;
  for (std::size_t i = 0; i < fixed_words.size(); ++i) {
    row.clear();
    for (std::size_t j = 0; j < moving_words.size(); ++j) {
      row.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(j),
                     (fixed_words[i] - moving_words[j]).norm()});
    }
    std::sort(row.begin(), row.end(), by_distance);
    row.resize(std::min(row.size(), static_cast<std::size_t>(options.candidates)));
    queue.insert(queue.end(), row.begin(), row.end());
  }
  std::sort(queue.begin(), queue.end(), by_distance);
  return queue;
}

struct Nearest {
  Index index = -1;
  double squared = std::numeric_limits<double>::infinity();
};

Nearest nearest_of(const Points& points, const Eigen::RowVector3d& place) {
  Nearest best;
  for (Index i = 0; i < points.rows(); ++i) {
    const double squared = (points.row(i) - place).squaredNorm();
    if (squared < best.squared) best = {i, squared};
  }
  return best;
}

// A feature and the two others that its frame points at.
struct Triple {
  bool is_usable = false;
  Points corners = Points(3, 3);
};

Triple triple_of(const ThesisFeatures& surface, const Points& points, std::int32_t index,
                 const std::array<double, 2>& signs) {
  const ThesisFeature& feature = surface.features[static_cast<std::size_t>(index)];
  std::array<Index, 3> corner = {index, -1, -1};
  for (std::size_t j = 0; j < 2; ++j) {
    const Eigen::RowVector3d g =
        feature.position +
        signs[j] * feature.radius * feature.frame.col(static_cast<Index>(j)).transpose();
    corner[j + 1] = nearest_of(points, g).index;
  }
  Triple triple;
  if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) return triple;
  for (Index c = 0; c < 3; ++c) {
    triple.corners.row(c) = points.row(corner[static_cast<std::size_t>(c)]);
  }
  const Eigen::RowVector3d a = triple.corners.row(1) - triple.corners.row(0);
  const Eigen::RowVector3d b = triple.corners.row(2) - triple.corners.row(0);
  const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (b - a).squaredNorm()});
  triple.is_usable = a.cross(b).norm() > kFlattest * longest;
  return triple;
}

struct Score {
  double trimmed_mean = std::numeric_limits<double>::infinity();
  double overlap = 0.0;
};

// 5.42 over the `num_kept` smallest distances.
class Scorer {
 public:
  Scorer(const ThesisFeatures& fixed, const Points& fixed_points, const Points& moving_points,
         const ThesisRegistrationOptions& options)
      : fixed_points_(fixed_points), moving_points_(moving_points), reach_(fixed_points.rows()) {
    for (Index i = 0; i < reach_.size(); ++i) {
      reach_[i] = options.reach * fixed.features[static_cast<std::size_t>(i)].keypoint.radius;
    }
    num_kept_ =
        std::max<Index>(3, static_cast<Index>(std::ceil(options.min_overlap *
                                                        static_cast<double>(fixed_points.rows()))));
  }

  Index num_kept() const { return num_kept_; }

  Score operator()(const Pose& pose) const {
    const Points back = transformed(fixed_points_, inverse(pose));
    std::vector<double> distances(static_cast<std::size_t>(back.rows()));
    Index num_met = 0;
    for (Index i = 0; i < back.rows(); ++i) {
      const double distance = std::sqrt(nearest_of(moving_points_, back.row(i)).squared);
      distances[static_cast<std::size_t>(i)] = distance;
      if (distance <= reach_[i]) ++num_met;
    }
    std::sort(distances.begin(), distances.end());
    double sum = 0.0;
    for (Index i = 0; i < num_kept_; ++i) sum += distances[static_cast<std::size_t>(i)];
    return {sum / static_cast<double>(num_kept_),
            static_cast<double>(num_met) / static_cast<double>(back.rows())};
  }

 private:
  const Points& fixed_points_;
  const Points& moving_points_;
  VectorXd reach_;
  Index num_kept_ = 3;
};

// Features of `surface` that meet one of `others`, as the scores count them.
std::vector<MetFeatures> meetings(const ThesisFeatures& surface, const Points& moved,
                                  const Points& others, double reach) {
  std::vector<MetFeatures> met;
  for (Index i = 0; i < moved.rows(); ++i) {
    const Nearest nearest = nearest_of(others, moved.row(i));
    const double distance = std::sqrt(nearest.squared);
    if (distance > reach * surface.features[static_cast<std::size_t>(i)].keypoint.radius) continue;
    met.push_back(
        {static_cast<std::int32_t>(i), static_cast<std::int32_t>(nearest.index), distance});
  }
  return met;
}

struct Hypothesis {
  Pose pose;
  Score score;
  Index count = 0;
};

// The best pose of one match over all signs.
Hypothesis best_of_match(const ThesisMatch& match, const ThesisFeatures& moving,
                         const Points& moving_points, const ThesisFeatures& fixed,
                         const Points& fixed_points, const Scorer& score_of) {
  std::array<Triple, 4> there;
  for (std::size_t s = 0; s < 4; ++s) {
    there[s] = triple_of(moving, moving_points, match.moving, kSigns[s]);
  }
  Hypothesis best;
  for (const auto& signs : kSigns) {
    const Triple here = triple_of(fixed, fixed_points, match.fixed, signs);
    if (!here.is_usable) continue;
    for (const Triple& triple : there) {
      if (!triple.is_usable) continue;
      const Pose pose = fit_pose(triple.corners, here.corners);
      const Score score = score_of(pose);
      ++best.count;
      if (score.trimmed_mean < best.score.trimmed_mean) {
        best.pose = pose;
        best.score = score;
      }
    }
  }
  return best;
}

}  // namespace

ThesisRegistration register_by_thesis(const ThesisFeatures& moving, const ThesisFeatures& fixed,
                                      const ThesisRegistrationOptions& options, RunControl run) {
  check(options);
  ThesisRegistration result;
  result.num_fixed_features = static_cast<Index>(fixed.features.size());
  result.num_moving_features = static_cast<Index>(moving.features.size());
  if (moving.status == Status::cancelled || fixed.status == Status::cancelled || run.cancelled()) {
    result.status = Status::cancelled;
    return result;
  }
  if (result.num_fixed_features < 3 || result.num_moving_features < 3) return result;
  result.queue = find_matches(moving, fixed, options);
  const Points moving_points = positions(moving);
  const Points fixed_points = positions(fixed);
  const Scorer score_of(fixed, fixed_points, moving_points, options);

  std::vector<Hypothesis> best(result.queue.size());
  parallel_for(0, static_cast<Index>(best.size()), 1, [&](Index first, Index last) {
    for (Index i = first; i < last && !run.cancelled(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      best[at] =
          best_of_match(result.queue[at], moving, moving_points, fixed, fixed_points, score_of);
    }
  });
  if (run.cancelled()) {
    result.status = Status::cancelled;
    return result;
  }
  Score winner;
  for (std::size_t i = 0; i < best.size(); ++i) {
    result.num_hypotheses += best[i].count;
    if (best[i].score.trimmed_mean < winner.trimmed_mean) {
      winner = best[i].score;
      result.pose = best[i].pose;
      result.best = result.queue[i];
    }
  }
  if (result.num_hypotheses > 0) {
    result.score = winner.trimmed_mean;
    result.overlap = winner.overlap;
    result.met = meetings(fixed, transformed(fixed_points, inverse(result.pose)), moving_points,
                          options.reach);
    result.moving_overlap =
        static_cast<double>(
            meetings(moving, transformed(moving_points, result.pose), fixed_points, options.reach)
                .size()) /
        static_cast<double>(result.num_moving_features);
    result.is_found = winner.overlap * static_cast<double>(result.num_fixed_features) + 0.5 >
                      static_cast<double>(score_of.num_kept());
  }
  run.report(1.0);
  return result;
}

ThesisRegistration register_by_thesis(const SurfaceGraph& moving, const SurfaceGraph& fixed,
                                      const ThesisRegistrationOptions& options, RunControl run) {
  check(options);
  const ThesisFeatures there = describe_by_thesis(moving, options.features, run.stage(0.0, 0.4));
  const ThesisFeatures here = describe_by_thesis(fixed, options.features, run.stage(0.4, 0.8));
  return register_by_thesis(there, here, options, run.stage(0.8, 1.0));
}

}  // namespace dupin
