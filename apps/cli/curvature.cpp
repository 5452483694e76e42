#include "dupin/surface/curvature.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "context.h"
#include "curvature_verb.h"
#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mls/mls_surface.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

constexpr double kDegrees = 180.0 / M_PI;

// What both estimators give; the deviations only from patches.
struct Estimate {
  CurvatureField field;
  MlsCurvature patches;

  bool has_deviations() const { return patches.sigma.size() > 0; }
};

// Deviations in the unit of the input, -1 where they are not known: without degrees of freedom, and
// of a normal that may point anywhere.
struct Deviations {
  Eigen::VectorXd mean;
  Eigen::VectorXd gauss;
  Eigen::VectorXd normal_degrees;
  Eigen::VectorXd sigma;
};

Deviations deviations_of(const MlsCurvature& patches, double unit) {
  const auto known = [&](const Eigen::VectorXd& sd, double factor,
                         double most = std::numeric_limits<double>::infinity()) {
    return Eigen::VectorXd(
        (patches.dof.array() > 0.0 && sd.array() <= most).select(factor * sd, -1.0));
  };
  return {known(patches.mean_sd, 1.0 / unit), known(patches.gauss_sd, 1.0 / unit / unit),
          known(patches.normal_sd_rad, kDegrees, 0.5 * std::numbers::pi),
          known(patches.sigma, unit)};
}

Eigen::VectorXd known(const Eigen::VectorXd& values) {
  Eigen::VectorXd kept(values.size());
  Eigen::Index count = 0;
  for (const double value : values) {
    if (value >= 0.0) kept[count++] = value;
  }
  kept.conservativeResize(count);
  return kept;
}

nlohmann::ordered_json summary(const Eigen::VectorXd& values) {
  if (values.size() == 0) return {{"min", nullptr}, {"max", nullptr}, {"mean", nullptr}};
  return {{"min", values.minCoeff()}, {"max", values.maxCoeff()}, {"mean", values.mean()}};
}

// Vertices of the graph that stand for a vertex of the input with an estimate: where the surface
// was cut, one of its vertices is several of the graph.
std::vector<std::int32_t> estimated_vertices(const LoadedSurface& surface,
                                             const CurvatureField& field) {
  std::vector<std::int32_t> kept;
  for (const std::int32_t a : surface.analysis_vertex) {
    if (a >= 0 && field.is_estimated[static_cast<std::size_t>(a)] != 0) kept.push_back(a);
  }
  return kept;
}

Eigen::VectorXd estimated(const std::vector<std::int32_t>& vertices, const Eigen::VectorXd& values,
                          double factor) {
  Eigen::VectorXd kept(static_cast<Eigen::Index>(vertices.size()));
  for (Eigen::Index i = 0; i < kept.size(); ++i)
    kept[i] = factor * values[vertices[static_cast<std::size_t>(i)]];
  return kept;
}

void write_curvature(const LoadedSurface& surface, const Estimate& estimate, double h, double k,
                     const std::string& path) {
  const CurvatureField& field = estimate.field;
  SurfaceOutput out;
  out.points = surface.input_points;
  const Triangles& local = surface.graph.triangles;
  out.triangles.resize(local.rows(), 3);
  for (Eigen::Index i = 0; i < local.size(); ++i) {
    out.triangles.data()[i] = surface.input_vertex[static_cast<std::size_t>(local.data()[i])];
  }
  const auto add = [&](const char* name, const Eigen::VectorXd& values, double factor) {
    out.properties.push_back({name, surface.to_input(factor * values), false});
  };
  add("k1", field.k1, h);
  add("k2", field.k2, h);
  add("H", field.mean(), h);
  add("K", field.gauss(), k);
  const char* names[2][3] = {{"d1x", "d1y", "d1z"}, {"d2x", "d2y", "d2z"}};
  for (Eigen::Index c = 0; c < 3; ++c) add(names[0][c], field.d1.col(c), 1.0);
  for (Eigen::Index c = 0; c < 3; ++c) add(names[1][c], field.d2.col(c), 1.0);
  Eigen::VectorXd flag(field.k1.size());
  for (Eigen::Index v = 0; v < flag.size(); ++v)
    flag[v] = field.is_estimated[static_cast<std::size_t>(v)];
  out.properties.push_back({"estimated", surface.to_input(flag), true});
  if (estimate.has_deviations()) {
    const Deviations sd = deviations_of(estimate.patches, surface.unit);
    add("H_sd", sd.mean, 1.0);
    add("K_sd", sd.gauss, 1.0);
    add("normal_sd_degrees", sd.normal_degrees, 1.0);
    add("sigma", sd.sigma, 1.0);
    out.properties.push_back(
        {"order", surface.to_input(estimate.patches.order.cast<double>()), true});
  }
  write_surface(path, out, SurfaceFormat::ply_binary);
}

