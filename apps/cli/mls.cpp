#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "context.h"
#include "curvature_verb.h"
#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mls/mls_surface.h"
#include "dupin/mls/noise_level.h"
#include "mls_verbs.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

struct SmoothRequest {
  std::string cloud;
  std::string output;
  MlsProjectionOptions projection;
};

struct NoiseRequest {
  std::string cloud;
  NoiseLevelOptions level;
};

// The input with its points moved; faces as analysed, in the numbering of the input.
SurfaceOutput moved_surface(const LoadedSurface& surface, const MlsProjection& projection) {
  SurfaceOutput out;
  out.points = surface.input_points;
  for (Eigen::Index a = 0; a < projection.points.rows(); ++a) {
    const std::int32_t v = surface.input_vertex[static_cast<std::size_t>(a)];
    out.points.row(v) = surface.input_points.row(v) +
                        surface.unit * (projection.points.row(a) - surface.graph.points.row(a));
  }
  const Triangles& local = surface.graph.triangles;
  out.triangles.resize(local.rows(), 3);
  for (Eigen::Index i = 0; i < local.size(); ++i) {
    out.triangles.data()[i] = surface.input_vertex[static_cast<std::size_t>(local.data()[i])];
  }
  return out;
}

void run_smooth(Context& context, const SmoothRequest& request) {
  const bool to_stdout = request.output == "-";
  output_format(context, request.output, "",
                to_stdout ? std::vector<std::string>{"ply"} : surface_extensions());
  const SurfaceFormat format =
      to_stdout ? SurfaceFormat::ply_binary : surface_format_of(request.output);
  LoadedSurface surface;
  MlsProjection projection;
  with_progress(context, "smooth", [&] {
    surface = load_surface(request.cloud, context);
    MlsProjectionOptions options = request.projection;
    options.patch.radius /= surface.unit;
    projection = project_mls(surface.graph.points, surface.graph.points, surface.graph.normals,
                             options, context.run.stage(0.5, 1.0));
  });
  SurfaceOutput out = moved_surface(surface, projection);
  if (format == SurfaceFormat::ply_binary || format == SurfaceFormat::ply_ascii) {
    const char* names[] = {"nx", "ny", "nz"};
    for (Eigen::Index c = 0; c < 3; ++c) {
      out.properties.push_back({names[c], surface.to_input(projection.normals.col(c)), false});
    }
  }
  // Squares in local units: those of very large or small ones leave the range of a double.
  const Eigen::VectorXd moved = (projection.points - surface.graph.points).rowwise().norm();
  const double rms =
      surface.unit * std::sqrt(moved.squaredNorm() / static_cast<double>(moved.size()));
  const double most = surface.unit * moved.maxCoeff();
  const Eigen::Index left = (projection.order.array() == 0).count();
  if (left == moved.size()) {
    throw AnalysisError("E_ALL_DEGENERATE", "no neighbourhood determines a plane",
                        "more points in a patch: --neighbors or --radius");
  }
  write_surface(request.output, out, format);
  context.print_json({{"vertices", surface.num_input_vertices},
                      {"moved", {{"rms", rms}, {"max", most}}},
                      {"orders", count_orders(projection.order)},
                      {"left_alone", left},
                      {"converged", projection.status == Status::ok},
                      {"warnings", to_json(surface.warnings)}});
  context.say(fmt::format(
      "moved by {:.6g} (root mean square), at most {:.6g}; {} points left alone", rms, most, left));
  context.say(fmt::format("written: {}", request.output));
}

void run_noise(Context& context, const NoiseRequest& request) {
  LoadedSurface surface;
  NoiseLevel level;
  with_progress(context, "noise", [&] {
    surface = load_surface(request.cloud, context);
    NoiseLevelOptions options = request.level;
    options.seed = context.seed;
    level = noise_level_of(surface, options, context, context.run.stage(0.5, 1.0));
  });
  const double sigma = surface.unit * level.sigma;
  const double error = surface.unit * level.sigma_standard_error;
  const double mean_edge = surface.unit * surface.graph.mean_edge;
  const double percent = 100.0 * sigma / mean_edge;
  context.print_json({{"sigma", sigma},
                      {"sigma_standard_error", error},
                      {"mean_edge_length", mean_edge},
                      {"percent_of_mean_edge", percent},
                      {"samples", level.num_samples},
                      {"warnings", to_json(surface.warnings)}});
  context.say(fmt::format("noise {:.6g} +- {:.2g}, {:.3g} % of the mean edge length {:.6g}", sigma,
                          error, percent, mean_edge));
}

}  // namespace

void add_mls(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("mls", "Smooth, measure and judge points by patches");
  verb->require_subcommand(1);

  CLI::App* smooth = verb->add_subcommand("smooth", "Project points onto their own MLS surface");
  smooth->footer(
      "Example:\n  dupin mls smooth scan.ply -o smooth.ply --neighbors 60\n\n"
      "Faces are kept and not used. A PLY carries the normals nx, ny, nz.");
  add_global_options(*smooth, context);
  add_input_format(*smooth, context);
  auto smoothing = std::make_shared<SmoothRequest>();
  smooth->add_option("CLOUD", smoothing->cloud, "Points or surface; - reads standard input")
      ->required();
  smooth->add_option("-o,--output", smoothing->output, "Surface to write")->required();
  add_patch_options(*smooth, smoothing->projection.patch);
  smooth
      ->add_option("--iterations", smoothing->projection.max_iterations,
                   "Projections of a point at most")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  smooth
      ->add_option("--tolerance", smoothing->projection.tolerance,
                   "Step at which a point has arrived, in radii of its patch")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  smooth->callback([smoothing, &context] { run_smooth(context, *smoothing); });

  CLI::App* noise = verb->add_subcommand("noise", "Standard deviation of the noise of a surface");
  noise->footer(
      "Example:\n  dupin mls noise scan.ply\n\nIt is that along the normal; a surface "
      "coarser than its own shape counts as noisy.");
  add_global_options(*noise, context);
  add_input_format(*noise, context);
  auto measuring = std::make_shared<NoiseRequest>();
  noise->add_option("CLOUD", measuring->cloud, "Points or surface; - reads standard input")
      ->required();
  noise->add_option("--neighbors", measuring->level.neighbors, "Points of a patch")
      ->check(CLI::Range(11, 10'000))
      ->capture_default_str();
  noise
      ->add_option("--samples", measuring->level.num_samples,
                   "Points at which a patch is fitted; 0: all")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1'000'000'000}))
      ->capture_default_str();
  noise->callback([measuring, &context] { run_noise(context, *measuring); });

  CLI::App* curvature =
      verb->add_subcommand("curvature", "Curvature of points, with standard deviations");
  curvature->footer(
      "Example:\n  dupin mls curvature cloud.xyz -o curvature.ply\n\nThe same as dupin "
      "curvature --method mls.");
  add_global_options(*curvature, context);
  add_input_format(*curvature, context);
  auto request = std::make_shared<CurvatureRequest>();
  request->method = "mls";
  curvature->add_option("CLOUD", request->mesh, "Points or surface; - reads standard input")
      ->required();
  curvature->add_option("-o,--output", request->output, "PLY to write");
  add_patch_options(*curvature, request->patch);
  curvature->callback([request, &context] { run_curvature(context, *request); });

  add_mls_scale(*verb, context);
}

}  // namespace dupin::cli
