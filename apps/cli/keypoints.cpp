#include "dupin/features/keypoints.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/features/keypoint_uncertainty.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "dupin/scalespace/scale_space.h"
#include "stack_options.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

struct KeypointRequest {
  StackRequest stack;
  KeypointOptions options;
  std::string rule = "persistent";
  std::string radius = "exact";
  std::string preset;
  std::string output;
  std::string format;
  std::string noise;  // empty: no error bars; "auto" or a length
  int replicas = 32;
  double min_snr = 0.0;
  double significance = 0.0;  // 0: not asked

  bool wants_noise() const { return !noise.empty() || min_snr > 0.0 || significance > 0.0; }
};

struct Found {
  LoadedSurface surface;
  Eigen::VectorXd tau;
  KeypointSet set;
  double response_unit = 1.0;  // input unit of a local response
  bool is_thesis = false;      // radius t e: t is told beside tau
  // Error bars, when they were asked for.
  std::vector<KeypointUncertainty> uncertainty;  // aligned with the keypoints
  std::optional<double> sigma;                   // [local]
  int advised_level = -1;
};

// "thesis": everything as the thesis has it (chapter 5.1 and 5.2). An option that says otherwise
// contradicts it.
void apply_preset(const CLI::App& verb, KeypointRequest& request) {
  if (request.preset != "thesis") return;
  const auto set = [&](const char* option, std::string& value, const char* wanted) {
    if (verb.count(option) > 0 && value != wanted) {
      throw InvalidArgument(fmt::format("{} {} contradicts --preset thesis, which means {} {}",
                                        option, escaped(value, 40), option, wanted),
                            "leave one of them out");
    }
    value = wanted;
  };
  set("--signal", request.stack.signal, "H");
  set("--weights", request.stack.weights, "umbrella");
  set("--filter", request.stack.filter, "implicit");
  set("--rule", request.rule, "space-scale");
  set("--radius", request.radius, "thesis");
}

// What can be refused without looking at the surface. The default level may lie beyond a short
// stack: then rule persistent reads the position at the coarsest level there is.
void check(const CLI::App& verb, const KeypointRequest& request) {
  validate(request.stack.schedule);
  const int coarsest = request.stack.schedule.num_levels - 2;
  const auto require = [&](const char* name, int level, int low) {
    if (level >= low && level <= coarsest) return;
    throw InvalidArgument(fmt::format("{} is {}, legal range {} to {} of {} levels", name, level,
                                      low, coarsest, request.stack.schedule.num_levels));
  };
  if (request.rule == "level") {
    require("level", request.options.level, 1);
  } else if (verb.count("--level") > 0) {
    require("level", request.options.level, 0);
  }
  require("min-level", request.options.min_level, 0);
  if (request.stack.signal == "tensor") {
    throw InvalidArgument("keypoints need one value a vertex, the signal tensor has 6",
                          "--signal H");
  }
  if (request.wants_noise() && !library_signal(request.stack.signal)) {
    throw InvalidArgument(
        "the noise of the signal \"" + escaped(request.stack.signal, 40) + "\" is not known",
        "--signal height, H, K, k1 or k2");
  }
}

KeypointOptions library_options(const KeypointRequest& request) {
  static const std::map<std::string, KeypointRule> rules{{"persistent", KeypointRule::persistent},
                                                         {"space-scale", KeypointRule::space_scale},
                                                         {"level", KeypointRule::level}};
  KeypointOptions options = request.options;
  options.rule = rules.at(request.rule);
  options.measure = request.radius == "thesis" ? ScaleMeasure::thesis : ScaleMeasure::exact;
  return options;
}

void require_finite(const Found& found, const std::string& file) {
  const double unit = found.surface.unit;
  const bool is_finite =
      std::all_of(found.set.keypoints.begin(), found.set.keypoints.end(), [&](const Keypoint& p) {
        return std::isfinite(p.response * found.response_unit) && std::isfinite(p.radius * unit);
      });
  require_range(is_finite && std::isfinite(found.surface.graph.mean_edge * unit), "the response",
                file);
}

