#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "register_verb.h"
#include "registered_scan.h"
#include "registration_answer.h"
#include "registration_report.h"
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
  std::string report;
  RegistrationQuestion question;
  // Whether they were given: the preset thesis has no use for them.
  bool has_scale = false;
  bool has_min_confidence = false;
};

void check(Context& context, RegisterRequest& request) {
  if (request.moving == "-" && request.fixed == "-")
    throw InvalidArgument("only one of the scans can be standard input");
  if (request.question.preset == "thesis") {
    if (request.has_scale && request.question.scale == "estimate") {
      throw InvalidArgument("--scale estimate has no meaning with --preset thesis",
                            "its scans have one unit: --scale fixed");
    }
    if (request.has_min_confidence) {
      throw InvalidArgument("--min-confidence has no meaning with --preset thesis",
                            "its poses have no confidence");
    }
    request.question.scale = "fixed";
  }
  if (!request.output.empty() && request.output == request.fused)
    throw InvalidArgument("-o and --fused are one file", "give each a name of its own");
  for (const std::string& path : {request.output, request.fused}) {
    if (path.empty()) continue;
    surface_format_of(path);
    require_writable(path);
  }
  request.question.wants_features = !request.report.empty();
  if (request.report.empty()) return;
  output_format(context, request.report, "", {"html"});
  require_writable(request.report);
}

SurfaceOutput aligned(const RegistrationAnswer& answer) {
  SurfaceOutput out = as_given(answer.moving);
  out.points = transformed(out.points, answer.pose);
  return out;
}

SurfaceOutput fused(const RegistrationAnswer& answer) {
  SurfaceOutput out = aligned(answer);
  Eigen::VectorXd scan =
      Eigen::VectorXd::Zero(out.points.rows() + answer.fixed.input_points.rows());
  scan.tail(answer.fixed.input_points.rows()).setOnes();
  append_scan(out, as_given(answer.fixed), Pose());
  out.properties.push_back({"scan", scan, false});
  return out;
}

// What a shell needs to make the page again.
std::string command_of(const RegisterRequest& request) {
  const RegistrationQuestion& question = request.question;
  std::string line = fmt::format("dupin register {} {} --report {}", shell_quoted(request.moving),
                                 shell_quoted(request.fixed), shell_quoted(request.report));
  if (question.preset != "product") line += " --preset " + question.preset;
  if (question.preset == "product" && question.scale != "estimate")
    line += " --scale " + question.scale;
  if (question.refine != "icp") line += " --refine " + question.refine;
  if (question.max_rotation_deg < 180.0)
    line += fmt::format(" --max-rotation {}", question.max_rotation_deg);
  if (request.has_min_confidence)
    line += fmt::format(" --min-confidence {}", question.min_confidence);
  return line;
}

RegistrationAnswer solve(Context& context, const RegisterRequest& request) {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  // The features of a scan come with a graph of their own.
  LoadedSurface moving = load_surface(request.moving, context, 0);
  LoadedSurface fixed = load_surface(request.fixed, context, 0);
  const double last = request.report.empty() ? 1.0 : 0.6;
  RegistrationAnswer answer =
      answer_registration(std::move(moving), std::move(fixed), request.question, request.moving,
                          context.run.stage(0.2, last));
  answer.seconds = seconds();
  // All work is done before the first output: a run that is stopped leaves none of them.
  std::string page;
  if (!request.report.empty()) {
    page = registration_page(answer, request.moving, request.fixed, command_of(request),
                             context.run.stage(last, 1.0));
  }
  context.run.throw_if_cancelled();
  // Without any candidate there is no place to write the scan at.
  if (!request.output.empty() && answer.has_pose)
    write_surface(request.output, aligned(answer), surface_format_of(request.output));
  if (!request.fused.empty() && answer.has_pose)
    write_surface(request.fused, fused(answer), surface_format_of(request.fused));
  if (!request.report.empty()) write_file_atomically(request.report, page);
  return answer;
}

