#include "registration_answer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/registration/refine_scans.h"
#include "dupin/registration/residuals.h"
#include "dupin/registration/thesis_registration.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180.0 / std::numbers::pi;

struct RefusalWords {
  Refusal refusal;
  const char* name;
  const char* sentence;
};

constexpr RefusalWords kRefusals[] = {
    {Refusal::none, "none", "accepted"},
    {Refusal::no_features, "no_features", "nothing in one scan resembles anything in the other"},
    {Refusal::no_overlap, "no_overlap", "the scans do not lie on each other in any pose tried"},
    {Refusal::undetermined, "undetermined", "the scans slide or turn on each other freely"},
    {Refusal::contradicted, "contradicted", "the scans cross where both saw the surface"},
    {Refusal::unsure, "unsure", "the scans rest on each other, but on too little to be sure"},
    {Refusal::rotation, "rotation", "the pose turns by more than --max-rotation"}};

const RefusalWords& words_of(Refusal refusal) {
  return *std::find_if(std::begin(kRefusals), std::end(kRefusals),
                       [&](const RefusalWords& words) { return words.refusal == refusal; });
}

void describe_both(RegistrationAnswer& answer, const RunControl& run) {
  answer.moving_scan = describe_loaded(answer.moving, 1.0, run.stage(0.0, 0.5));
  answer.fixed_scan = describe_loaded(answer.fixed, 1.0, run.stage(0.5, 1.0));
  run.throw_if_cancelled();
}

// The ratio of the lengths of the local coordinates where the inputs have one unit.
double scale_of_units(const RegistrationAnswer& answer, const std::string& name) {
  const double scale = answer.moving.unit / answer.fixed.unit;
  require_range(std::isfinite(scale) && scale > 0.0, "the ratio of the sizes", name);
  return scale;
}

void answer_by_product(RegistrationAnswer& answer, const RegistrationQuestion& question,
                       const std::string& name, const RunControl& run) {
  RegistrationOptions options;
  options.estimate_scale = question.scale == "estimate";
  if (!options.estimate_scale) options.scale = scale_of_units(answer, name);
  options.max_rotation =
      question.max_rotation_deg >= 180.0 ? 4.0 : question.max_rotation_deg / kDegrees;
  options.refine = question.refine == "icp";
  options.min_confidence = question.min_confidence;
  describe_both(answer, run.stage(0.0, 0.5));
  // The poses that the scans came with, in local coordinates.
  options.given_pose =
      compose(inverse(local_to_input(answer.fixed)), local_to_input(answer.moving));
  options.try_given_pose = question.try_given_pose && std::isfinite(options.given_pose.scale) &&
                           options.given_pose.scale > 0.0;
  if (!options.try_given_pose) options.given_pose = Pose();
  RegistrationResult result =
      register_scans(answer.moving_scan, answer.fixed_scan, options, run.stage(0.5, 1.0));
  run.throw_if_cancelled();
  answer.accepted = result.accepted;
  answer.refusal = result.refusal;
  answer.local = result.pose;
  answer.is_flipped = result.best.is_flipped;
  answer.correspondences = std::move(result.correspondences);
  answer.other_matches = std::move(result.other_matches);
  const PoseFit& fit = result.best.fit;
  answer.inliers = fit.num_pairs;
  answer.overlap = fit.overlap_moving;
  answer.overlap_fixed = fit.overlap_fixed;
  answer.conflict = fit.conflict;
  answer.rmse = fit.rmse * answer.fixed.unit;
  answer.confidence = result.best.confidence;
  answer.alternatives = std::move(result.alternatives);
  // Of a pose that is refused or not refined nothing is known.
  if (!result.accepted || !options.refine) return;
  const auto deviation = [&](Index from, Index count) {
    return std::sqrt(std::max(0.0, result.covariance.diagonal().segment(from, count).sum()));
  };
  answer.rotation_sd = deviation(0, 3) * kDegrees;
  answer.translation_sd = deviation(3, 3) * answer.fixed.unit;
  // Of the scale between the local coordinates; between_inputs() makes it that of the inputs.
  answer.scale_sd = deviation(6, 1);
}

