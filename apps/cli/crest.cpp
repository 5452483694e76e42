#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "context.h"
#include "crest_report.h"
#include "crest_verb.h"
#include "dupin/base/error.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/crest/crest_noise.h"
#include "dupin/io/file.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/render/camera.h"
#include "dupin/surface/signal_noise.h"
#include "line_files.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

struct CrestRequest {
  std::string mesh;
  CrestOptions options;
  std::string filter = "implicit";
  std::string output;
  std::string format;
  std::string noise;  // empty: estimated, but no error bars
  int replicas = 12;
  double min_snr = 0.0;
  int top = 0;
  std::string report;
  std::string view = "iso";
  std::vector<double> added_noise;  // [percent of the mean edge]

  bool wants_bars() const { return !noise.empty() || min_snr > 0.0 || !report.empty(); }
};

// Standard deviation of every coordinate, in local units. A surface too small to tell its noise has
// that of rounding: only error bars must know it.
double noise_sigma(const CrestRequest& request, const std::string& noise, LoadedSurface& surface,
                   Context& context, const RunControl& run) {
  try {
    return noise_sigma_of(noise, surface, context, run);
  } catch (const AnalysisError&) {
    if (request.wants_bars()) throw;
    return estimate_rounding(surface.points) / surface.unit;
  }
}

// Error bars, and what --min-snr and --top leave.
void add_noise_to(CrestAnalysis& found, const CrestRequest& request, const CrestOptions& options,
                  Context& context, const RunControl& run) {
  std::vector<CrestLine>& lines = found.set.lines;
  if (request.wants_bars() && found.sigma > 0.0) {
    CrestNoiseOptions noise;
    noise.sigma = found.sigma;
    noise.num_replicas = request.replicas;
    noise.seed = context.seed;
    found.uncertainty =
        estimate_crest_uncertainty(found.surface.graph, found.set, options, noise, run).lines;
    context.run.throw_if_cancelled();
  } else if (request.wants_bars()) {
    // Without noise everything is certain.
    for (const CrestLine& line : lines) {
      CrestUncertainty certain;
      certain.point_sd.assign(line.points.size(), 0.0);
      certain.snr = std::numeric_limits<double>::max();
      found.uncertainty.push_back(certain);
    }
  }
  std::vector<CrestLine> kept;
  std::vector<CrestUncertainty> sure;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (request.top > 0 && kept.size() == static_cast<std::size_t>(request.top)) break;
    if (request.wants_bars()) {
      if (found.uncertainty[i].snr < request.min_snr) continue;
      sure.push_back(found.uncertainty[i]);
    }
    kept.push_back(std::move(lines[i]));
  }
  lines = std::move(kept);
  found.uncertainty = std::move(sure);
}

// Lines of `surface`, whose noise is what --noise says.
CrestAnalysis analyse(LoadedSurface surface, const CrestRequest& request, const std::string& noise,
                      Context& context, const RunControl& run) {
  CrestAnalysis found;
  found.surface = std::move(surface);
  if (!found.surface.graph.is_mesh()) {
    throw AnalysisError("E_NO_FACES", "crest lines need faces, this is a point cloud",
                        "triangulate the points first");
  }
  found.sigma = noise_sigma(request, noise, found.surface, context, run.stage(0.0, 0.1));
  CrestOptions options = request.options;
  options.noise_sigma = found.sigma;
  found.set = find_crest_lines(found.surface.graph, options,
                               run.stage(0.1, request.wants_bars() ? 0.2 : 1.0));
  context.run.throw_if_cancelled();
  add_noise_to(found, request, options, context, run.stage(0.2, 1.0));
  const double unit = found.surface.unit;
  require_range(std::isfinite(found.surface.graph.mean_edge * unit) &&
                    std::all_of(found.set.lines.begin(), found.set.lines.end(),
                                [&](const CrestLine& line) {
                                  return std::isfinite(line.length * unit) &&
                                         std::isfinite(line.mean_scale * unit);
                                }),
                "a length", request.mesh);
  return found;
}

// The surface of `clean` with noise along its normals, which is estimated anew.
CrestSubject with_noise(const CrestAnalysis& clean, double percent, const CrestRequest& request,
                        Context& context, const RunControl& run) {
  const PolygonMesh noisy =
      to_polygon_mesh(add_noise({clean.surface.points, clean.surface.graph.triangles},
                                {.percent = percent, .seed = context.seed})
                          .mesh);
  return {analyse(to_loaded_surface(noisy, request.mesh, context), request, "auto", context, run),
          percent};
}

