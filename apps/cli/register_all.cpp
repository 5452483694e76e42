#include "dupin/registration/register_all.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "assembly_report.h"
#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "register_verb.h"
#include "registered_scan.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

struct RegisterAllRequest {
  std::vector<std::string> scans;
  std::string output;
  std::string report;
};

// All scans in one local unit, that of the first: registration takes scale 1.
Assembly solve(Context& context, const RegisterAllRequest& request) {
  Assembly found;
  found.names = request.scans;
  const auto start = std::chrono::steady_clock::now();
  std::vector<ScanFeatures> features;
  std::vector<Pose> from_local;
  const double count = static_cast<double>(request.scans.size());
  for (const std::string& path : request.scans) {
    found.scans.push_back(load_surface(path, context, 0));
    LoadedSurface& scan = found.scans.back();
    if (features.empty()) found.unit = scan.unit;
    const double done = static_cast<double>(features.size()) / count;
    Pose to_frame_unit;
    to_frame_unit.scale = scan.unit / found.unit;
    features.push_back(describe_loaded(scan, to_frame_unit.scale,
                                       context.run.stage(0.2 * done, 0.2 * (done + 1.0 / count))));
    from_local.push_back(compose(local_to_input(scan), inverse(to_frame_unit)));
    context.run.throw_if_cancelled();
  }
  const double last = request.report.empty() ? 1.0 : 0.9;
  found.result = register_all(features, {}, context.run.stage(0.2, last));
  for (ScanFeatures& scan : features) found.normals.push_back(std::move(scan.normals));
  context.run.throw_if_cancelled();
  found.poses.resize(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (!found.result.poses[i]) continue;
    const Pose& to_reference = from_local[static_cast<std::size_t>(found.result.reference)];
    found.poses[i] = compose(to_reference, compose(*found.result.poses[i], inverse(from_local[i])));
    found.poses[i]->scale = 1.0;  // exactly: all units are powers of two
    require_range(found.poses[i]->translation.array().isFinite().all(), "the pose",
                  request.scans[i]);
  }
  found.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return found;
}

Json scaled(const std::optional<double>& value, double unit) {
  return value ? Json(unit * *value) : Json();
}

Json document_of(const Assembly& found, const RegisterAllRequest& request) {
  Json transforms = Json::object();
  Json unregistered = Json::array();
  Json warnings = Json::array();
  for (std::size_t i = 0; i < request.scans.size(); ++i) {
    if (found.poses[i]) {
      transforms[request.scans[i]] = matrix_of(*found.poses[i]);
    } else {
      unregistered.push_back(request.scans[i]);
    }
    for (const Json& one : warnings_of(request.scans[i], found.scans[i])) warnings.push_back(one);
  }
  Json pairs = Json::array();
  for (const ScanPairResult& pair : found.result.pairs) {
    pairs.push_back({{"moving", request.scans[static_cast<std::size_t>(pair.moving)]},
                     {"fixed", request.scans[static_cast<std::size_t>(pair.fixed)]},
                     {"overlap", pair.fit.overlap_moving},
                     {"confidence", pair.confidence},
                     {"used", pair.is_used},
                     {"loop_turn", scaled(pair.loop_turn, 180.0 / std::numbers::pi)},
                     {"loop_shift", scaled(pair.loop_shift, found.unit)}});
  }
  return {{"transforms", transforms}, {"unregistered", unregistered},
          {"pairs", pairs},           {"rmse", found.result.rmse * found.unit},
          {"seconds", found.seconds}, {"warnings", warnings}};
}

SurfaceOutput fused(const Assembly& found) {
  SurfaceOutput out;
  out.points.resize(0, 3);
  out.triangles.resize(0, 3);
  std::vector<double> scan_of;
  for (std::size_t i = 0; i < found.scans.size(); ++i) {
    if (!found.poses[i]) continue;
    append_scan(out, as_given(found.scans[i]), *found.poses[i]);
    scan_of.resize(static_cast<std::size_t>(out.points.rows()), static_cast<double>(i));
  }
  out.properties.push_back(
      {"scan",
       Eigen::Map<const Eigen::VectorXd>(scan_of.data(), static_cast<Index>(scan_of.size())),
       false});
  return out;
}

// What a shell needs to make the page again.
std::string command_of(const RegisterAllRequest& request) {
  std::string line = "dupin register-all";
  for (const std::string& scan : request.scans) line += " " + shell_quoted(scan);
  return line + " --report " + shell_quoted(request.report);
}

void run_register_all(Context& context, const RegisterAllRequest& request) {
  if (request.scans.size() < 2) throw InvalidArgument("there are fewer than two scans");
  const std::set<std::string> names(request.scans.begin(), request.scans.end());
  if (names.size() != request.scans.size())
    throw InvalidArgument("a scan is named twice", "each file once");
  if (!request.output.empty()) {
    surface_format_of(request.output);
    require_writable(request.output);
  }
  if (!request.report.empty()) {
    output_format(context, request.report, "", {"html"});
    require_writable(request.report);
  }
  Assembly found;
  with_progress(context, "register-all", [&] {
    found = solve(context, request);
    std::string page;
    if (!request.report.empty())
      page = assembly_page(found, command_of(request), context.run.stage(0.9, 1.0));
    context.run.throw_if_cancelled();
    if (!request.output.empty())
      write_surface(request.output, fused(found), surface_format_of(request.output));
    if (!request.report.empty()) write_file_atomically(request.report, page);
  });
  Index registered = 0;
  for (const auto& pose : found.poses) registered += pose ? 1 : 0;
  if (registered < static_cast<Index>(request.scans.size()))
    context.exit_code = static_cast<int>(Errc::negative);
  context.print_json(document_of(found, request));
  if (context.json) return;
  context.say(fmt::format("{} of {} scans in one frame, {} pairs, rmse {:.4g}", registered,
                          request.scans.size(), found.result.pairs.size(),
                          found.result.rmse * found.unit));
  for (std::size_t i = 0; i < request.scans.size(); ++i) {
    if (!found.poses[i]) context.say("  left out: " + escaped(request.scans[i], 200));
  }
}

}  // namespace

void add_register_all(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("register-all", "A set of scans into one frame");
  verb->footer(
      "Examples:\n  dupin register-all view*.ply -o object.ply\n"
      "  dupin register-all a.ply b.ply c.ply --json --report page.html\n\n"
      "The frame is that of the first scan of the largest set that holds together. Exit code 1: a "
      "scan found no place.");
  add_global_options(*verb, context);
  auto request = std::make_shared<RegisterAllRequest>();
  verb->add_option("SCAN", request->scans, "Scans of one object, in one unit")->required();
  verb->add_option("-o,--output", request->output,
                   "All scans that found a place, in one frame: .ply, .obj, .off, .stl or .glb");
  verb->add_option("--report", request->report,
                   "Page that shows the scans before and after, and all pairs: .html");
  verb->callback([request, &context] { run_register_all(context, *request); });
}

}  // namespace dupin::cli
