#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/version.h"
#include "dupin/io/file.h"
#include "dupin/warp/sha256.h"
#include "warp_apply_row.h"
#include "warp_input.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr const char* kReport = "report.json";
constexpr const char* kPage = "report.html";
constexpr double kSecondsBetweenReports = 2.0;  // so that thousands of rows are not written often

struct ApplyRequest {
  std::string project;
  std::vector<std::string> images;
  std::string directory;
  std::string rule = "relative";
  double min_confidence = 0.5;
  int jobs = 1;
  bool has_page = false;
};

std::string path_in(const ApplyRequest& request, const std::string& name) {
  return (fs::path(request.directory) / name).string();
}

// Each output is one file of one picture, and none is an input; `picture` is the template's.
void require_names(const ApplyRequest& request, const std::string& picture) {
  std::set<std::string> inputs;
  for (const std::string& image : request.images) {
    if (image == "-") throw InvalidArgument("a collection is of files, not standard input");
    inputs.insert(whole_path(image));
  }
  for (const std::string& file : {request.project, picture}) {
    if (!file.empty()) inputs.insert(whole_path(file));
  }
  const auto require_no_input = [&](const std::string& name) {
    if (inputs.count(whole_path(path_in(request, name))) == 0) return;
    throw InvalidArgument("the output " + escaped(path_in(request, name)) + " is an input",
                          "another directory for -o");
  };
  require_no_input(kReport);
  require_no_input(kPage);
  std::map<std::string, std::string> owner = {{kReport, "the report"}, {kPage, "the report"}};
  for (const std::string& image : request.images) {
    const ApplyOutputs names = outputs_of(image);
    for (const std::string& name : {names.project, names.picture, names.strip}) {
      const auto [place, is_new] = owner.emplace(name, image);
      if (!is_new) {
        throw InvalidArgument("two pictures would be written to " + escaped(name) + ": " +
                                  escaped(place->second) + " and " + escaped(image),
                              "give each a name of its own");
      }
      require_no_input(name);
    }
  }
}

void make_directory(const std::string& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (!error && !fs::is_directory(directory, error))
    error = std::make_error_code(std::errc::not_a_directory);
  if (error) throw IoError(Errc::cannot_write, "E_WRITE", error.message(), {directory, 0, -1});
}

// Rows of an earlier run by picture. A report that is not ours is no report.
std::map<std::string, Json> earlier_rows(const ApplyRequest& request, const Context& context) {
  std::map<std::string, Json> rows;
  try {
    const std::string file = path_in(request, kReport);
    const FileBytes bytes = FileBytes::open(file, context.read.limits, context.run);
    const Json report =
        bytes.judge(file, [&] { return Json::parse(bytes.bytes().begin(), bytes.bytes().end()); });
    for (const Json& row : report.at("rows")) {
      if (is_intact(row)) rows[row.at("image").get<std::string>()] = row;
    }
  } catch (const IoError&) {
    return {};
  } catch (const nlohmann::json::exception&) {
    return {};
  }
  return rows;
}

ApplyJob job_of(const ApplyRequest& request, Context& context, const RunControl& run) {
  const WarpInput input = load_warp(request.project, context, run.stage(0.0, 0.3));
  require_names(request, input.picture.file);
  const ProjectMesh mesh = mesh_of(input, context, run.stage(0.3, 0.6));
  ApplyJob job{
      context, make_pose_template(input.project, mesh, run.stage(0.6, 1.0)), {}, {}, 0.5, false,
      {}};
  run.throw_if_cancelled();
  job.options.rule = request.rule == "absolute" ? TargetRule::absolute : TargetRule::relative;
  job.directory = request.directory;
  job.min_confidence = request.min_confidence;
  job.has_page = request.has_page;
  job.template_digest = sha256_hex(fmt::format("{}\n{}\n{}\n{}\n{}\n{}", kVersion, request.rule,
                                               request.min_confidence, request.has_page,
                                               context.strict, format_project(input.project)));
  return job;
}

std::string command_of(const ApplyRequest& request, bool is_strict) {
  std::string line = "dupin warp apply " + shell_quoted(request.project);
  for (const std::string& image : request.images) line += " " + shell_quoted(image);
  line += " -o " + shell_quoted(request.directory) + " --report";
  if (request.rule != "relative") line += " --target-rule " + request.rule;
  if (request.min_confidence != ApplyRequest{}.min_confidence)
    line += fmt::format(" --min-confidence {}", request.min_confidence);
  return is_strict ? line + " --strict" : line;
}

Json report_of(const ApplyRequest& request, const Json& rows) {
  std::map<std::string, std::size_t> count;
  for (const Json& row : rows) ++count[row.at("status").get<std::string>()];
  return {{"schema", "dupin-warp-apply-1"},
          {"dupin_version", kVersion},
          {"template", request.project},
          {"target_rule", request.rule},
          {"min_confidence", request.min_confidence},
          {"images", request.images.size()},
          {"ok", count["ok"]},
          {"doubtful", count["doubtful"]},
          {"failed", count["failed"]},
          {"rows", rows}};
}