SurfaceGraph graph_of(const LoadedSurface& surface, double scale, const RunControl& run) {
  SurfaceGraph graph = surface.graph;
  graph.points *= scale;
  graph.mean_edge *= scale;
  if (graph.is_mesh() || graph.topology.ring.num_vertices() > 0) return graph;
  graph = surface_graph(PointCloud{graph.points, graph.normals}, {}, run);
  run.throw_if_cancelled();
  return graph;
}

// The side of bare points is arbitrary: in this pose, do more of them rest on the other scan when
// one of both is turned over?
bool lies_flipped(const RegistrationAnswer& answer, const RunControl& run) {
  if (answer.moving_scan.has_sides && answer.fixed_scan.has_sides) return false;
  const auto touching = [&](bool is_flipped, const RunControl& part) {
    const ScanResiduals found =
        compute_residuals(answer.moving_scan, answer.fixed_scan, answer.local, is_flipped, part);
    run.throw_if_cancelled();
    return std::count(found.moving_contact.begin(), found.moving_contact.end(), Contact::touching) +
           std::count(found.fixed_contact.begin(), found.fixed_contact.end(), Contact::touching);
  };
  return touching(true, run.stage(0.0, 0.5)) > touching(false, run.stage(0.5, 1.0));
}

// Chapter 5.5 of the thesis knows one unit, and of its pose only the features that meet.
void answer_by_thesis(RegistrationAnswer& answer, const RegistrationQuestion& question,
                      const std::string& name, const RunControl& run) {
  Pose to_fixed_unit;
  to_fixed_unit.scale = scale_of_units(answer, name);
  const ThesisRegistrationOptions options;
  const ThesisFeatures moving =
      describe_by_thesis(graph_of(answer.moving, to_fixed_unit.scale, run.stage(0.0, 0.1)),
                         options.features, run.stage(0.1, 0.3));
  const ThesisFeatures fixed = describe_by_thesis(graph_of(answer.fixed, 1.0, run.stage(0.3, 0.4)),
                                                  options.features, run.stage(0.4, 0.6));
  const ThesisRegistration result = register_by_thesis(moving, fixed, options, run.stage(0.6, 0.8));
  run.throw_if_cancelled();
  answer.is_of_features = true;
  answer.has_pose = result.num_hypotheses > 0;
  answer.accepted = result.is_found;
  answer.refusal = result.is_found   ? Refusal::none
                   : answer.has_pose ? Refusal::no_overlap
                                     : Refusal::no_features;
  answer.local = compose(result.pose, to_fixed_unit);
  double squares = 0.0;
  for (const MetFeatures& met : result.met) {
    const auto vertex = [](const ThesisFeatures& features, std::int32_t index) {
      return features.features[static_cast<std::size_t>(index)].keypoint.vertex;
    };
    answer.correspondences.push_back({vertex(moving, met.moving), vertex(fixed, met.fixed)});
    squares += met.distance * met.distance;
  }
  answer.inliers = static_cast<Index>(result.met.size());
  if (answer.has_pose) {
    answer.overlap = result.moving_overlap;
    answer.overlap_fixed = result.overlap;
  }
  if (!result.met.empty()) {
    answer.rmse = std::sqrt(squares / static_cast<double>(result.met.size())) * answer.fixed.unit;
  }
  const bool is_refined = question.refine == "icp" && answer.has_pose;
  if (is_refined || question.wants_features) describe_both(answer, run.stage(0.8, 0.9));
  if (is_refined) {
    const RefinedPose refined =
        refine_scans(answer.moving_scan, answer.fixed_scan, answer.local, run.stage(0.9, 1.0));
    run.throw_if_cancelled();
    answer.local = refined.pose;
    answer.is_flipped = refined.is_flipped;
  } else if (question.wants_features && answer.has_pose) {
    answer.is_flipped = lies_flipped(answer, run.stage(0.9, 1.0));
  }
  // Of the pose that is answered, not of the one that it was refined from.
  if (answer.accepted && question.max_rotation_deg < 180.0 &&
      rotation_angle(Eigen::Matrix3d::Identity(), answer.local.rotation) * kDegrees >
          question.max_rotation_deg) {
    answer.accepted = false;
    answer.refusal = Refusal::rotation;
  }
}