Estimate estimate_curvature(const LoadedSurface& surface, const CurvatureRequest& request,
                            const RunControl& run) {
  Estimate estimate;
  if (request.method == "taubin") {
    if (!surface.graph.is_mesh()) {
      throw Error(Errc::impossible, "E_NO_FACES",
                  "Taubin's curvature needs faces, this is a point cloud", {request.mesh, 0, -1},
                  "--method mls works on points");
    }
    estimate.field = estimate_curvature_taubin({surface.graph.points, surface.graph.triangles},
                                               surface.graph.topology, run);
    return estimate;
  }
  MlsCurvatureOptions options;
  options.patch = request.patch;
  options.patch.radius /= surface.unit;
  if (request.method == "jet") options.patch.weight = MlsWeight::uniform;
  estimate.patches =
      estimate_curvature_mls(surface.graph.points, surface.graph.normals, options, run);
  estimate.field = estimate.patches.field;
  return estimate;
}

}  // namespace

nlohmann::ordered_json count_orders(const Eigen::VectorXi& order) {
  nlohmann::ordered_json counts;
  for (const int coefficients : {10, 6, 3, 0}) {
    counts[std::to_string(coefficients)] = (order.array() == coefficients).count();
  }
  return counts;
}

void run_curvature(Context& context, const CurvatureRequest& request) {
  if (!request.output.empty()) output_format(context, request.output, "", {"ply"});
  LoadedSurface surface;
  Estimate estimate;
  with_progress(context, "curvature", [&] {
    surface = load_surface(request.mesh, context);
    estimate = estimate_curvature(surface, request, context.run.stage(0.5, 1.0));
  });
  const CurvatureField& field = estimate.field;
  const double h = 1.0 / surface.unit;
  const double k = h * h;
  const std::vector<std::int32_t> vertices = estimated_vertices(surface, field);
  const Eigen::VectorXd H = estimated(vertices, field.mean(), h);
  const Eigen::VectorXd K = estimated(vertices, field.gauss(), k);
  if (H.size() == 0) {
    throw AnalysisError("E_ALL_DEGENERATE", request.method == "taubin"
                                                ? "no vertex has a face of positive area"
                                                : "no neighbourhood determines a second degree");
  }
  require_range(std::isfinite(K.sum()) && std::isfinite(H.sum()), "the curvature", request.mesh);
  if (!request.output.empty()) write_curvature(surface, estimate, h, k, request.output);
  nlohmann::ordered_json document = {{"mean", {{"H", summary(H)}, {"K", summary(K)}}},
                                     {"skipped_vertices", surface.num_input_vertices - H.size()},
                                     {"method", request.method}};
  if (estimate.has_deviations()) {
    const MlsCurvature& patches = estimate.patches;
    const Deviations sd = deviations_of(patches, surface.unit);
    const Eigen::VectorXd of_mean = known(estimated(vertices, sd.mean, 1.0));
    document["mean"]["H_sd"] = summary(of_mean);
    document["mean"]["K_sd"] = summary(known(estimated(vertices, sd.gauss, 1.0)));
    document["mean"]["normal_sd_degrees"] =
        summary(known(estimated(vertices, sd.normal_degrees, 1.0)));
    document["unknown_deviations"] = H.size() - of_mean.size();
    document["orders"] = count_orders(patches.order);
  }
  document["warnings"] = to_json(surface.warnings);
  context.print_json(document);
  context.say(
      fmt::format("H  min {:.6g}  mean {:.6g}  max {:.6g}", H.minCoeff(), H.mean(), H.maxCoeff()));
  context.say(
      fmt::format("K  min {:.6g}  mean {:.6g}  max {:.6g}", K.minCoeff(), K.mean(), K.maxCoeff()));
  if (estimate.has_deviations()) {
    const Eigen::VectorXd sd =
        known(estimated(vertices, deviations_of(estimate.patches, surface.unit).mean, 1.0));
    context.say(sd.size() == 0
                    ? "standard deviation of H  not known: as many coefficients as points"
                    : fmt::format("standard deviation of H  min {:.3g}  mean {:.3g}  max {:.3g}",
                                  sd.minCoeff(), sd.mean(), sd.maxCoeff()));
  }
  if (!request.output.empty()) context.say(fmt::format("written: {}", request.output));
}