// In the unit and the coordinates of the input.
std::vector<LineRecord> to_records(const CrestAnalysis& found) {
  std::vector<LineRecord> records;
  for (std::size_t i = 0; i < found.set.lines.size(); ++i) {
    const CrestLine& line = found.set.lines[i];
    LineRecord record;
    record.kind = line.kind;
    record.points.resize(static_cast<Eigen::Index>(line.points.size()), 3);
    for (std::size_t k = 0; k < line.points.size(); ++k) {
      const CrestPoint& p = line.points[k];
      record.points.row(static_cast<Eigen::Index>(k)) =
          (1.0 - p.edge.weight) * found.surface.points.row(p.edge.a) +
          p.edge.weight * found.surface.points.row(p.edge.b);
      record.scale.push_back(p.radius * found.surface.unit);
      record.strength.push_back(p.strength);
      record.strength_sd.push_back(found.uncertainty.empty() ? -1.0
                                                             : found.uncertainty[i].point_sd[k]);
    }
    records.push_back(std::move(record));
  }
  return records;
}

Json document_of(const CrestAnalysis& found) {
  const double unit = found.surface.unit;
  Json list = Json::array();
  for (std::size_t i = 0; i < found.set.lines.size(); ++i) {
    const CrestLine& line = found.set.lines[i];
    double level = 0.0;
    std::size_t peaks = 0;
    for (const CrestPoint& p : line.points) {
      level += p.level / static_cast<double>(line.points.size());
      peaks += p.is_scale_peak ? 1 : 0;
    }
    list.push_back(
        {{"kind", kind_name(line)},
         {"points", line.points.size()},
         {"length", line.length * unit},
         {"strength", line.strength},
         {"mean_scale", line.mean_scale * unit},
         {"closed", line.is_closed},
         {"sharpness", line.sharpness},
         {"mean_level", level},
         {"scale_peaks", static_cast<double>(peaks) / static_cast<double>(line.points.size())}});
    std::optional<double> bars[4];
    if (!found.uncertainty.empty()) {
      const CrestUncertainty& u = found.uncertainty[i];
      bars[0] = u.strength_sd;
      bars[1] = u.sharpness_sd;
      bars[2] = u.position_sd * unit;
      if (u.snr < std::numeric_limits<double>::max()) bars[3] = u.snr;
    }
    const char* names[] = {"strength_sd", "sharpness_sd", "position_sd", "snr"};
    for (std::size_t k = 0; k < 4; ++k) list.back()[names[k]] = number_or_null(bars[k]);
  }
  return {{"mean_edge_length", found.surface.graph.mean_edge * unit},
          {"tau",
           std::vector<double>(found.set.tau.data(), found.set.tau.data() + found.set.tau.size())},
          {"noise_sigma", found.sigma * unit},
          {"lines", list},
          {"warnings", to_json(found.surface.warnings)}};
}

void run_crest(Context& context, CrestRequest& request) {
  request.options.filter = request.filter == "heat" ? Filter::heat : Filter::implicit;
  validate(request.options);
  // --format speaks of standard output when that is written, else of standard input.
  std::string format;
  if (!request.output.empty())
    format = output_format(context, request.output, request.format, {"obj", "ply"});
  if (request.report == "-")
    throw InvalidArgument("--report needs a file, its pictures lie beside it");
  if (!request.report.empty()) {
    output_format(context, request.report, "", {"html", "htm"});
    require_writable(request.report);
  } else if (!request.added_noise.empty()) {
    throw InvalidArgument("--add-noise is for the page of --report");
  }
  if (!request.output.empty() && request.output != "-") require_writable(request.output);
  camera_of(request.view);
  if (request.output != "-") context.read.stdin_format = request.format;
  CrestAnalysis found;
  with_progress(context, "crest", [&] {
    const double share = 1.0 / static_cast<double>(request.added_noise.size() + 1);
    LoadedSurface surface = load_surface(request.mesh, context);
    found = analyse(std::move(surface), request, request.noise, context,
                    context.run.stage(0.0, request.report.empty() ? 1.0 : 0.9 * share));
    // Last, after the page: a run that is stopped leaves no lines.
    const auto write_lines = [&] {
      if (request.output.empty()) return;
      const std::vector<LineRecord> records = to_records(found);
      write_file_atomically(request.output,
                            format == "obj" ? lines_as_obj(records) : lines_as_ply(records));
    };
    if (request.report.empty()) return write_lines();
    std::vector<CrestSubject> subjects(1);
    subjects[0].found = found;
    for (std::size_t i = 0; i < request.added_noise.size(); ++i) {
      const double done = static_cast<double>(i + 1);
      subjects.push_back(
          with_noise(found, request.added_noise[i], request, context,
                     context.run.stage(0.9 * share * done, 0.9 * share * (done + 1.0))));
    }
    write_crest_report(request.report, request.mesh, request.view, subjects, context);
    write_lines();
  });
  context.print_json(document_of(found));
  if (context.json) return;
  const double unit = found.surface.unit;
  double length = 0.0;
  for (const CrestLine& line : found.set.lines) length += line.length * unit;
  context.say(
      fmt::format("{} crest lines, length {:.6g}, on {} vertices, mean edge {:.6g}, noise {:.4g}",
                  found.set.lines.size(), length, found.surface.num_input_vertices,
                  found.surface.graph.mean_edge * unit, found.sigma * unit));
  context.say("  kind     points     length  strength      scale       snr");
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 0; i < std::min(kShown, found.set.lines.size()); ++i) {
    const CrestLine& line = found.set.lines[i];
    const bool has_snr =
        !found.uncertainty.empty() && found.uncertainty[i].snr < std::numeric_limits<double>::max();
    context.say(fmt::format("  {:6s} {:8d} {:10.4g} {:9.3g} {:10.4g}{}", kind_name(line),
                            line.points.size(), line.length * unit, line.strength,
                            line.mean_scale * unit,
                            has_snr ? fmt::format("  {:8.2f}", found.uncertainty[i].snr) : ""));
  }
  if (found.set.lines.size() > kShown) context.say("  ... all of them with --json or -o");
}

}  // namespace

