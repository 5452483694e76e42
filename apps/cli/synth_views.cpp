#include "synth_views.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
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

// Where a view goes: all that is random about it but its noise.
struct Plan {
  int position = 0;
  std::uint64_t seed = 0;  // of the noise
  Pose motion;             // of its points
};

// In the order of the files. Drawn before any view is taken, so that one is in memory at a time.
std::vector<Plan> plan_views(const ViewsRequest& request, std::uint64_t seed, double size) {
  Rng rng(seed);
  std::vector<Plan> plans(static_cast<std::size_t>(request.count));
  for (int i = 0; i < request.count; ++i) {
    plans[static_cast<std::size_t>(i)].position = i;
    plans[static_cast<std::size_t>(i)].seed = rng.next();
  }
  if (!request.is_shuffled) return plans;
  for (Plan& plan : plans) {
    plan.motion.rotation = random_rotation(rng);
    for (Eigen::Index k = 0; k < 3; ++k) plan.motion.translation[k] = rng.uniform(-size, size);
  }
  for (std::size_t i = plans.size(); i > 1; --i)
    std::swap(plans[i - 1], plans[static_cast<std::size_t>(rng.below(i))]);
  return plans;
}

[[noreturn]] void fail_directory(const std::string& directory) {
  throw IoError(Errc::cannot_write, "E_WRITE", "cannot make the directory", {directory});
}

// Folders of runs that were killed: ".unfinished-PID-ATTEMPT" of a process that is no more.
void remove_leftovers(const fs::path& target) {
  std::error_code error;
  std::vector<fs::path> leftovers;
  for (const auto& entry : fs::directory_iterator(target, error)) {
    const std::string name = entry.path().filename().string();
    int pid = 0;
    int attempt = 0;
    int used = 0;
    if (std::sscanf(name.c_str(), ".unfinished-%9d-%9d%n", &pid, &attempt, &used) != 2) continue;
    if (static_cast<std::size_t>(used) != name.size() || pid <= 0) continue;
    if (::kill(pid, 0) != 0 && errno == ESRCH) leftovers.push_back(entry.path());
  }
  for (const fs::path& folder : leftovers) fs::remove_all(folder, error);
}

// The files of a set until all of them are there: an interrupted run leaves none, and those of an
// older set as they were.
class Staging {
 public:
  Staging(const std::string& target, Context& context) : target_(target), context_(context) {
    std::error_code error;
    is_new_ = !fs::exists(target_, error);
    fs::create_directories(target_, error);
    if (!fs::is_directory(target_, error)) fail_directory(target);
    remove_leftovers(target_);
    const std::lock_guard<std::mutex> lock(context_.unfinished_mutex);
    for (int attempt = 0; attempt < 100; ++attempt) {
      folder_ = target_ / fmt::format(".unfinished-{}-{}", ::getpid(), attempt);
      if (!fs::create_directory(folder_, error)) continue;
      context_.unfinished = folder_.string();
      return;
    }
    fail_directory(target);
  }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;
  ~Staging() {
    const std::lock_guard<std::mutex> lock(context_.unfinished_mutex);
    context_.unfinished.clear();
    std::error_code error;
    fs::remove_all(folder_, error);
    if (is_new_) fs::remove(target_, error);  // only if it is empty
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void publish(const std::string& name) const {
    std::error_code error;
    fs::rename(folder_ / name, target_ / name, error);
    if (error) {
      throw IoError(Errc::cannot_write, "E_WRITE", error.message(), {(target_ / name).string()});
    }
  }

 private:
  fs::path target_;
  Context& context_;
  fs::path folder_;
  bool is_new_ = false;
};

nlohmann::ordered_json write_views(Context& context, const ViewsRequest& request,
                                   const Mesh& mesh) {
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  const std::vector<Plan> plans = plan_views(request, context.seed, size);
  const Staging staging(request.output, context);
  auto list = nlohmann::ordered_json::array();
  std::vector<std::string> names;
  for (std::size_t i = 0; i < plans.size(); ++i) {
    View view = scan(request, mesh, plans[i].position, plans[i].seed, context.run);
    context.run.throw_if_cancelled();
    if (request.is_shuffled) {
      view.mesh.points = transformed(view.mesh.points, plans[i].motion);
      view.world = compose(view.world, inverse(plans[i].motion));
    }
    names.push_back(fmt::format("view_{:03}.ply", i));
    SurfaceOutput output;
    output.points = std::move(view.mesh.points);
    output.triangles = std::move(view.mesh.triangles);
    write_surface(staging.path(names.back()), output, SurfaceFormat::ply_binary);
    list.push_back({{"file", names.back()},
                    {"position", view.position},
                    {"azimuth_deg", view.azimuth_deg},
                    {"points", output.points.rows()},
                    {"faces", output.triangles.rows()},
                    {"noise_sigma", view.noise_sigma},
                    {"T_input_view", matrix_of(view.world)}});
    context.run.report(0.1 + 0.9 * static_cast<double>(i + 1) / static_cast<double>(plans.size()));
  }
  nlohmann::ordered_json document{{"input", request.input}, {"views", std::move(list)}};
  names.emplace_back("views.json");
  write_file_atomically(staging.path(names.back()), to_text(document));
  context.run.throw_if_cancelled();
  for (const std::string& name : names) staging.publish(name);
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
    document = write_views(context, request, mesh);
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
