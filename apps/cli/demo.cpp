#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "demo_crest.h"
#include "demo_parts.h"
#include "demo_register.h"
#include "demo_warp.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/version.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/render/ticks.h"
#include "svg_plot.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr Eigen::Index kDrawn = 40;  // keypoints in a picture
constexpr std::size_t kCurves = 5;   // keypoints in a plot
constexpr std::size_t kListed = 15;  // keypoints in a table

struct Settings {
  std::string directory = "dupin-demo";
  std::string surfaces;
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

std::vector<DemoSubject> file_subjects(const std::string& directory, Context& context) {
  std::vector<DemoSubject> out;
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

std::vector<DemoSubject> built_in_subjects(const fs::path& directory) {
  std::vector<DemoSubject> out;
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
  for (DemoSubject& subject : out) {
    subject.file = (directory / subject.file).string();
    write_subject(subject);
  }
  return out;
}

std::vector<ReportPicture> loc_pictures(const fs::path& directory, const DemoSubject& subject,
                                        const DemoAnalysis& analysis, Context& context) {
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

ReportPicture keypoint_picture(const fs::path& directory, const DemoSubject& subject,
                               const DemoAnalysis& analysis, Context& context) {
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

Plot response_plot(const DemoAnalysis& analysis) {
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

void add_keypoint_table(HtmlReport& report, const DemoAnalysis& analysis) {
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

DemoAnalysis add_subject(HtmlReport& report, const fs::path& directory, const DemoSubject& subject,
                         DemoTiming& timing, Context& context) {
  DemoAnalysis analysis = analyse(subject, timing, context);
  to_input_unit(analysis);
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
      {fmt::format("dupin keypoints {} --top {} --json > {}", shell_quoted(subject.file), kDrawn,
                   kp),
       fmt::format("dupin render {} -o {}-keypoints.png --keypoints {} --view {} --size {}x{}",
                   shell_quoted(subject.file), subject.name, kp, subject.view, kDemoWidth,
                   kDemoHeight),
       fmt::format(
           "dupin render {} -o {}-loc16.png --color si_loc --level 16 --view {} --size {}x{}",
           shell_quoted(subject.file), subject.name, subject.view, kDemoWidth, kDemoHeight)});
  return analysis;
}

std::string milliseconds(double seconds) { return fmt::format("{:.0f}", 1e3 * seconds); }

void add_timings(HtmlReport& report, const std::vector<DemoTiming>& timings) {
  report.add_section("Timings");
  std::vector<std::vector<std::string>> rows;
  for (const DemoTiming& t : timings) {
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
  std::vector<DemoTiming> timings;
  nlohmann::ordered_json noisy_scan;
  nlohmann::ordered_json crest_lines;
  nlohmann::ordered_json registration;
  nlohmann::ordered_json warps;
  with_progress(context, "demo", [&] {
    std::vector<DemoSubject> subjects;
    if (!settings.surfaces.empty()) subjects = file_subjects(settings.surfaces, context);
    for (DemoSubject& subject : built_in_subjects(directory))
      subjects.push_back(std::move(subject));
    for (const DemoSubject& subject : subjects) {
      DemoTiming timing;
      const DemoAnalysis analysis = add_subject(report, directory, subject, timing, context);
      timings.push_back(timing);
      // The first surface is scanned again, with noise.
      if (&subject == &subjects.front()) {
        noisy_scan = add_noisy_scan(report, directory, subject, analysis, context);
        crest_lines = add_crest_lines(report, directory, subject, analysis, context);
      }
    }
    add_local_scale(report, directory, context);
    registration = add_registration(report, directory, context);
    warps = add_warps(report, directory, context);
  });
  add_timings(report, timings);
  const std::string page = (directory / "index.html").string();
  write_file_atomically(
      page, report.page(fmt::format(
                "Made by dupin {} with the command: dupin demo {}{}", kVersion, settings.directory,
                settings.surfaces.empty() ? "" : " --surfaces " + settings.surfaces)));
  context.say(page);
  nlohmann::ordered_json document{{"report", page}};
  for (const DemoTiming& t : timings) {
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
  document["noisy_scan"] = noisy_scan;
  document["crest_lines"] = crest_lines;
  document["registration"] = registration;
  document["warps"] = warps;
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