void add_patch_options(CLI::App& verb, MlsOptions& options) {
  verb.add_option("--neighbors", options.neighbors, "Nearest points of a patch")
      ->check(CLI::Range(3, 100'000))
      ->capture_default_str();
  verb.add_option("--radius", options.radius,
                  "Radius of a patch in the unit of the input, instead of --neighbors")
      ->check(in_range(1e-300, 1e300))
      ->excludes("--neighbors");
  verb.add_option_function<std::string>(
          "--patch-weights",
          [&options](const std::string& name) {
            options.weight = name == "uniform" ? MlsWeight::uniform : MlsWeight::gaussian;
          },
          "Weights of the neighbours")
      ->check(CLI::IsMember({"gaussian", "uniform"}))
      ->default_str("gaussian");
  verb.add_option("--weight-width", options.weight_width,
                  "Width of the Gaussian weights, in radii of the patch")
      ->check(in_range(0.01, 1000.0))
      ->capture_default_str();
}

namespace {

void refuse_ignored_options(const CLI::App& verb, const CurvatureRequest& request) {
  if (request.method == "mls") return;
  for (const char* option : {"--neighbors", "--radius", "--patch-weights", "--weight-width"}) {
    const bool is_of_jet = request.method == "jet" && option[2] != 'p' && option[2] != 'w';
    if (is_of_jet || verb.count(option) == 0) continue;
    throw InvalidArgument(fmt::format("{} means nothing to --method {}", option, request.method),
                          "--method mls");
  }
}

}  // namespace

void add_curvature(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("curvature", "Principal curvatures and directions at every vertex");
  verb->footer(
      "Example:\n  dupin curvature bunny.off -o curvature.ply\n  dupin curvature cloud.xyz "
      "--method "
      "mls\n\nThe PLY carries k1 >= k2, H = (k1 + k2) / 2 > 0 on a sphere, K = k1 k2 and the "
      "directions d1, d2; with mls and jet also the standard deviations H_sd, K_sd.");
  add_global_options(*verb, context);
  add_input_format(*verb, context);
  auto request = std::make_shared<CurvatureRequest>();
  verb->add_option("MESH", request->mesh, "Surface; - reads standard input")->required();
  verb->add_option("-o,--output", request->output, "PLY to write");
  verb->add_option("--method", request->method, "Estimator")
      ->check(CLI::IsMember({"taubin", "mls", "jet"}))
      ->capture_default_str();
  add_patch_options(*verb, request->patch);
  verb->callback([request, verb, &context] {
    refuse_ignored_options(*verb, *request);
    run_curvature(context, *request);
  });
}

}  // namespace dupin::cli