void say(const Context& context, const RegistrationAnswer& answer) {
  context.say(
      fmt::format("{}: {}", answer.accepted ? "registered" : "not registered", answer.sentence));
  if (!answer.has_pose) return;
  for (Index r = 0; r < 3; ++r) {
    const Eigen::Vector3d row = answer.pose.scale * answer.pose.rotation.row(r).transpose();
    context.say(fmt::format("  {:16.9g} {:16.9g} {:16.9g} {:16.9g}", row[0], row[1], row[2],
                            answer.pose.translation[r]));
  }
  if (answer.is_of_features) {
    context.say(
        fmt::format("{:.1f} % of the moving and {:.1f} % of the fixed features meet, rmse {:.4g}",
                    100.0 * answer.overlap.value_or(0.0),
                    100.0 * answer.overlap_fixed.value_or(0.0), answer.rmse.value_or(0.0)));
    return;
  }
  context.say(fmt::format(
      "scale {:.6g}, overlap {:.1f} % of moving and {:.1f} % of fixed, apart {:.1f} % of what both "
      "saw, rmse {:.4g}, confidence {:.3f}",
      answer.pose.scale, 100.0 * answer.overlap.value_or(0.0),
      100.0 * answer.overlap_fixed.value_or(0.0), 100.0 * answer.conflict.value_or(0.0),
      answer.rmse.value_or(0.0), answer.confidence.value_or(0.0)));
  if (answer.alternatives && !answer.alternatives->empty()) {
    context.say(fmt::format("{} other poses fit as well: the object is symmetric",
                            answer.alternatives->size()));
  }
}

void run_register(Context& context, RegisterRequest& request) {
  check(context, request);
  RegistrationAnswer answer;
  with_progress(context, "register", [&] { answer = solve(context, request); });
  if (!answer.accepted) context.exit_code = static_cast<int>(Errc::negative);
  Json document = document_of(answer);
  document["warnings"] = warnings_of(request.moving, answer.moving);
  for (const Json& one : warnings_of(request.fixed, answer.fixed))
    document["warnings"].push_back(one);
  context.print_json(document);
  if (!context.json) say(context, answer);
}

}  // namespace

void add_register(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("register", "Pose of one partial scan on another");
  verb->footer(
      "Examples:\n  dupin register left.ply right.ply -o left_aligned.ply\n"
      "  dupin register photo_scan.obj lidar.ply --fused both.ply --json\n"
      "  dupin register left.ply right.ply --report page.html\n\n"
      "Exit code 1: no pose was accepted; the best candidate is still told.");
  add_global_options(*verb, context);
  auto request = std::make_shared<RegisterRequest>();
  verb->add_option("MOVING", request->moving, "Scan to move; - reads standard input")->required();
  verb->add_option("FIXED", request->fixed, "Scan that stays")->required();
  RegistrationQuestion& question = request->question;
  verb->add_option("--preset", question.preset,
                   "product, or thesis: features, frames and histograms of its chapter 5.5")
      ->check(CLI::IsMember({"product", "thesis"}))
      ->capture_default_str();
  const CLI::Option* scale =
      verb->add_option("--scale", question.scale,
                       "estimate: the scans may have different units; fixed: they have one")
          ->check(CLI::IsMember({"estimate", "fixed"}))
          ->capture_default_str();
  verb->add_option("--refine", question.refine,
                   "icp, or none: the pose that the features agree on, judged after ICP")
      ->check(CLI::IsMember({"icp", "none"}))
      ->capture_default_str();
  verb->add_option("--max-rotation", question.max_rotation_deg,
                   "Refuse poses that turn by more [degrees]")
      ->check(in_range(0.0, 180.0))
      ->capture_default_str();
  const CLI::Option* min_confidence = verb->add_option("--min-confidence", question.min_confidence,
                                                       "Refuse poses less sure than this")
                                          ->check(in_range(0.0, 1.0))
                                          ->capture_default_str();
  verb->add_option("-o,--output", request->output,
                   "MOVING in the frame of FIXED: .ply, .obj, .off, .stl or .glb");
  verb->add_option("--fused", request->fused,
                   "Both scans in one file, with a property \"scan\" in PLY");
  verb->add_option("--report", request->report,
                   "Page that shows the scans before and after, matches, distances and figures: "
                   ".html");
  add_input_format(*verb, context);
  verb->callback([request, scale, min_confidence, &context] {
    request->has_scale = scale->count() > 0;
    request->has_min_confidence = min_confidence->count() > 0;
    run_register(context, *request);
  });
}

}  // namespace dupin::cli