Json apply_all(Context& context, const ApplyRequest& request) {
  const RunControl& run = context.run;
  if (request.directory.empty() || request.directory == "-")
    throw InvalidArgument("-o needs a directory");
  require_names(request, "");
  const ApplyJob job = job_of(request, context, run.stage(0.0, 0.05));
  make_directory(request.directory);
  require_writable(path_in(request, kReport));
  if (request.has_page) require_writable(path_in(request, kPage));
  const std::map<std::string, Json> earlier = earlier_rows(request, context);
  const auto count = static_cast<Eigen::Index>(request.images.size());
  std::vector<Json> made(request.images.size());
  Json rows = Json::array();
  auto written = std::chrono::steady_clock::now();
  for (Eigen::Index first = 0; first < count; first += request.jobs) {
    const Eigen::Index last = std::min(count, first + request.jobs);
    parallel_for(first, last, 1, [&](Eigen::Index begin, Eigen::Index end) {
      for (Eigen::Index i = begin; i < end && !run.cancelled(); ++i) {
        const std::string& image = request.images[static_cast<std::size_t>(i)];
        const auto before = earlier.find(image);
        const auto share = [&](Eigen::Index k) {
          return 0.05 + 0.9 * static_cast<double>(k) / static_cast<double>(count);
        };
        made[static_cast<std::size_t>(i)] =
            apply_row(job, image, before == earlier.end() ? Json() : before->second,
                      run.stage(share(i), share(i + 1)));
      }
    });
    for (Eigen::Index i = first; i < last; ++i) {
      if (const Json& row = made[static_cast<std::size_t>(i)]; !row.is_null()) rows.push_back(row);
    }
    // What is finished is known, should the run be stopped; what an earlier run finished, too.
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - written;
    if (since.count() > kSecondsBetweenReports || run.cancelled() || last == count) {
      Json known = rows;
      for (Eigen::Index i = 0; i < count; ++i) {
        const auto before = earlier.find(request.images[static_cast<std::size_t>(i)]);
        if (before != earlier.end() && made[static_cast<std::size_t>(i)].is_null())
          known.push_back(before->second);
      }
      write_file_atomically(path_in(request, kReport), to_text(report_of(request, known)));
      written = std::chrono::steady_clock::now();
    }
    run.throw_if_cancelled();
  }
  if (request.has_page)
    write_file_atomically(path_in(request, kPage),
                          apply_page(job, rows, command_of(request, context.strict)));
  return rows;
}

void run_apply(Context& context, const ApplyRequest& request) {
  const auto start = std::chrono::steady_clock::now();
  Json rows;
  with_progress(context, "warp apply", [&] { rows = apply_all(context, request); });
  Json document = report_of(request, rows);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  document["reused"] = std::count_if(rows.begin(), rows.end(),
                                     [](const Json& row) { return row.at("reused") == true; });
  document["seconds"] = seconds.count();
  if (document.at("doubtful") != 0 || document.at("failed") != 0)
    context.exit_code = static_cast<int>(Errc::negative);
  context.print_json(document);
  if (context.json) return;
  for (const Json& row : rows) {
    const std::string status = row.at("status").get<std::string>();
    if (status == "ok") continue;
    const auto part = [&](const char* name) { return row.at("error").at(name).get<std::string>(); };
    const std::string reason =
        status == "failed" ? part("code") + ": " + part("message") : row.at("reasons").dump();
    context.say(fmt::format("  {}: {}: {}", escaped(row.at("image").get<std::string>()), status,
                            escaped(reason)));
  }
  context.say(fmt::format("{} pictures: {} good, {} to look at, {} failed, {} as before, {:.1f} s",
                          rows.size(), document.at("ok").get<std::size_t>(),
                          document.at("doubtful").get<std::size_t>(),
                          document.at("failed").get<std::size_t>(),
                          document.at("reused").get<std::size_t>(), seconds.count()));
}

}  // namespace

void add_warp_apply(CLI::App& warp, Context& context) {
  CLI::App* verb = warp.add_subcommand("apply", "One pose onto a whole collection");
  verb->footer(
      "Examples:\n  dupin warp apply pose.dwarp shirts/*.png -o posed\n"
      "  dupin warp apply pose.dwarp shirts/*.png -o posed --report --jobs 2 --json\n\n"
      "Each picture gets a project and a warped picture; DIR/report.json has a row for each. "
      "Pictures that are done already, from the same inputs, are left as they are. Exit code 1: "
      "some are doubtful or failed.");
  add_global_options(*verb, context);
  auto request = std::make_shared<ApplyRequest>();
  verb->add_option("PROJECT", request->project, "The pose: a project on a picture like the others")
      ->required();
  verb->add_option("IMAGE", request->images, "PNGs whose background is transparent")->required();
  verb->add_option("-o,--output", request->directory, "Directory for all that is made")->required();
  verb->add_flag("--report", request->has_page, "Also DIR/report.html, with pictures");
  verb->add_option("--target-rule", request->rule,
                   "relative: targets move with their pins and the size; absolute: they stay "
                   "where they are in the picture")
      ->check(CLI::IsMember({"relative", "absolute"}))
      ->capture_default_str();
  verb->add_option("--min-confidence", request->min_confidence,
                   "A picture with a match or a pin below this is doubtful")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  verb->add_option("--jobs", request->jobs, "Pictures at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  verb->callback([request, &context] { run_apply(context, *request); });
}

}  // namespace dupin::cli
