#include "dupin/registration/register.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <memory>
#include <numbers>
#include <string>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "register_verb.h"
#include "registered_scan.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

struct RegisterRequest {
  std::string moving;
  std::string fixed;
  std::string output;
  std::string fused;
  std::string scale = "estimate";
  std::string refine = "icp";
  double max_rotation_deg = 180.0;
  double min_confidence = 0.5;
};

struct Registered {
  LoadedSurface moving;
  LoadedSurface fixed;
  RegistrationResult result;
  Pose pose;  // between the inputs
  double seconds = 0.0;
};

Registered solve(Context& context, const RegisterRequest& request) {
  Registered found;
  const auto start = std::chrono::steady_clock::now();
  found.moving = load_surface(request.moving, context);
  found.fixed = load_surface(request.fixed, context);
  RegistrationOptions options;
  options.estimate_scale = request.scale == "estimate";
  if (!options.estimate_scale) {
    options.scale = found.moving.unit / found.fixed.unit;
    require_range(std::isfinite(options.scale) && options.scale > 0.0, "the ratio of the sizes",
                  request.moving);
  }
  options.max_rotation =
      request.max_rotation_deg >= 180.0 ? 4.0 : request.max_rotation_deg * std::numbers::pi / 180.0;
  options.refine = request.refine == "icp";
  options.min_confidence = request.min_confidence;
  const ScanFeatures moving = describe_loaded(found.moving, 1.0, context.run.stage(0.1, 0.3));
  const ScanFeatures fixed = describe_loaded(found.fixed, 1.0, context.run.stage(0.3, 0.5));
  context.run.throw_if_cancelled();
  // The poses that the scans came with, in local coordinates.
  const Pose from_local = local_to_input(found.moving);
  const Pose to_local = inverse(local_to_input(found.fixed));
  options.given_pose = compose(to_local, from_local);
  options.try_given_pose =
      std::isfinite(options.given_pose.scale) && options.given_pose.scale > 0.0;
  if (!options.try_given_pose) options.given_pose = Pose();
  found.result = register_scans(moving, fixed, options, context.run.stage(0.5, 1.0));
  context.run.throw_if_cancelled();
  found.pose = compose(inverse(to_local), compose(found.result.pose, inverse(from_local)));
  require_range(found.pose.translation.array().isFinite().all() && std::isfinite(found.pose.scale),
                "the pose", request.moving);
  found.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return found;
}

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

Json document_of(const Registered& found, const RegisterRequest& request) {
  const RegistrationResult& result = found.result;
  const PoseFit& fit = result.best.fit;
  Json rotation = Json::array();
  for (Index r = 0; r < 3; ++r) {
    rotation.push_back(
        {found.pose.rotation(r, 0), found.pose.rotation(r, 1), found.pose.rotation(r, 2)});
  }
  Json pairs = Json::array();
  for (const FeaturePair& pair : result.correspondences) {
    pairs.push_back({found.moving.input_vertex[static_cast<std::size_t>(pair.moving)],
                     found.fixed.input_vertex[static_cast<std::size_t>(pair.fixed)]});
  }
  // Of a pose that is refused or not refined nothing is known.
  const auto known = [&](double value) {
    return number_or_null(result.accepted && request.refine == "icp" ? std::optional(value)
                                                                     : std::nullopt);
  };
  const double degrees = 180.0 / std::numbers::pi;
  const double turn = std::sqrt(std::max(0.0, result.covariance.topLeftCorner<3, 3>().trace()));
  const double shift =
      std::sqrt(std::max(0.0, result.covariance.block<3, 3>(3, 3).trace())) * found.fixed.unit;
  Json warnings = warnings_of(request.moving, found.moving);
  for (const Json& one : warnings_of(request.fixed, found.fixed)) warnings.push_back(one);
  return {{"accepted", result.accepted},
          {"refusal", words_of(result.refusal).name},
          {"transform", matrix_of(found.pose)},
          {"scale", found.pose.scale},
          {"rotation", rotation},
          {"translation",
           {found.pose.translation[0], found.pose.translation[1], found.pose.translation[2]}},
          {"overlap", fit.overlap_moving},
          {"overlap_fixed", fit.overlap_fixed},
          {"conflict", fit.conflict},
          {"rmse", fit.rmse * found.fixed.unit},
          {"inliers", fit.num_pairs},
          {"correspondences", pairs},
          {"confidence", result.best.confidence},
          {"rotation_sd", known(turn * degrees)},
          {"translation_sd", known(shift)},
          {"scale_sd", known(std::sqrt(std::max(0.0, result.covariance(6, 6))) * found.pose.scale)},
          {"alternatives", result.alternatives.size()},
          {"seconds", found.seconds},
          {"warnings", warnings}};
}