// Error bars of all keypoints, then what --min-snr, --significance and --top leave of them.
void add_noise_to(Found& found, const KeypointRequest& request, const DiffusionOperator& op,
                  const ScaleSpace& stack, Context& context) {
  const std::optional<Signal> signal = library_signal(request.stack.signal);  // see check()
  const SurfaceGraph& graph = found.surface.graph;
  const KeypointOptions options = library_options(request);
  const double sigma =
      noise_sigma_of(request.noise, found.surface, context, context.run.stage(0.6, 0.65));
  found.sigma = sigma;
  std::vector<Keypoint>& points = found.set.keypoints;
  if (sigma > 0.0) {
    SignalNoiseOptions position;
    position.sigma = sigma;
    position.normal_smoothing = request.stack.normal_smoothing;
    position.seed = context.seed;
    StackNoiseOptions replicas = keypoint_noise_options(graph, request.stack.schedule, options);
    replicas.filter = stack_options(request.stack).filter;
    replicas.num_replicas = request.replicas;
    const StackNoise noise = estimate_stack_noise(op, make_signal_noise(graph, *signal, position),
                                                  replicas, context.run.stage(0.65, 0.9));
    context.run.throw_if_cancelled();
    found.uncertainty =
        estimate_keypoint_uncertainty(graph, stack.loc, request.stack.schedule, noise, points,
                                      options, context.run.stage(0.9, 0.95));
    context.run.throw_if_cancelled();
    found.advised_level = advise_level(stack.loc, noise.loc_sd);
  } else {
    // Without noise everything is certain, and a ratio to it is no number.
    KeypointUncertainty certain;
    certain.snr = std::numeric_limits<double>::max();
    certain.p_value = 0.0;
    certain.position_sd = 0.0;
    certain.radius_sd = 0.0;
    certain.stability = 1.0;
    found.uncertainty.assign(points.size(), certain);
    found.advised_level = 0;
  }
  std::vector<Keypoint> kept;
  std::vector<KeypointUncertainty> sure;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const KeypointUncertainty& u = found.uncertainty[i];
    if (options.top > 0 && static_cast<Index>(kept.size()) == options.top) break;
    if (u.snr < request.min_snr) continue;
    if (request.significance > 0.0 && !is_significant(u, request.significance)) continue;
    kept.push_back(points[i]);
    sure.push_back(u);
  }
  points = std::move(kept);
  found.uncertainty = std::move(sure);
}

Found find(Context& context, const KeypointRequest& request) {
  Found found;
  found.surface = load_surface(request.stack.mesh, context, request.stack.neighbors);
  const SignalColumns signal = make_signal(found.surface, request.stack, context);
  if (signal.columns.cols() != 1) {
    throw InvalidArgument("keypoints need one value a vertex, the signal has " +
                          std::to_string(signal.columns.cols()));
  }
  found.response_unit = signal.to_input;
  const DiffusionOperator op = make_operator(found.surface, request.stack, context);
  ScaleSpaceOptions options = stack_options(request.stack);
  options.want_levels = false;
  const ScaleSpace stack =
      compute_scale_space(op, signal.columns.col(0), options, context.run.stage(0.25, 0.9));
  context.run.throw_if_cancelled();
  found.tau = stack.tau;
  const double scale = signal.columns.size() > 0 ? signal.columns.cwiseAbs().maxCoeff() : 0.0;
  KeypointOptions wanted = library_options(request);
  wanted.contrast_power = signal.length_power;
  if (request.wants_noise()) wanted.top = 0;  // the strongest of those that are kept
  found.set = find_keypoints(found.surface.graph, stack.loc, request.stack.schedule, scale, wanted,
                             context.run.stage(0.9, 1.0));
  context.run.throw_if_cancelled();
  found.is_thesis = request.radius == "thesis";
  require_finite(found, request.stack.mesh);
  if (request.wants_noise()) add_noise_to(found, request, op, stack, context);
  return found;
}

const char* kind_name(const Keypoint& point) {
  return point.kind == KeypointKind::maximum ? "max" : "min";
}

// The error bars of keypoint i as names and values; absent ones are null.
std::vector<std::pair<const char*, std::optional<double>>> error_bars(const Found& found,
                                                                      std::size_t i) {
  std::optional<double> snr;
  std::optional<double> p_value;
  std::optional<double> position;
  std::optional<double> radius;
  std::optional<double> stability;
  if (i < found.uncertainty.size()) {
    const KeypointUncertainty& u = found.uncertainty[i];
    if (u.snr < std::numeric_limits<double>::max()) snr = u.snr;
    p_value = u.p_value;
    if (u.position_sd) position = *u.position_sd * found.surface.unit;
    if (u.radius_sd) radius = *u.radius_sd * found.surface.unit;
    stability = u.stability;
  }
  return {{"snr", snr},
          {"p_value", p_value},
          {"position_sd", position},
          {"radius_sd", radius},
          {"stability", stability}};
}

