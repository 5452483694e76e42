#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>

#include "context.h"
#include "dupin/base/decimal.h"
#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/file.h"
#include "dupin/io/npz.h"
#include "dupin/io/surface_io.h"
#include "dupin/mls/local_scale.h"
#include "dupin/mls/noise_level.h"
#include "html_report.h"
#include "mls_verbs.h"
#include "surface_input.h"
#include "surface_picture.h"
#include "svg_plot.h"

namespace dupin::cli {
namespace {

constexpr int kReportExperiments = 100;  // L of the thesis
constexpr std::size_t kListed = 20;

struct ScaleRequest {
  std::string cloud;
  std::string output;
  std::string report;
  std::vector<std::string> fields;  // NAME=FILE.npy
  std::string noise = "auto";
  std::string preset = "default";
  std::int64_t samples = 200;
  std::int64_t vertex = -1;  // of the input; -1: samples
  std::vector<int> sizes;
  int realisations = 100;
  int experiments = 20;
  double significance = 0.05;
  bool has_experiments = false;  // given, not the default
};

struct Answer {
  LoadedSurface surface;
  LocalScaleOptions options;
  Points points;       // in which the scale is sought
  double unit = 1.0;   // input length of one length of these
  double sigma = 0.0;  // input unit
  bool is_estimated = false;
  LocalScaleField field;
  std::vector<PatchValidation> validations;
};

double given_noise(const std::string& text) {
  const char* at = text.data();
  const char* const end = at + text.size();
  double sigma = 0.0;
  if (!parse_decimal(at, end, sigma) || at != end || sigma <= 0.0) {
    throw InvalidArgument("--noise is neither auto nor a number > 0");
  }
  return sigma;
}

std::vector<std::int32_t> chosen_vertices(const LoadedSurface& surface, const ScaleRequest& request,
                                          std::uint64_t seed) {
  if (request.vertex >= 0) {
    if (request.vertex >= surface.num_input_vertices ||
        surface.analysis_vertex[static_cast<std::size_t>(request.vertex)] < 0) {
      throw InvalidArgument(
          fmt::format("--vertex {} is not a vertex of the surface", request.vertex));
    }
    return {surface.analysis_vertex[static_cast<std::size_t>(request.vertex)]};
  }
  std::vector<std::int32_t> all(static_cast<std::size_t>(surface.graph.points.rows()));
  std::iota(all.begin(), all.end(), 0);
  const auto wanted = static_cast<std::size_t>(request.samples);
  if (wanted == 0 || wanted >= all.size()) return all;
  Rng rng(seed);
  for (std::size_t i = 0; i < wanted; ++i) {
    std::swap(all[i], all[i + static_cast<std::size_t>(rng.below(all.size() - i))]);
  }
  all.resize(wanted);
  std::sort(all.begin(), all.end());
  return all;
}

// What the answer is not told by its numbers.
void warn(Answer& answer, const ScaleRequest& request, const Context& context) {
  WarningList warnings;
  if (answer.is_estimated) {
    warnings.add("W_NOISE_TWICE", "every point",
                 "remark: the points count as free of noise and have the noise that was found: "
                 "dupin mls smooth first, or --noise");
  }
  const auto first_large = std::find_if(request.sizes.begin(), request.sizes.end(), [&](int size) {
    return size > answer.surface.graph.points.rows();
  });
  if (first_large != request.sizes.end()) {
    warnings.add("W_SIZE_DROPPED", fmt::format("size {}", *first_large),
                 "neighbourhoods of more points than there are were left out",
                 request.sizes.end() - first_large);
  }
  context.report(request.cloud, warnings);
  answer.surface.warnings.append(warnings);
}

void prepare(Answer& answer, const ScaleRequest& request, const Context& context) {
  const LoadedSurface& surface = answer.surface;
  const bool is_thesis = request.preset == "thesis";
  if (is_thesis && !(surface.unit > 1e-50 && surface.unit < 1e50)) {
    throw Error(Errc::numerical, "E_RANGE", "the preset thesis works in the unit of the input",
                {request.cloud, 0, -1}, "a unit in which the surface is about one across");
  }
  // The absolute epsilon of the thesis is in the unit of the input.
  answer.points = is_thesis ? surface.points : surface.graph.points;
  answer.unit = is_thesis ? 1.0 : surface.unit;
  answer.is_estimated = request.noise == "auto";
  if (answer.is_estimated) {
    NoiseLevelOptions level;
    level.seed = context.seed;
    answer.sigma =
        surface.unit *
        noise_level_of(answer.surface, level, context, context.run.stage(0.5, 0.6)).sigma;
    if (require_comparable_noise(answer.sigma / surface.unit) == 0.0) {
      throw AnalysisError("E_DEGENERATE", "no noise was found", "give it with --noise");
    }
  } else {
    answer.sigma = given_noise(request.noise);
  }
  PatchDrawOptions& draws = answer.options.draws;
  if (is_thesis) draws = thesis_patch_draws(1.0);
  if (require_comparable_noise(answer.sigma / surface.unit) == 0.0)
    throw InvalidArgument("noise is nothing beside the size of the surface");
  draws.sigma = answer.sigma / answer.unit;
  draws.realisations = request.realisations;
  if (!is_thesis || request.has_experiments) draws.experiments = request.experiments;
  draws.significance = request.significance;
  draws.seed = context.seed;
  answer.options.sizes = request.sizes;
  warn(answer, request, context);
}

void validate_sizes(Answer& answer, const ScaleRequest& request, const RunControl& run) {
  if (request.report.empty() || run.cancelled()) return;
  const std::int32_t vertex = answer.field.vertices.front();
  PatchDrawOptions draws = answer.options.draws;
  draws.experiments = std::max(draws.experiments, kReportExperiments);
  std::vector<int> sizes = request.sizes;
  if (sizes.empty()) {
    for (int k = 30; k <= 300; k += 10) sizes.push_back(k);
  }
  for (const int size : sizes) {
    if (size > answer.points.rows()) break;
    answer.validations.push_back(validate_patch_statistics(
        answer.points, vertex, answer.surface.graph.normals.row(vertex), size, draws, run));
  }
}

std::int32_t input_vertex(const Answer& answer, std::size_t i) {
  return answer.surface.input_vertex[static_cast<std::size_t>(answer.field.vertices[i])];
}

// Of a statistic that could be computed: nothing may be left to test, and a sample that the
// prediction excludes has an infinite one.
std::optional<double> tested(double statistic, Eigen::Index rank) {
  if (rank == 0) return std::nullopt;
  return std::min(statistic, 1e300);
}

nlohmann::ordered_json points_json(const Answer& answer) {
  nlohmann::ordered_json points = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < answer.field.scales.size(); ++i) {
    const LocalScale& scale = answer.field.scales[i];
    const ScaleTest& test = scale.test();
    points.push_back({{"vertex", input_vertex(answer, i)},
                      {"neighbors", test.neighbors},
                      {"radius", answer.unit * test.radius},
                      {"T_beta", number_or_null(tested(test.T_beta, test.rank_beta))},
                      {"T_kappa", number_or_null(tested(test.T_kappa, test.rank_kappa))},
                      {"passed", scale.passed()}});
  }
  return points;
}

constexpr const char* kFieldNames[] = {"neighbors", "radius", "T_beta", "T_kappa"};

// NAME and FILE of every --field, before any work.
std::vector<std::pair<std::string, std::string>> parsed_fields(const ScaleRequest& request) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const std::string& field : request.fields) {
    const std::size_t at = field.find('=');
    const std::string name = field.substr(0, at);
    const std::string file = at == std::string::npos ? "" : field.substr(at + 1);
    if (std::find(std::begin(kFieldNames), std::end(kFieldNames), name) == std::end(kFieldNames) ||
        !file.ends_with(".npy")) {
      throw InvalidArgument("--field is \"" + escaped(field, 60) + "\", expected NAME=FILE.npy",
                            "NAME is neighbors, radius, T_beta or T_kappa");
    }
    out.emplace_back(name, file);
  }
  return out;
}

