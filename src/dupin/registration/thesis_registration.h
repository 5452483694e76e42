#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/thesis_features.h"

namespace dupin {

/// Options of register_by_thesis() (5.5.5).
struct ThesisRegistrationOptions {
  ThesisFeatureOptions features = {};
  int candidates = 5;  ///< K matches of each feature, >= 1
  int bins = 32;       ///< of a descriptor, >= 2
  /// Share of the features of the fixed surface that must meet one of the moving surface, in (0,
  /// 1]. The score is the mean over so many of the smallest distances (E-28): under partial overlap
  /// the others have no partner.
  double min_overlap = 0.3;
  double reach = 0.5;  ///< features meet within this share of the radius of their structure, > 0
};

/// Features i of the fixed and j of the moving surface with similar descriptors.
struct ThesisMatch {
  std::int32_t fixed = -1;
  std::int32_t moving = -1;
  double distance = 0.0;  ///< L2 distance of the descriptors
};

/// A feature of the fixed surface and the moving one that lies nearest to it in the pose.
struct MetFeatures {
  std::int32_t fixed = -1;
  std::int32_t moving = -1;
  double distance = 0.0;  ///< [mu]
};

/// A pose from feature points alone; not refined.
struct ThesisRegistration {
  Status status = Status::ok;
  /// Enough features meet. False: there are fewer than three features on a surface, no three points
  /// that determine a pose, or no pose of the required overlap; then `pose` means nothing.
  bool is_found = false;
  Pose pose;             ///< from moving to fixed; scale 1
  double score = 0.0;    ///< trimmed mean of 5.42 [mu]
  double overlap = 0.0;  ///< share of the fixed features that meet a moving one
  /// Share of the moving features that meet a fixed one, each within its own reach.
  double moving_overlap = 0.0;
  std::vector<MetFeatures> met;  ///< fixed features that meet a moving one, by fixed
  Eigen::Index num_fixed_features = 0;
  Eigen::Index num_moving_features = 0;
  Eigen::Index num_hypotheses = 0;  ///< poses that were scored
  std::vector<ThesisMatch> queue;   ///< all matches by rising distance (ties: fixed, then moving)
  ThesisMatch best;                 ///< the match that the pose comes from
};

/// Registers two surfaces as section 5.5 of the thesis does: K matches of each feature by its LoC
/// histogram; for each match two more point pairs from the principal frames, the features nearest
/// to p +- r v_1 and p +- r v_2, with all signs on both sides; a pose in closed form from each
/// three pairs; and the pose with the smallest 5.42 in its trimmed form.
///
/// Where the text leaves it open: triples with a repeated point, or whose height is below a
/// twentieth of their longest side on either surface, are no hypotheses. Histograms of both
/// surfaces share one range, the largest value of all. Same input, same bits, for any number of
/// threads.
/// @throws InvalidArgument if an option is out of range
/// Cost: O(16 K N M N) distances for N fixed and M moving features.
ThesisRegistration register_by_thesis(const ThesisFeatures& moving, const ThesisFeatures& fixed,
                                      const ThesisRegistrationOptions& options = {},
                                      RunControl run = {});

/// The same from the surfaces themselves, with options.features on both.
ThesisRegistration register_by_thesis(const SurfaceGraph& moving, const SurfaceGraph& fixed,
                                      const ThesisRegistrationOptions& options = {},
                                      RunControl run = {});

}  // namespace dupin