Json document_of(const Found& found) {
  Json list = Json::array();
  for (std::size_t i = 0; i < found.set.keypoints.size(); ++i) {
    const Keypoint& p = found.set.keypoints[i];
    const auto at = [&](const Points& points) {
      return Json::array({points(p.vertex, 0), points(p.vertex, 1), points(p.vertex, 2)});
    };
    list.push_back({{"vertex", found.surface.input_vertex[static_cast<std::size_t>(p.vertex)]},
                    {"position", at(found.surface.points)},
                    {"normal", at(found.surface.graph.normals)},
                    {"level", p.level},
                    {"tau", p.tau},
                    {"radius", p.radius * found.surface.unit},
                    {"response", p.response * found.response_unit},
                    {"kind", kind_name(p)},
                    {"persistence", p.persistence}});
    for (const auto& [name, value] : error_bars(found, i))
      list.back()[name] = number_or_null(value);
    if (found.is_thesis) list.back()["t"] = p.t;
  }
  return {
      {"mean_edge_length", found.surface.graph.mean_edge * found.surface.unit},
      {"tau", std::vector<double>(found.tau.data(), found.tau.data() + found.tau.size())},
      {"noise_sigma", number_or_null(found.sigma ? std::optional(*found.sigma * found.surface.unit)
                                                 : std::nullopt)},
      {"advised_level", found.advised_level >= 0 ? Json(found.advised_level) : Json(nullptr)},
      {"keypoints", list},
      {"warnings", to_json(found.surface.warnings)}};
}

std::string to_csv(const Found& found) {
  std::string text =
      "vertex,x,y,z,nx,ny,nz,level,tau,radius,response,kind,persistence,snr,p_value,position_sd,"
      "radius_sd,stability\n";
  for (std::size_t i = 0; i < found.set.keypoints.size(); ++i) {
    const Keypoint& p = found.set.keypoints[i];
    const auto x = found.surface.points.row(p.vertex);
    const auto n = found.surface.graph.normals.row(p.vertex);
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}",
                        found.surface.input_vertex[static_cast<std::size_t>(p.vertex)], x[0], x[1],
                        x[2], n[0], n[1], n[2], p.level, p.tau, p.radius * found.surface.unit,
                        p.response * found.response_unit, kind_name(p), p.persistence);
    for (const auto& [name, value] : error_bars(found, i))
      text += value ? fmt::format(",{}", *value) : ",";
    text += "\n";
  }
  return text;
}

SurfaceOutput to_points(const Found& found) {
  SurfaceOutput out;
  const auto count = static_cast<Index>(found.set.keypoints.size());
  out.points.resize(count, 3);
  out.triangles.resize(0, 3);
  const char* names[] = {"nx",  "ny",     "nz",       "vertex",  "level",
                         "tau", "radius", "response", "maximum", "persistence"};
  for (const char* name : names) out.properties.push_back({name, Eigen::VectorXd(count), false});
  if (found.sigma) {
    for (const char* name : {"snr", "p_value", "position_sd", "radius_sd", "stability"})
      out.properties.push_back({name, Eigen::VectorXd(count), false});
  }
  for (Index i = 0; i < count; ++i) {
    const Keypoint& p = found.set.keypoints[static_cast<std::size_t>(i)];
    out.points.row(i) = found.surface.points.row(p.vertex);
    const double values[] = {
        found.surface.graph.normals(p.vertex, 0),
        found.surface.graph.normals(p.vertex, 1),
        found.surface.graph.normals(p.vertex, 2),
        static_cast<double>(found.surface.input_vertex[static_cast<std::size_t>(p.vertex)]),
        static_cast<double>(p.level),
        p.tau,
        p.radius * found.surface.unit,
        p.response * found.response_unit,
        p.kind == KeypointKind::maximum ? 1.0 : 0.0,
        static_cast<double>(p.persistence)};
    for (std::size_t k = 0; k < std::size(values); ++k) out.properties[k].values[i] = values[k];
    if (!found.sigma) continue;
    // A PLY has no way to say "absent": -1, which none of them can be.
    std::size_t column = std::size(values);
    for (const auto& [name, value] : error_bars(found, static_cast<std::size_t>(i)))
      out.properties[column++].values[i] = value.value_or(-1.0);
  }
  return out;
}

void write(const Found& found, const std::string& path, const std::string& format) {
  if (format == "json") {
    write_file_atomically(path, to_text(document_of(found)));
  } else if (format == "csv") {
    write_file_atomically(path, to_csv(found));
  } else {
    write_surface(path, to_points(found), SurfaceFormat::ply_binary);
  }
}

