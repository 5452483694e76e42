#include "demo_crest.h"

#include <fmt/format.h>

#include "crest_report.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/mls/noise_level.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kPercent = 30.0;

struct Drawn {
  std::size_t num_lines = 0;
  double length = 0.0;  // mean edges
  double seconds = 0.0;
};

// The crest lines of `analysis` as `dupin crest` finds them, as thick as their scales.
Scene crest_scene(const DemoAnalysis& analysis, const std::string& title, Drawn& drawn,
                  Context& context) {
  Scene scene = plain_scene(analysis, title);
  const SurfaceGraph& graph = analysis.surface.graph;
  Watch watch;
  CrestOptions options;
  options.noise_sigma = estimate_noise(graph.points, {.seed = context.seed}, context.run).sigma;
  const CrestSet set = find_crest_lines(graph, options, context.run);
  context.run.throw_if_cancelled();
  drawn.seconds = watch.lap();
  drawn.num_lines = set.lines.size();
  for (const CrestLine& line : set.lines) drawn.length += line.length / graph.mean_edge;
  add_crest_lines(scene, analysis.surface, set);
  return scene;
}

}  // namespace

nlohmann::ordered_json add_crest_lines(HtmlReport& report, const fs::path& directory,
                                       const DemoSubject& subject, const DemoAnalysis& clean,
                                       Context& context) {
  report.add_section(
      "Crest lines",
      fmt::format("Ridges (red) and valleys (blue) of {}, as thick as the scales found along "
                  "them, on the surface as it is and with noise of {:.0f} % of the mean edge.",
                  subject.title, kPercent));
  DemoSubject scan = subject;
  scan.name = subject.name + "-crest-noisy";
  scan.title = subject.title + " with noise";
  scan.file = (directory / (scan.name + ".ply")).string();
  scan.mesh = to_polygon_mesh(add_noise({clean.surface.points, clean.surface.graph.triangles},
                                        {.percent = kPercent, .seed = context.seed})
                                  .mesh);
  write_subject(scan);
  DemoTiming timing;
  const DemoAnalysis noisy = analyse(scan, timing, context);
  Drawn at_clean;
  Drawn at_noisy;
  const Scene clean_scene = crest_scene(clean, "Crest lines", at_clean, context);
  const Scene noisy_scene = crest_scene(noisy, "Crest lines under noise", at_noisy, context);
  const auto caption = [](const Drawn& drawn) {
    return fmt::format("{} lines, {:.0f} mean edges long together, in {:.2f} s.", drawn.num_lines,
                       drawn.length, drawn.seconds);
  };
  report.add_pictures({draw(directory, subject, "crest", clean_scene, caption(at_clean), context),
                       draw(directory, scan, "crest", noisy_scene, caption(at_noisy), context)});
  report.add_heading("Make such pictures yourself");
  report.add_commands(
      {fmt::format("dupin crest {} -o {}-lines.ply", shell_quoted(scan.file), scan.name),
       fmt::format("dupin render {} --lines {}-lines.ply --view {} -o {}-lines.png",
                   shell_quoted(scan.file), scan.name, subject.view, scan.name)});
  const auto figures = [](const Drawn& drawn) {
    return nlohmann::ordered_json{{"lines", drawn.num_lines},
                                  {"length_in_mean_edges", drawn.length},
                                  {"seconds", drawn.seconds}};
  };
  return {{"clean", figures(at_clean)}, {"noisy", figures(at_noisy)}};
}

}  // namespace dupin::cli