// One value a vertex of the input: that of the nearest vertex that was tested. A size is -1, which
// none can be, where none passes, and everything is where the analysis has no vertex. T is that of
// the size that passed, else of the largest.
void write_fields(const Answer& answer,
                  const std::vector<std::pair<std::string, std::string>>& fields) {
  if (fields.empty()) return;
  const std::vector<std::size_t> nearest = nearest_sample(answer.points, answer.field.vertices);
  for (const auto& [name, file] : fields) {
    Eigen::VectorXd values(answer.points.rows());
    for (Eigen::Index v = 0; v < values.size(); ++v) {
      const LocalScale& scale = answer.field.scales[nearest[static_cast<std::size_t>(v)]];
      const ScaleTest& test = scale.test();
      double value = -1.0;
      if (name == "T_beta") value = tested(test.T_beta, test.rank_beta).value_or(-1.0);
      if (name == "T_kappa") value = tested(test.T_kappa, test.rank_kappa).value_or(-1.0);
      if (name == "neighbors" && scale.passed()) value = test.neighbors;
      if (name == "radius" && scale.passed()) value = answer.unit * test.radius;
      values[v] = value;
    }
    NpyArray array;
    array.shape = {answer.surface.input_points.rows()};
    array.values = answer.surface.to_input(values, -1.0);
    write_npy(file, array);
  }
}