void run_keypoints(const CLI::App& verb, Context& context, KeypointRequest& request) {
  apply_preset(verb, request);
  check(verb, request);
  // --format speaks of standard output when that is written, else of standard input.
  std::string format;
  if (!request.output.empty())
    format = output_format(context, request.output, request.format, {"ply", "json", "csv"});
  if (request.output != "-") context.read.stdin_format = request.format;
  Found found;
  with_progress(context, "keypoints", [&] {
    found = find(context, request);
    if (!request.output.empty() && !context.run.cancelled()) write(found, request.output, format);
  });
  context.print_json(document_of(found));
  if (context.json) return;
  context.say(fmt::format("{} keypoints on {} vertices, mean edge {:.6g}",
                          found.set.keypoints.size(), found.surface.num_input_vertices,
                          found.surface.graph.mean_edge * found.surface.unit));
  if (found.sigma) {
    context.say(
        fmt::format("noise {:.4g}; {}", *found.sigma * found.surface.unit,
                    found.advised_level < 0
                        ? "no level smooths it away"
                        : fmt::format("smooth to level {} or above for it", found.advised_level)));
  }
  context.say("  vertex  level     radius   response  kind       snr  p-value");
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 0; i < std::min(kShown, found.set.keypoints.size()); ++i) {
    const Keypoint& p = found.set.keypoints[i];
    const auto bars = error_bars(found, i);
    context.say(fmt::format("{:8d} {:6d} {:10.4g} {:10.3g}  {}{}{}",
                            found.surface.input_vertex[static_cast<std::size_t>(p.vertex)], p.level,
                            p.radius * found.surface.unit, p.response * found.response_unit,
                            kind_name(p),
                            bars[0].second ? fmt::format("  {:8.2f}", *bars[0].second) : "",
                            bars[1].second ? fmt::format("  {:7.2g}", *bars[1].second) : ""));
  }
  if (found.set.keypoints.size() > kShown) context.say("  ... all of them with --json or -o");
}

}  // namespace

void add_keypoints(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("keypoints", "Features with position, scale and sign");
  verb->footer(
      "Example:\n  dupin keypoints armadillo.off --json > kp.json\n  dupin keypoints cloud.xyz "
      "--rule level --level 18 -o kp.ply\n\n"
      "kind is the extremum of the Laplacian of the signal: a bump is a minimum where normals "
      "point outward.");
  add_global_options(*verb, context);
  auto request = std::make_shared<KeypointRequest>();
  add_stack_options(*verb, request->stack);
  KeypointOptions& options = request->options;
  verb->add_option("--rule", request->rule, "Which extrema are keypoints")
      ->check(CLI::IsMember({"space-scale", "persistent", "level"}))
      ->capture_default_str();
  verb->add_option("--level", options.level,
                   "Level of --rule level; where --rule persistent reads the position")
      ->check(CLI::Range(0, 999))
      ->capture_default_str();
  verb->add_option("--min-level", options.min_level, "Finest level considered; 0: by the rule")
      ->check(CLI::Range(0, 999))
      ->capture_default_str();
  verb->add_option("--min-persistence", options.min_persistence,
                   "Levels over which an extremum must be followed")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb->add_option("--min-contrast", options.min_contrast,
                   "Smallest |response| times radius (K: its square; FILE.npy: |response|)")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--max-edge-ratio", options.max_edge_ratio,
                   "Remove responses more edge-like than this; 0: keep")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--top", options.top, "Keep the N strongest; 0: all")
      ->check(CLI::Range(Index{0}, Index{1} << 31))
      ->capture_default_str();
  verb->add_option("--radius", request->radius, "Radius law: exact sqrt(tau) e, thesis t e")
      ->check(CLI::IsMember({"exact", "thesis"}))
      ->capture_default_str();
  verb->add_option("--preset", request->preset,
                   "thesis: signal H, space-scale rule, scales and radii of the thesis")
      ->check(CLI::IsMember({"thesis"}));
  verb->add_option("--noise", request->noise,
                   "Error bars for noise of this standard deviation in every coordinate; auto: "
                   "estimated from the surface");
  verb->add_option("--replicas", request->replicas, "Replicas of the noise, in sixteens")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str();
  verb->add_option("--min-snr", request->min_snr,
                   "Smallest ratio of a response to its standard deviation (implies --noise auto)")
      ->check(in_range(0.0, 1e300))
      ->capture_default_str();
  verb->add_option("--significance", request->significance,
                   "Keep what noise imitates or moves by two edges with at most this probability "
                   "(implies --noise auto); 0: keep all")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  verb->add_option("-o,--output", request->output, "Keypoints to write: .ply, .json or .csv");
  std::vector<std::string> formats = input_formats();
  formats.insert(formats.end(), {"json", "csv"});
  verb->add_option("--format", request->format,
                   "Format of standard output (ply, json, csv) with -o -, else of standard input "
                   "where its content does not tell")
      ->check(CLI::IsMember(formats));
  verb->callback([request, verb, &context] { run_keypoints(*verb, context, *request); });
}

}  // namespace dupin::cli
