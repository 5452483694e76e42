#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/registration/register.h"
#include "registered_scan.h"
#include "surface_input.h"

namespace dupin::cli {

/// What is asked of `dupin register`, in the words of its options.
struct RegistrationQuestion {
  std::string preset = "product";
  std::string scale = "estimate";
  std::string refine = "icp";
  double max_rotation_deg = 180.0;
  double min_confidence = 0.5;
  bool try_given_pose = true;
  bool wants_features = false;  ///< describe the scans even where the preset does not need it
};

/// Two scans and what is known of their pose. Vertices are those of the analysis.
struct RegistrationAnswer {
  LoadedSurface moving;
  LoadedSurface fixed;
  ScanFeatures moving_scan;  ///< in local coordinates; without points where nobody needed them
  ScanFeatures fixed_scan;
  bool has_pose = true;         ///< false: not even a candidate
  bool is_of_features = false;  ///< overlap, rmse and inliers are those of features (preset thesis)
  bool accepted = false;
  Refusal refusal = Refusal::no_features;
  std::string sentence;     ///< what `refusal` means
  Pose local;               ///< between the local coordinates
  Pose pose;                ///< between the inputs
  bool is_flipped = false;  ///< normals of the moving scan point to the other side
  std::vector<FeaturePair> correspondences;
  std::vector<FeaturePair> other_matches;
  Eigen::Index inliers = 0;
  // Of what is not known there is no value. Lengths in the unit of the fixed input.
  std::optional<double> overlap;
  std::optional<double> overlap_fixed;
  std::optional<double> conflict;
  std::optional<double> rmse;
  std::optional<double> confidence;
  std::optional<double> rotation_sd;  ///< [deg]
  std::optional<double> translation_sd;
  std::optional<double> scale_sd;
  std::optional<std::vector<PoseCandidate>> alternatives;  ///< between the local coordinates
  double seconds = 0.0;
};

/// Registers two scans at hand, as the options say; progress fills `run`.
/// @throws what describe_scan() and register_scans() or register_by_thesis() throw; E_RANGE where
///   the pose does not fit a double, of `name`; Errc::interrupted when cancelled
RegistrationAnswer answer_registration(LoadedSurface moving, LoadedSurface fixed,
                                       const RegistrationQuestion& question,
                                       const std::string& name, const RunControl& run);

/// "no_overlap" and what that means.
const char* name_of(Refusal refusal);
const char* sentence_of(Refusal refusal);

/// `local`, a pose between the local coordinates of two surfaces, between their inputs.
Pose between_inputs(const Pose& local, const LoadedSurface& moving, const LoadedSurface& fixed);

/// The JSON document of `dupin register` but for its warnings.
nlohmann::ordered_json document_of(const RegistrationAnswer& answer);

}  // namespace dupin::cli