// The values at the sampled vertices; elsewhere `sampled` is 0.
void write_scales(const Answer& answer, const std::string& path) {
  SurfaceOutput out;
  out.points = answer.surface.input_points;
  const Triangles& local = answer.surface.graph.triangles;
  out.triangles.resize(local.rows(), 3);
  for (Eigen::Index i = 0; i < local.size(); ++i) {
    out.triangles.data()[i] =
        answer.surface.input_vertex[static_cast<std::size_t>(local.data()[i])];
  }
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(out.points.rows(), 6);
  for (std::size_t i = 0; i < answer.field.scales.size(); ++i) {
    const LocalScale& scale = answer.field.scales[i];
    const ScaleTest& test = scale.test();
    values.row(input_vertex(answer, i)) << 1.0, scale.passed() ? 1.0 : 0.0, test.neighbors,
        answer.unit * test.radius, tested(test.T_beta, test.rank_beta).value_or(-1.0),
        tested(test.T_kappa, test.rank_kappa).value_or(-1.0);
  }
  const char* names[] = {"sampled", "passed", "neighbors", "radius", "T_beta", "T_kappa"};
  for (Eigen::Index c = 0; c < values.cols(); ++c) {
    out.properties.push_back({names[c], values.col(c), false});
  }
  write_surface(path, out, SurfaceFormat::ply_binary);
}

Plot validation_plot(const std::vector<PatchValidation>& validations) {
  Plot plot;
  plot.x_label = "neighbours";
  plot.y_label = "Kolmogorov's D";
  PlotSeries kappa;
  kappa.label = "K and H";
  PlotSeries beta;
  beta.label = "coefficients";
  PlotSeries one;
  one.label = "critical";
  one.is_dashed = true;
  PlotSeries two;
  two.label = "critical, two samples";
  two.is_dashed = true;
  for (const PatchValidation& v : validations) {
    const auto size = static_cast<double>(v.test.neighbors);
    for (PlotSeries* series : {&kappa, &beta, &one, &two}) series->x.push_back(size);
    kappa.y.push_back(v.ks_kappa);
    beta.y.push_back(v.ks_beta);
    one.y.push_back(v.ks_critical);
    two.y.push_back(v.ks_critical_two);
  }
  plot.series = {kappa, beta, one, two};
  return plot;
}

std::string short_number(double value) {
  return std::isfinite(value) ? fmt::format("{:.4g}", value) : "infinite";
}

void write_report(const Answer& answer, const ScaleRequest& request) {
  HtmlReport report(
      "Local scale by hypothesis tests",
      fmt::format("{}: noise {} ({}), {} draws an experiment, level {}.", request.cloud,
                  short_number(answer.sigma), answer.is_estimated ? "estimated" : "given",
                  request.realisations, request.significance));
  report.add_section(
      fmt::format("Validation at vertex {}", input_vertex(answer, 0)),
      "Noise is added to the neighbours and the patch fitted again. Where first-order error "
      "propagation holds, the test statistic T follows a chi-square distribution, and "
      "Kolmogorov's D stays below the critical value.");
  report.add_svg(format_svg(validation_plot(answer.validations)),
                 "Kolmogorov's D of the statistics over the neighbourhood size. The lower dashed "
                 "line is the critical value for one sample, the upper one that for two samples, "
                 "which the thesis uses.");
  std::vector<std::vector<std::string>> rows;
  for (const PatchValidation& v : answer.validations) {
    rows.push_back({std::to_string(v.test.neighbors), short_number(answer.unit * v.test.radius),
                    short_number(v.test.T_beta), short_number(v.dof_beta), short_number(v.ks_beta),
                    short_number(v.test.T_kappa), short_number(v.dof_kappa),
                    short_number(v.ks_kappa), v.test.passed ? "yes" : "no"});
  }
  report.add_table({"neighbours", "radius", "mean T(beta)", "degrees", "D", "mean T(kappa)",
                    "degrees", "D", "means pass"},
                   rows, "Every size at this vertex.");
  report.add_section("Scales",
                     "The first size whose mean statistics are not above the critical "
                     "values; radius in the unit of the input.");
  rows.clear();
  for (std::size_t i = 0; i < std::min(kListed, answer.field.scales.size()); ++i) {
    const LocalScale& scale = answer.field.scales[i];
    const ScaleTest& test = scale.test();
    rows.push_back({std::to_string(input_vertex(answer, i)),
                    scale.passed() ? std::to_string(test.neighbors) : "none passes",
                    short_number(answer.unit * test.radius), short_number(test.T_beta),
                    short_number(test.T_kappa)});
  }
  report.add_table({"vertex", "neighbours", "radius", "T(beta)", "T(kappa)"}, rows,
                   fmt::format("{} of {} points.", rows.size(), answer.field.scales.size()));
  write_file_atomically(request.report, report.page("Made by dupin mls scale."));
}

