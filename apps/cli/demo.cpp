#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/version.h"
#include "dupin/features/keypoints.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/render/renderer.h"
#include "dupin/render/ticks.h"
#include "dupin/scalespace/scale_space.h"
#include "html_report.h"
#include "surface_picture.h"
#include "svg_plot.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 1000;
constexpr int kHeight = 800;
constexpr Eigen::Index kDrawn = 40;  // keypoints in a picture
constexpr std::size_t kCurves = 5;   // keypoints in a plot
constexpr std::size_t kListed = 15;  // keypoints in a table

struct Settings {
  std::string directory = "dupin-demo";
  std::string surfaces;
};

/// A surface of the demo: from a file, or made here and written beside the page.
struct Subject {
  std::string name;  ///< of its files
  std::string title;
  std::string note;
  std::string view = "iso";
  std::string file;  ///< as the command lines name it
  PolygonMesh mesh;
};

struct Timing {
  std::string name;
  Eigen::Index vertices = 0;
  Eigen::Index faces = 0;
  double signal = 0.0;
  double stack = 0.0;
  double keypoints = 0.0;
  double pictures = 0.0;
  WarningList warnings;
};

/// What the chain computed of one subject, in the unit of the input.
struct Analysis {
  LoadedSurface surface;
  Eigen::VectorXd signal;
  LevelSchedule schedule;
  Eigen::VectorXd tau;
  LevelMatrix loc;
  double mean_edge = 0.0;
  std::vector<Keypoint> keypoints;
};

class Watch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> seconds = now - last_;
    last_ = now;
    return seconds.count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

struct FileSubject {
  const char* name;
  const char* title;
  const char* note;
  const char* view;
};

constexpr FileSubject kFiles[] = {
    {"armadillo", "Armadillo", "From the Stanford 3D Scanning Repository, as it comes with CGAL.",
     "210,12"},
    {"bunny", "Bunny", "From the Stanford 3D Scanning Repository.", "0,10"},
    {"bunny00", "Bunny", "From the Stanford 3D Scanning Repository, as it comes with CGAL.",
     "0,10"},
    {"elephant", "Elephant", "From CGAL's example data: uneven triangles.", "35,15"},
    {"mannequin-devil", "Mannequin", "A model of CGAL with two sharp horns.", "iso"},
};

std::vector<Subject> file_subjects(const std::string& directory, Context& context) {
  std::vector<Subject> out;
  for (const FileSubject& known : kFiles) {
    const fs::path path = fs::path(directory) / (std::string(known.name) + ".off");
    std::error_code error;
    if (!fs::exists(path, error)) continue;
    SurfaceFile file = read_surface(path.string(), context.read, context.run);
    context.report(path.string(), file.warnings);
    out.push_back(
        {known.name, known.title, known.note, known.view, path.string(), std::move(file.mesh)});
  }
  return out;
}

