#include "synth_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "dupin/render/range_view.h"
#include "registered_scan.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

struct ViewsRequest {
  std::string input;
  std::string output;
  int count = 12;
  double step_deg = 30.0;
  double elevation_deg = 0.0;
  double perspective = 0.2;
  int rows = 240;
  int cols = 320;
  double noise = 0.0;
  double max_incidence_deg = 80.0;
  bool is_shuffled = false;
};

struct View {
  int position = 0;  // on the circle, from 0
  double azimuth_deg = 0.0;
  Mesh mesh;
  double noise_sigma = 0.0;
  Pose world;  // from the points of the file to the input
};

View scan(const ViewsRequest& request, const Mesh& mesh, int position, std::uint64_t seed,
          const RunControl& run) {
  View view;
  view.position = position;
  view.azimuth_deg = position * request.step_deg;
  Camera direction;
  direction.azimuth_deg = view.azimuth_deg;
  direction.elevation_deg = request.elevation_deg;
  direction.perspective = request.perspective;
  const RangeCamera camera = fit_range_camera(mesh.points, direction, request.rows, request.cols);
  const Eigen::Vector3d middle =
      0.5 * (mesh.points.colwise().minCoeff() + mesh.points.colwise().maxCoeff()).transpose();
  const double distance = camera.is_orthographic ? 1.0 : (camera.position - middle).norm();
  view.noise_sigma = request.noise / 100.0 * camera.pixel * distance;
  RangeViewOptions options;
  options.noise_sigma = view.noise_sigma;
  options.seed = seed;
  options.max_incidence_deg = request.max_incidence_deg;
  // Only the mesh: a picture of every view would fill the memory.
  view.mesh = scan_range_view(mesh, camera, options, run).mesh;
  view.world = {1.0, camera.rotation.transpose(), camera.position};
  return view;
}

// Moves the points of a view by a random motion, and keeps the way back.
void scramble(View& view, double size, Rng& rng) {
  Pose motion;
  motion.rotation = random_rotation(rng);
  for (Eigen::Index k = 0; k < 3; ++k) motion.translation[k] = rng.uniform(-size, size);
  view.mesh.points = transformed(view.mesh.points, motion);
  view.world = compose(view.world, inverse(motion));
}

std::vector<View> scan_all(const Context& context, const ViewsRequest& request, const Mesh& mesh) {
  Rng rng(context.seed);
  std::vector<View> views;
  for (int i = 0; i < request.count; ++i) {
    views.push_back(scan(request, mesh, i, rng.next(), context.run));
    context.run.throw_if_cancelled();
    context.run.report(0.1 + 0.7 * (i + 1) / request.count);
  }
  if (request.is_shuffled) {
    const double size =
        (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
    for (View& view : views) scramble(view, size, rng);
    for (std::size_t i = views.size(); i > 1; --i) {
      std::swap(views[i - 1], views[static_cast<std::size_t>(rng.below(i))]);
    }
  }
  return views;
}

void make_directory(const std::string& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (!fs::is_directory(directory, error)) {
    throw IoError(Errc::cannot_write, "E_WRITE", "cannot make the directory", {directory});
  }
}

nlohmann::ordered_json write_views(const ViewsRequest& request, const std::vector<View>& views) {
  make_directory(request.output);
  auto list = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    const std::string name = fmt::format("view_{:03}.ply", i);
    SurfaceOutput output;
    output.points = view.mesh.points;
    output.triangles = view.mesh.triangles;
    write_surface((fs::path(request.output) / name).string(), output, SurfaceFormat::ply_binary);
    list.push_back({{"file", name},
                    {"position", view.position},
                    {"azimuth_deg", view.azimuth_deg},
                    {"points", output.points.rows()},
                    {"faces", output.triangles.rows()},
                    {"noise_sigma", view.noise_sigma},
                    {"T_input_view", matrix_of(view.world)}});
  }
  nlohmann::ordered_json document{{"input", request.input}, {"views", std::move(list)}};
  write_file_atomically((fs::path(request.output) / "views.json").string(), to_text(document));
  return document;
}

void synth_views(Context& context, const ViewsRequest& request) {
  nlohmann::ordered_json document;
  with_progress(context, "synth", [&] {
    const LoadedSurface surface = load_surface(request.input, context);
    if (!surface.graph.is_mesh()) {
      throw in_file(AnalysisError("E_NO_FACES", "a range camera needs a surface with faces"),
                    request.input);
    }
    context.run.throw_if_cancelled();
    context.run.report(0.1);
    const Mesh mesh{surface.points, surface.graph.triangles};
    document = write_views(request, scan_all(context, request, mesh));
  });
  context.print_json(document);
  context.say(fmt::format("{}: {} views of {} x {} pixels, poses in views.json", request.output,
                          request.count, request.cols, request.rows));
}

}  // namespace

void add_synth_views(CLI::App& synth, Context& context) {
  CLI::App* views = synth.add_subcommand("views", "Partial scans of a surface by a range camera");
  views->footer(
      "Example:\n  dupin synth views bunny.ply -o scans --noise 20 --shuffle --seed 1\n\n"
      "views.json has the matrix that takes each file back to the surface.");
  add_global_options(*views, context);
  add_input_format(*views, context);
  auto request = std::make_shared<ViewsRequest>();
  views->add_option("SURFACE", request->input, "Surface to scan, with faces")->required();
  views->add_option("-o,--output", request->output, "Directory to write to")->required();
  views->add_option("--count", request->count, "Views on a circle about +y")
      ->check(CLI::Range(1, 999))
      ->capture_default_str();
  views->add_option("--step", request->step_deg, "Degrees from one view to the next")
      ->check(in_range(-360.0, 360.0))
      ->capture_default_str();
  views->add_option("--elevation", request->elevation_deg, "Of the camera above the circle [deg]")
      ->check(in_range(-90.0, 90.0))
      ->capture_default_str();
  views
      ->add_option("--perspective", request->perspective,
                   "Radius of the surface over the distance of the camera; 0: orthographic")
      ->check(in_range(0.0, 0.8))
      ->capture_default_str();
  views->add_option("--rows", request->rows, "Pixels from top to bottom")
      ->check(CLI::Range(4, 8192))
      ->capture_default_str();
  views->add_option("--cols", request->cols, "Pixels from left to right")
      ->check(CLI::Range(4, 8192))
      ->capture_default_str();
  views->add_option("--noise", request->noise, "Noise along the rays in percent of a pixel")
      ->check(in_range(0.0, 1e6))
      ->capture_default_str();
  views
      ->add_option("--max-incidence", request->max_incidence_deg,
                   "Largest angle between ray and normal [deg]")
      ->check(in_range(1e-6, 90.0))
      ->capture_default_str();
  views->add_flag("--shuffle", request->is_shuffled,
                  "Files in random order, each in a random pose of its own");
  views->callback([request, &context] { synth_views(context, *request); });
}

}  // namespace dupin::cli
