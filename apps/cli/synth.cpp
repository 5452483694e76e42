#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mesh/topology.h"
#include "surface_input.h"
#include "synth_views.h"

namespace dupin::cli {
namespace {

struct SurfaceRequest {
  std::string shape = "sphere";
  std::int64_t vertices = 10'000;
  double noise = 0.0;
  std::string noise_model = "normal";
  double jitter = 0.0;
  std::string output;
  std::string format;
};

using Maker = AnalyticSurface (*)(const SurfaceRequest&, std::uint64_t seed);

PlaneOptions plane_of(const SurfaceRequest& request, std::uint64_t seed) {
  PlaneOptions options;
  options.num_vertices = request.vertices;
  options.jitter = request.jitter;
  options.seed = seed;
  return options;
}

// Every shape in about its natural size: one unit of radius or half width.
const std::map<std::string, Maker>& makers() {
  using Request = SurfaceRequest;
  static const std::map<std::string, Maker> table{
      {"sphere", [](const Request& r, std::uint64_t) { return make_sphere(1.0, r.vertices); }},
      {"ellipsoid",
       [](const Request& r, std::uint64_t) { return make_ellipsoid(1.0, 0.8, 0.6, r.vertices); }},
      {"torus", [](const Request& r, std::uint64_t) { return make_torus(1.0, 0.4, r.vertices); }},
      {"cylinder",
       [](const Request& r, std::uint64_t) { return make_cylinder(1.0, 2.0, r.vertices); }},
      {"plane", [](const Request& r, std::uint64_t s) { return make_plane(plane_of(r, s)); }},
      {"saddle",
       [](const Request& r, std::uint64_t s) { return make_saddle(0.5, plane_of(r, s)); }},
      {"monkey-saddle",
       [](const Request& r, std::uint64_t s) { return make_monkey_saddle(0.5, plane_of(r, s)); }},
      {"paraboloid",
       [](const Request& r, std::uint64_t s) { return make_paraboloid(1.0, plane_of(r, s)); }},
      {"bump", [](const Request& r,
                  std::uint64_t s) { return make_gaussian_bump(0.3, 0.25, plane_of(r, s)); }},
      {"disk", [](const Request& r,
                  std::uint64_t s) { return make_raised_disk(0.5, 0.1, 0.2, plane_of(r, s)); }},
      {"bumpy-sphere",
       [](const Request& r, std::uint64_t s) {
         BumpOptions bumps;
         bumps.seed = s;
         return make_bumpy_sphere(1.0, r.vertices, bumps).surface;
       }},
  };
  return table;
}

std::vector<std::string> shape_names() {
  std::vector<std::string> names;
  for (const auto& [name, maker] : makers()) names.push_back(name);
  return names;
}

NoiseModel noise_model(const std::string& name) {
  if (name == "isotropic") return NoiseModel::isotropic;
  return name == "directional" ? NoiseModel::directional : NoiseModel::along_normal;
}

void synth_surface(Context& context, const SurfaceRequest& request) {
  const SurfaceFormat format = surface_format_of(
      "x." + output_format(context, request.output, request.format, surface_extensions()));
  SurfaceOutput output;
  double sigma = 0.0;
  double mean_edge = 0.0;
  with_progress(context, "synth", [&] {
    AnalyticSurface surface = makers().at(request.shape)(request, context.seed);
    context.run.throw_if_cancelled();
    context.run.report(0.4);
    NoiseOptions noise;
    noise.percent = request.noise;
    noise.model = noise_model(request.noise_model);
    noise.seed = context.seed;
    NoisyMesh noisy = add_noise(surface.mesh, noise);
    context.run.throw_if_cancelled();
    context.run.report(0.6);
    const MeshTopology topology =
        compute_topology(surface.mesh.triangles, surface.mesh.points.rows());
    mean_edge = mean_edge_length(surface.mesh.points, topology.ring);
    context.run.throw_if_cancelled();
    context.run.report(0.8);
    sigma = noisy.sigma;
    output.points = std::move(noisy.mesh.points);
    output.triangles = std::move(noisy.mesh.triangles);
    if (format == SurfaceFormat::ply_binary || format == SurfaceFormat::ply_ascii) {
      output.properties = {
          {"k1", surface.k1}, {"k2", surface.k2}, {"H", surface.mean}, {"K", surface.gauss}};
    }
    write_surface(request.output, output, format);
  });
  context.print_json({{"shape", request.shape},
                      {"vertices", output.points.rows()},
                      {"faces", output.triangles.rows()},
                      {"mean_edge_length", mean_edge},
                      {"noise_sigma", sigma}});
  context.say(fmt::format("{}: {} vertices, {} faces, mean edge {:.6g}, noise sigma {:.6g}",
                          request.shape, output.points.rows(), output.triangles.rows(), mean_edge,
                          sigma));
}

}  // namespace

void add_synth(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("synth", "Make test data with known truth");
  verb->require_subcommand(1);
  CLI::App* surface = verb->add_subcommand("surface", "A surface whose curvature is known");
  surface->footer(
      "Example:\n  dupin synth surface --shape torus --vertices 20000 --noise 20 -o torus.ply\n\n"
      "A PLY carries the curvature before noise as k1, k2, H, K (H > 0 on a sphere).\n--noise is "
      "the standard deviation in percent of the mean edge length.");
  add_global_options(*surface, context);
  auto request = std::make_shared<SurfaceRequest>();
  surface->add_option("--shape", request->shape, "Shape")
      ->check(CLI::IsMember(shape_names()))
      ->capture_default_str();
  surface->add_option("--vertices", request->vertices, "About so many vertices")
      ->check(CLI::Range(std::int64_t{12}, std::int64_t{20'000'000}))
      ->capture_default_str();
  surface->add_option("--noise", request->noise, "Noise in percent of the mean edge length")
      ->check(in_range(0.0, 1e6))
      ->capture_default_str();
  surface->add_option("--noise-model", request->noise_model, "Direction of the noise")
      ->check(CLI::IsMember({"normal", "isotropic", "directional"}))
      ->capture_default_str();
  surface->add_option("--jitter", request->jitter, "Irregularity of plane samplings, in spacings")
      ->check(in_range(0.0, 0.4))
      ->capture_default_str();
  surface->add_option("-o,--output", request->output, "Surface to write")->required();
  surface->add_option("--format", request->format, "Format of standard output, for -o -")
      ->check(CLI::IsMember(surface_extensions()));
  surface->callback([request, &context] { synth_surface(context, *request); });
  add_synth_views(*verb, context);
}

}  // namespace dupin::cli