void run_scale(Context& context, const ScaleRequest& request) {
  const auto fields = parsed_fields(request);
  if (!request.output.empty()) output_format(context, request.output, "", {"ply"});
  if (!request.report.empty()) output_format(context, request.report, "", {"html", "htm"});
  Answer answer;
  with_progress(context, "scale", [&] {
    answer.surface = load_surface(request.cloud, context);
    prepare(answer, request, context);
    const Points& normals = answer.surface.graph.normals;
    answer.field = find_local_scales(
        answer.points, normals, chosen_vertices(answer.surface, request, context.seed),
        answer.options, context.run.stage(0.6, request.report.empty() ? 1.0 : 0.9));
    validate_sizes(answer, request, context.run.stage(0.9, 1.0));
  });
  if (!request.output.empty()) write_scales(answer, request.output);
  write_fields(answer, fields);
  if (!request.report.empty()) write_report(answer, request);
  const auto passed = std::count_if(answer.field.scales.begin(), answer.field.scales.end(),
                                    [](const LocalScale& scale) { return scale.passed(); });
  context.print_json({{"points", points_json(answer)},
                      {"sigma", answer.sigma},
                      {"sigma_is_estimated", answer.is_estimated},
                      {"passed", passed},
                      {"warnings", to_json(answer.surface.warnings)}});
  std::vector<int> sizes;
  for (const LocalScale& scale : answer.field.scales) {
    if (scale.passed()) sizes.push_back(scale.test().neighbors);
  }
  std::sort(sizes.begin(), sizes.end());
  context.say(fmt::format("{} of {} points have a scale for noise {:.6g}", passed,
                          answer.field.scales.size(), answer.sigma));
  if (!sizes.empty()) {
    context.say(fmt::format("neighbours: median {}, smallest {}, largest {}",
                            sizes[sizes.size() / 2], sizes.front(), sizes.back()));
  }
  for (const std::string& file : {request.output, request.report}) {
    if (!file.empty()) context.say(fmt::format("written: {}", file));
  }
  for (const auto& field : fields) context.say(fmt::format("written: {}", field.second));
}

}  // namespace

void add_mls_scale(CLI::App& verb, Context& context) {
  CLI::App* scale = verb.add_subcommand(
      "scale", "Smallest neighbourhood at which the error bars of a patch hold");
  scale->footer(
      "Example:\n  dupin mls scale smooth.ply --noise 0.002 --report scale.html\n\nThe points "
      "count as free of noise; it is added to them.");
  add_global_options(*scale, context);
  add_input_format(*scale, context);
  auto request = std::make_shared<ScaleRequest>();
  scale->add_option("CLOUD", request->cloud, "Points or surface; - reads standard input")
      ->required();
  scale->add_option("-o,--output", request->output, "PLY to write, with values at vertices");
  scale->add_option("--report", request->report, "Page with the validation at one vertex");
  scale->add_option(
      "--field", request->fields,
      "NAME=FILE.npy, to be drawn by dupin render --color: neighbors or radius, -1 where no size "
      "passes, T_beta or T_kappa; of the nearest tested vertex. May be repeated");
  scale
      ->add_option("--noise", request->noise,
                   "Standard deviation along the normal in the unit of the input, or auto")
      ->capture_default_str();
  scale->add_option("--samples", request->samples, "Vertices, chosen by --seed; 0: all")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1'000'000'000}))
      ->capture_default_str();
  scale->add_option("--vertex", request->vertex, "This vertex alone")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{2'000'000'000}));
  scale->add_option("--sizes", request->sizes, "Growing, as 30,60,90; without it 30 to 300 by 10")
      ->delimiter(',')
      ->check(CLI::Range(10, 100'000));
  scale->add_option("--realisations", request->realisations, "Draws of an experiment")
      ->check(CLI::Range(35, 100'000))
      ->capture_default_str();
  CLI::Option* experiments =
      scale
          ->add_option("--experiments", request->experiments,
                       "Experiments whose statistics are averaged; preset thesis: 100")
          ->check(CLI::Range(1, 100'000))
          ->capture_default_str();
  scale->add_option("--significance", request->significance, "Level of the tests")
      ->check(in_range(1e-6, 0.5))
      ->capture_default_str();
  scale->add_option("--preset", request->preset, "default, thesis")
      ->check(CLI::IsMember({"default", "thesis"}))
      ->capture_default_str();
  scale->callback([request, experiments, &context] {
    request->has_experiments = experiments->count() > 0;
    run_scale(context, *request);
  });
}

}  // namespace dupin::cli