SurfaceOutput aligned(const Registered& found) {
  SurfaceOutput out = as_given(found.moving);
  out.points = transformed(out.points, found.pose);
  return out;
}

SurfaceOutput fused(const Registered& found) {
  SurfaceOutput out = aligned(found);
  Eigen::VectorXd scan = Eigen::VectorXd::Zero(out.points.rows() + found.fixed.input_points.rows());
  scan.tail(found.fixed.input_points.rows()).setOnes();
  append_scan(out, as_given(found.fixed), Pose());
  out.properties.push_back({"scan", scan, false});
  return out;
}

void run_register(Context& context, const RegisterRequest& request) {
  if (request.moving == "-" && request.fixed == "-")
    throw InvalidArgument("only one of the scans can be standard input");
  for (const std::string& path : {request.output, request.fused}) {
    if (!path.empty()) surface_format_of(path);
  }
  Registered found;
  with_progress(context, "register", [&] {
    found = solve(context, request);
    if (!request.output.empty())
      write_surface(request.output, aligned(found), surface_format_of(request.output));
    if (!request.fused.empty())
      write_surface(request.fused, fused(found), surface_format_of(request.fused));
  });
  if (!found.result.accepted) context.exit_code = static_cast<int>(Errc::negative);
  context.print_json(document_of(found, request));
  if (context.json) return;
  const PoseFit& fit = found.result.best.fit;
  context.say(fmt::format("{}: {}", found.result.accepted ? "registered" : "not registered",
                          words_of(found.result.refusal).sentence));
  for (Index r = 0; r < 3; ++r) {
    context.say(fmt::format(
        "  {:12.8f} {:12.8f} {:12.8f} {:14.8g}", found.pose.scale * found.pose.rotation(r, 0),
        found.pose.scale * found.pose.rotation(r, 1), found.pose.scale * found.pose.rotation(r, 2),
        found.pose.translation[r]));
  }
  context.say(fmt::format(
      "scale {:.6g}, overlap {:.1f} % of moving and {:.1f} % of fixed, apart {:.1f} % of what both "
      "saw, rmse {:.4g}, confidence {:.3f}",
      found.pose.scale, 100.0 * fit.overlap_moving, 100.0 * fit.overlap_fixed, 100.0 * fit.conflict,
      fit.rmse * found.fixed.unit, found.result.best.confidence));
  if (!found.result.alternatives.empty()) {
    context.say(fmt::format("{} other poses fit as well: the object is symmetric",
                            found.result.alternatives.size()));
  }
}

}  // namespace

void add_register(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("register", "Pose of one partial scan on another");
  verb->footer(
      "Examples:\n  dupin register left.ply right.ply -o left_aligned.ply\n"
      "  dupin register photo_scan.obj lidar.ply --fused both.ply --json\n\n"
      "Exit code 1: no pose was accepted; the best candidate is still told.");
  add_global_options(*verb, context);
  auto request = std::make_shared<RegisterRequest>();
  verb->add_option("MOVING", request->moving, "Scan to move; - reads standard input")->required();
  verb->add_option("FIXED", request->fixed, "Scan that stays")->required();
  verb->add_option("--scale", request->scale,
                   "estimate: the scans may have different units; fixed: they have one")
      ->check(CLI::IsMember({"estimate", "fixed"}))
      ->capture_default_str();
  verb->add_option("--refine", request->refine,
                   "icp, or none: the pose that the features agree on, judged after ICP")
      ->check(CLI::IsMember({"icp", "none"}))
      ->capture_default_str();
  verb->add_option("--max-rotation", request->max_rotation_deg,
                   "Refuse poses that turn by more [degrees]")
      ->check(in_range(0.0, 180.0))
      ->capture_default_str();
  verb->add_option("--min-confidence", request->min_confidence, "Refuse poses less sure than this")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  verb->add_option("-o,--output", request->output,
                   "MOVING in the frame of FIXED: .ply, .obj, .off, .stl or .glb");
  verb->add_option("--fused", request->fused,
                   "Both scans in one file, with a property \"scan\" in PLY");
  add_input_format(*verb, context);
  verb->callback([request, &context] { run_register(context, *request); });
}

}  // namespace dupin::cli