std::vector<Subject> built_in_subjects(const fs::path& directory) {
  std::vector<Subject> out;
  BumpOptions bumps;
  bumps.height = 0.08;
  bumps.width = 0.16;
  out.push_back({"bumpy-sphere", "Bumpy sphere",
                 "Made here: twelve equal Gaussian bumps on a sphere, so the truth is known.",
                 "iso", "bumpy-sphere.ply",
                 to_polygon_mesh(make_bumpy_sphere(1.0, 20'000, bumps).surface.mesh)});
  out.push_back({"torus", "Torus",
                 "Made here, and hard on purpose: a torus is the same all around, so no place on "
                 "it deserves to be a keypoint.",
                 "20,50", "torus.ply", to_polygon_mesh(make_torus(1.0, 0.4, 20'000).mesh)});
  for (Subject& subject : out) {
    SurfaceOutput output;
    output.points = subject.mesh.points;
    output.triangles = Eigen::Map<const Triangles>(subject.mesh.face_index.data(),
                                                   subject.mesh.face_index.size() / 3, 3);
    subject.file = (directory / subject.file).string();
    write_surface(subject.file, output, SurfaceFormat::ply_binary);
  }
  return out;
}

Analysis analyse(const Subject& subject, Timing& timing, Context& context) {
  Analysis out;
  out.surface = to_loaded_surface(subject.mesh, subject.name, context);
  const SurfaceGraph& graph = out.surface.graph;
  out.mean_edge = graph.mean_edge * out.surface.unit;
  timing.name = subject.title;
  timing.warnings = out.surface.warnings;
  timing.vertices = graph.points.rows();
  timing.faces = graph.triangles.rows();
  Watch watch;
  const Eigen::VectorXd local = compute_signal(graph, Signal::height, 6, context.run);
  context.run.throw_if_cancelled();
  timing.signal = watch.lap();
  ScaleSpaceOptions options;
  options.want_levels = false;
  const DiffusionOperator op = umbrella_operator(graph.topology.ring, &graph.topology);
  const ScaleSpace stack = compute_scale_space(op, local, options, context.run);
  context.run.throw_if_cancelled();
  timing.stack = watch.lap();
  const double signal_scale = local.size() > 0 ? local.cwiseAbs().maxCoeff() : 0.0;
  KeypointSet found =
      find_keypoints(graph, stack.loc, options.schedule, signal_scale, {}, context.run);
  timing.keypoints = watch.lap();
  context.run.throw_if_cancelled();
  out.schedule = options.schedule;
  out.tau = stack.tau;
  out.loc = stack.loc / out.surface.unit;
  out.signal = local / out.surface.unit;
  out.keypoints = std::move(found.keypoints);
  for (Keypoint& keypoint : out.keypoints) {
    keypoint.radius *= out.surface.unit;
    keypoint.response /= out.surface.unit;
  }
  return out;
}

ReportPicture draw(const fs::path& directory, const Subject& subject, const std::string& suffix,
                   Scene scene, const std::string& caption, Context& context) {
  RenderOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.camera = camera_of(subject.view);
  const std::string name = subject.name + "-" + suffix + ".png";
  const Image image = render_surface(scene, options, context.run);
  context.run.throw_if_cancelled();  // a picture whose tiles are not all drawn is no picture
  write_png((directory / name).string(), image);
  return {name, subject.title + ": " + scene.legend.title, caption, kWidth, kHeight};
}

Scene plain_scene(const Analysis& analysis, const std::string& title) {
  Scene scene;
  scene.surfaces.push_back(to_scene_surface(analysis.surface));
  scene.legend.title = title;
  scene.legend.has_scale_bar = true;
  return scene;
}

std::vector<ReportPicture> loc_pictures(const fs::path& directory, const Subject& subject,
                                        const Analysis& analysis, Context& context) {
  std::vector<ReportPicture> out;
  for (const int level : {8, 16, 24}) {
    Scene scene = plain_scene(analysis, fmt::format("si-LoC, level {}", level));
    ColorSignal signal;
    signal.values = scale_invariant_loc(analysis.loc.middleRows(level, 1),
                                        analysis.signal.cwiseAbs().maxCoeff())
                        .row(0)
                        .transpose();
    signal.label = "si-LoC";
    color_by(scene, signal);
    const double width = std::sqrt(analysis.tau[level + 1]) * analysis.mean_edge;
    out.push_back(draw(directory, subject, fmt::format("loc{}", level), scene,
                       fmt::format("The Laplacian of the curvature signal at level {}, where "
                                   "details smaller than about {} are smoothed away; blue is a "
                                   "bump, red a hollow, in standard deviations.",
                                   level, format_number(width, 2)),
                       context));
  }
  return out;
}

ReportPicture keypoint_picture(const fs::path& directory, const Subject& subject,
                               const Analysis& analysis, Context& context) {
  Scene scene = plain_scene(analysis, "Keypoints");
  std::vector<SceneSphere> balls;
  for (const Keypoint& keypoint : analysis.keypoints) {
    if (static_cast<Eigen::Index>(balls.size()) == kDrawn) break;
    SceneSphere ball;
    ball.center = analysis.surface.points.row(keypoint.vertex).transpose();
    ball.radius = keypoint.radius;
    ball.color = keypoint_color(keypoint.kind == KeypointKind::maximum);
    balls.push_back(ball);
  }
  const Eigen::Index num_large = add_keypoint_balls(scene, balls);
  return draw(directory, subject, "keypoints", scene,
              fmt::format("The {} strongest of {} keypoints: a pin at each place and a ball of the "
                          "radius of its structure, "
                          "blue for bumps and orange for hollows. {} wide ones have a pin only.",
                          balls.size(), analysis.keypoints.size(), num_large),
              context);
}

Plot response_plot(const Analysis& analysis) {
  Plot plot;
  plot.title = "How keypoints choose their scale";
  plot.x_label = "scale √τ · mean edge (unit of the input)";
  plot.y_label = "response τ · LoC";
  plot.has_log_x = true;
  const Eigen::VectorXd factor = response_factors(analysis.schedule, ScaleMeasure::exact);
  for (std::size_t k = 0; k < std::min(kCurves, analysis.keypoints.size()); ++k) {
    const Keypoint& keypoint = analysis.keypoints[k];
    PlotSeries series;
    series.label = fmt::format(
        "vertex {}", analysis.surface.input_vertex[static_cast<std::size_t>(keypoint.vertex)]);
    for (Eigen::Index l = 1; l < analysis.loc.rows(); ++l) {
      if (l == keypoint.level) series.marks.push_back(series.x.size());
      series.x.push_back(std::sqrt(analysis.tau[l]) * analysis.mean_edge);
      series.y.push_back(factor[l] * analysis.loc(l, keypoint.vertex));
    }
    plot.series.push_back(series);
  }
  return plot;
}

void add_keypoint_table(HtmlReport& report, const Analysis& analysis) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t k = 0; k < std::min(kListed, analysis.keypoints.size()); ++k) {
    const Keypoint& keypoint = analysis.keypoints[k];
    rows.push_back(
        {std::to_string(k + 1),
         std::to_string(analysis.surface.input_vertex[static_cast<std::size_t>(keypoint.vertex)]),
         keypoint.kind == KeypointKind::maximum ? "hollow" : "bump", std::to_string(keypoint.level),
         format_number(keypoint.tau), format_number(keypoint.radius),
         format_number(keypoint.response), std::to_string(keypoint.persistence)});
  }
  report.add_table(
      {"rank", "vertex", "kind", "level", "τ", "radius", "response", "levels seen"}, rows,
      fmt::format("The strongest {} of {} keypoints. τ is in squared mean edges (one "
                  "mean edge is {}), the radius in the unit of the input.",
                  rows.size(), analysis.keypoints.size(), format_number(analysis.mean_edge)));
}

Timing add_subject(HtmlReport& report, const fs::path& directory, const Subject& subject,
                   Context& context) {
  Timing timing;
  const Analysis analysis = analyse(subject, timing, context);
  report.add_section(subject.title, fmt::format("{} {} vertices, {} triangles.", subject.note,
                                                timing.vertices, timing.faces));
  Watch watch;
  std::vector<ReportPicture> pictures = {keypoint_picture(directory, subject, analysis, context)};
  for (ReportPicture& picture : loc_pictures(directory, subject, analysis, context)) {
    pictures.push_back(std::move(picture));
  }
  timing.pictures = watch.lap();
  report.add_pictures(pictures);
  if (!analysis.keypoints.empty()) {
    report.add_svg(format_svg(response_plot(analysis)),
                   "The response of the strongest keypoints over scale, read at the vertex of "
                   "each; the square marks the level that was chosen. The curve peaks near it, not "
                   "always on it, because a keypoint is followed while it moves.");
    add_keypoint_table(report, analysis);
  } else {
    report.add_paragraph("No keypoint was found on this surface.");
  }
  report.add_heading("Make such pictures yourself");
  const std::string kp = subject.name + "-keypoints.json";
  report.add_commands(
      {fmt::format("dupin keypoints {} --top {} --json > {}", subject.file, kDrawn, kp),
       fmt::format("dupin render {} -o {}-keypoints.png --keypoints {} --view {} --size {}x{}",
                   subject.file, subject.name, kp, subject.view, kWidth, kHeight),
       fmt::format(
           "dupin render {} -o {}-loc16.png --color si_loc --level 16 --view {} --size {}x{}",
           subject.file, subject.name, subject.view, kWidth, kHeight)});
  return timing;
}

std::string milliseconds(double seconds) { return fmt::format("{:.0f}", 1e3 * seconds); }

void add_timings(HtmlReport& report, const std::vector<Timing>& timings) {
  report.add_section("Timings");
  std::vector<std::vector<std::string>> rows;
  for (const Timing& t : timings) {
    rows.push_back({t.name, std::to_string(t.vertices), std::to_string(t.faces),
                    milliseconds(t.signal), milliseconds(t.stack), milliseconds(t.keypoints),
                    milliseconds(t.pictures)});
  }
  report.add_table(
      {"surface", "vertices", "triangles", "signal", "scale space", "keypoints", "4 pictures"},
      rows,
      fmt::format("Milliseconds on this machine with {} threads, one run each, "
                  "whatever else it was doing.",
                  thread_count()));
}

void demo(const Settings& settings, Context& context) {
  set_thread_count(context.threads);
  const fs::path directory = settings.directory;
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) {
    throw IoError(Errc::cannot_write, "E_WRITE", error.message(), {settings.directory, 0, -1});
  }
  HtmlReport report("What Dupin finds on a surface",
                    "Every surface below was turned into a stack of ever smoother versions of its "
                    "curvature. Where that stack responds most strongly, in place and in scale, "
                    "there is a keypoint, and the stack says how large it is.");
  std::vector<Timing> timings;
  with_progress(context, "demo", [&] {
    std::vector<Subject> subjects;
    if (!settings.surfaces.empty()) subjects = file_subjects(settings.surfaces, context);
    for (Subject& subject : built_in_subjects(directory)) subjects.push_back(std::move(subject));
    for (const Subject& subject : subjects) {
      timings.push_back(add_subject(report, directory, subject, context));
    }
  });
  add_timings(report, timings);
  const std::string page = (directory / "index.html").string();
  write_file_atomically(
      page, report.page(fmt::format(
                "Made by dupin {} with the command: dupin demo {}{}", kVersion, settings.directory,
                settings.surfaces.empty() ? "" : " --surfaces " + settings.surfaces)));
  context.say(page);
  nlohmann::ordered_json document{{"report", page}};
  for (const Timing& t : timings) {
    document["surfaces"].push_back({{"name", t.name},
                                    {"vertices", t.vertices},
                                    {"faces", t.faces},
                                    {"seconds",
                                     {{"signal", t.signal},
                                      {"scale_space", t.stack},
                                      {"keypoints", t.keypoints},
                                      {"pictures", t.pictures}}},
                                    {"warnings", to_json(t.warnings)}});
  }
  context.print_json(document);
}

}  // namespace

void add_demo(CLI::App& app, Context& context) {
  auto settings = std::make_shared<Settings>();
  CLI::App* verb = app.add_subcommand("demo", "The whole story on built-in data, as an HTML page");
  verb->footer("Example:\n  dupin demo /tmp/demo --surfaces meshes");
  add_global_options(*verb, context);
  verb->add_option("directory", settings->directory, "Where the page and its pictures go")
      ->capture_default_str();
  verb->add_option("--surfaces", settings->surfaces,
                   "Directory with armadillo.off, bunny.off, elephant.off, mannequin-devil.off")
      ->envname("DUPIN_SURFACES");
  verb->callback([settings, &context] { demo(*settings, context); });
}

}  // namespace dupin::cli