void add_crest(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("crest", "Ridges and valleys as lines with their scales");
  verb->footer(
      "Examples:\n  dupin crest armadillo.off -o lines.ply\n"
      "  dupin render armadillo.off --lines lines.ply -o lines.png\n"
      "  dupin crest scan.ply --min-snr 2 --json\n"
      "  dupin crest armadillo.off --report lines.html --add-noise 20,50\n\n"
      "strength is the angle [rad] that the surface turns more across a line than along it, over "
      "its scale.");
  add_global_options(*verb, context);
  auto request = std::make_shared<CrestRequest>();
  CrestOptions& options = request->options;
  verb->add_option("MESH", request->mesh, "Surface; - reads standard input")->required();
  verb->add_option("--level", options.level,
                   "Lines of this level alone; 0: every place at its own scale")
      ->check(CLI::Range(0, 63))
      ->capture_default_str();
  verb->add_option("--gamma", options.gamma,
                   "Scale: first maximum of tau^(gamma/2) (|k0| - |k1|); 0.5 suits rounded creases")
      ->check(in_range(1e-6, 2.0))
      ->capture_default_str();
  verb->add_option("--levels", options.schedule.num_levels, "Levels of the stack")
      ->check(CLI::Range(2, 64))
      ->capture_default_str();
  verb->add_option("--finest", options.finest, "Finest level that can be a scale")
      ->check(CLI::Range(1, 63))
      ->capture_default_str();
  verb->add_option("--filter", request->filter, "implicit: the thesis's; heat: exact diffusion")
      ->check(CLI::IsMember({"implicit", "heat"}))
      ->capture_default_str();
  verb->add_option("--normal-smoothing", options.normal_smoothing,
                   "Times that normals are averaged")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  verb->add_option("--high", options.high, "Strength that a line has somewhere")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--low", options.low, "Strength that a line has everywhere")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--min-sharpness", options.min_sharpness,
                   "Least share of its curvature that a line stands out by")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--min-length", options.min_length, "Shortest line, in mean edges")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--max-gap", options.max_gap, "Widest gap that is closed, in mean edges")
      ->check(in_range(0.0, 100.0))
      ->capture_default_str();
  verb->add_option("--top", request->top, "Keep the N strongest; 0: all")
      ->check(CLI::Range(0, 1'000'000'000))
      ->capture_default_str();
  verb->add_option("--noise", request->noise,
                   "Error bars for noise of this standard deviation in every coordinate; auto: "
                   "estimated from the surface");
  verb->add_option("--replicas", request->replicas, "Replicas of the noise")
      ->check(CLI::Range(4, 1000))
      ->capture_default_str();
  verb->add_option("--min-snr", request->min_snr,
                   "Smallest ratio of strength and of sharpness to their noise (implies --noise "
                   "auto)")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("-o,--output", request->output, "Lines to write: .obj or .ply");
  verb->add_option("--report", request->report,
                   "Page with pictures and tables of the lines (implies --noise auto)");
  verb->add_option("--view", request->view, "Of the pictures, as in dupin render")
      ->capture_default_str();
  verb->add_option("--add-noise", request->added_noise,
                   "The page shows copies with these noises as well [percent of the mean edge]")
      ->delimiter(',')
      ->check(in_range(1e-6, 1000.0));
  std::vector<std::string> formats = input_formats();
  for (const char* name : {"obj", "ply"}) {
    if (std::find(formats.begin(), formats.end(), name) == formats.end()) formats.push_back(name);
  }
  verb->add_option("--format", request->format,
                   "Format of standard output (obj, ply) with -o -, else of standard input where "
                   "its content does not tell")
      ->check(CLI::IsMember(formats));
  verb->callback([request, &context] { run_crest(context, *request); });
}

}  // namespace dupin::cli