const char* thesis_sentence_of(Refusal refusal) {
  if (refusal == Refusal::no_features)
    return "a scan has fewer than three features, or no three of them determine a pose";
  if (refusal == Refusal::no_overlap) return "too few features meet in the best pose";
  return sentence_of(refusal);
}

Json row_of(const Eigen::Vector3d& row) { return {row[0], row[1], row[2]}; }

}  // namespace

const char* name_of(Refusal refusal) { return words_of(refusal).name; }
const char* sentence_of(Refusal refusal) { return words_of(refusal).sentence; }

Pose between_inputs(const Pose& local, const LoadedSurface& moving, const LoadedSurface& fixed) {
  // As register_scans() gets the given pose: the same two maps, so that rounding cancels.
  const Pose to_local = inverse(local_to_input(fixed));
  return compose(inverse(to_local), compose(local, inverse(local_to_input(moving))));
}

RegistrationAnswer answer_registration(LoadedSurface moving, LoadedSurface fixed,
                                       const RegistrationQuestion& question,
                                       const std::string& name, const RunControl& run) {
  const auto start = std::chrono::steady_clock::now();
  RegistrationAnswer answer;
  answer.moving = std::move(moving);
  answer.fixed = std::move(fixed);
  const bool is_thesis = question.preset == "thesis";
  if (is_thesis) {
    answer_by_thesis(answer, question, name, run);
  } else {
    answer_by_product(answer, question, name, run);
  }
  answer.sentence = is_thesis ? thesis_sentence_of(answer.refusal) : sentence_of(answer.refusal);
  answer.pose = between_inputs(answer.local, answer.moving, answer.fixed);
  if (answer.scale_sd) answer.scale_sd = *answer.scale_sd * answer.pose.scale;
  require_range(
      answer.pose.translation.array().isFinite().all() && std::isfinite(answer.pose.scale),
      "the pose", name);
  answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return answer;
}

Json document_of(const RegistrationAnswer& answer) {
  Json rotation = Json::array();
  for (Index r = 0; r < 3; ++r) rotation.push_back(row_of(answer.pose.rotation.row(r)));
  Json pairs = Json::array();
  for (const FeaturePair& pair : answer.correspondences) {
    pairs.push_back({answer.moving.input_vertex[static_cast<std::size_t>(pair.moving)],
                     answer.fixed.input_vertex[static_cast<std::size_t>(pair.fixed)]});
  }
  const auto if_posed = [&](const Json& value) { return answer.has_pose ? value : Json(); };
  return {{"accepted", answer.accepted},
          {"refusal", name_of(answer.refusal)},
          {"transform", if_posed(matrix_of(answer.pose))},
          {"scale", if_posed(answer.pose.scale)},
          {"rotation", if_posed(rotation)},
          {"translation", if_posed(row_of(answer.pose.translation))},
          {"overlap", number_or_null(answer.overlap)},
          {"overlap_fixed", number_or_null(answer.overlap_fixed)},
          {"conflict", number_or_null(answer.conflict)},
          {"rmse", number_or_null(answer.rmse)},
          {"inliers", answer.inliers},
          {"correspondences", pairs},
          {"confidence", number_or_null(answer.confidence)},
          {"rotation_sd", number_or_null(answer.rotation_sd)},
          {"translation_sd", number_or_null(answer.translation_sd)},
          {"scale_sd", number_or_null(answer.scale_sd)},
          {"alternatives", answer.alternatives ? Json(answer.alternatives->size()) : Json()},
          {"seconds", answer.seconds}};
}

}  // namespace dupin::cli
