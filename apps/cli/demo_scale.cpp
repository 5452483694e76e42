#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

#include "demo_parts.h"
#include "dupin/base/random.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mls/local_scale.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr Eigen::Index kVertices = 8000;
constexpr std::size_t kTested = 500;
constexpr double kPercent = 80.0;  // of the mean edge
constexpr int kOneSize = 60;       // of the picture of T

std::vector<std::int32_t> tested_vertices(Eigen::Index count, std::uint64_t seed) {
  std::vector<std::int32_t> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), 0);
  Rng rng(seed);
  const std::size_t wanted = std::min(kTested, all.size());
  for (std::size_t i = 0; i < wanted; ++i) {
    std::swap(all[i], all[i + static_cast<std::size_t>(rng.below(all.size() - i))]);
  }
  all.resize(wanted);
  return all;
}

LocalScaleField scales_of(const DemoAnalysis& torus, double sigma, const std::vector<int>& sizes,
                          Context& context) {
  LocalScaleOptions options;
  options.draws.sigma = sigma;
  options.draws.realisations = 50;
  options.draws.experiments = 6;
  options.draws.seed = context.seed;
  options.sizes = sizes;
  LocalScaleField field = find_local_scales(
      torus.surface.points, torus.surface.graph.normals,
      tested_vertices(torus.surface.points.rows(), context.seed), options, context.run);
  context.run.throw_if_cancelled();
  return field;
}

}  // namespace

void add_local_scale(HtmlReport& report, const fs::path& directory, Context& context) {
  DemoSubject subject;
  subject.name = "torus-scale";
  subject.title = "Torus";
  subject.view = "20,50";
  subject.file = (directory / (subject.name + ".ply")).string();
  subject.mesh = to_polygon_mesh(make_torus(1.0, 0.4, kVertices).mesh);
  write_subject(subject);
  DemoAnalysis torus;
  torus.surface = to_loaded_surface(subject.mesh, subject.name, context);
  const double mean_edge = torus.surface.graph.mean_edge * torus.surface.unit;
  const double sigma = 0.01 * kPercent * mean_edge;
  const std::vector<int> sizes = {30, 40, 50, 60, 70, 80, 100, 120, 150};
  Watch watch;
  const LocalScaleField field = scales_of(torus, sigma, sizes, context);
  const LocalScaleField fixed = scales_of(torus, sigma, {kOneSize}, context);
  const double seconds = watch.lap();

  const std::vector<std::size_t> nearest = nearest_sample(torus.surface.points, field.vertices);
  ColorSignal chosen;
  chosen.label = "neighbours";
  chosen.absent_label = "no size passes";
  chosen.is_signed = false;
  ColorSignal statistic;
  statistic.label = "T";
  statistic.is_signed = false;
  chosen.values.resize(torus.surface.points.rows());
  statistic.values.resize(torus.surface.points.rows());
  for (Eigen::Index v = 0; v < chosen.values.size(); ++v) {
    const std::size_t i = nearest[static_cast<std::size_t>(v)];
    chosen.values[v] = field.scales[i].test().neighbors;
    chosen.is_absent.push_back(field.scales[i].passed() ? 0 : 1);
    statistic.values[v] = std::min(fixed.scales[i].test().T_kappa, 1e300);
  }
  const auto passed = std::count_if(field.scales.begin(), field.scales.end(),
                                    [](const LocalScale& scale) { return scale.passed(); });

  report.add_section(
      "How many neighbours does curvature need?",
      fmt::format("A torus of {} vertices with noise of {:.0f} % of the mean edge. At {} places "
                  "noise was added many times and curvature measured anew, until it scattered as "
                  "its own error bars said.",
                  torus.surface.points.rows(), kPercent, field.scales.size()));
  Scene scale_map = plain_scene(torus, "The smallest patch that can be believed");
  color_by(scale_map, chosen);
  std::vector<ReportPicture> pictures{
      draw(directory, subject, "neighbours", scale_map,
           fmt::format("The smallest neighbourhood whose error bars hold. At {} of {} places none "
                       "of {} to {} points does: there this noise leaves no curvature with a known "
                       "error.",
                       static_cast<Eigen::Index>(field.scales.size()) - passed, field.scales.size(),
                       sizes.front(), sizes.back()),
           context)};
  const double critical = fixed.scales.front().test().critical_kappa;
  Scene statistic_map =
      plain_scene(torus, fmt::format("Test statistic of {} neighbours", kOneSize));
  color_by(statistic_map, statistic);
  set_color_scale(statistic_map, statistic, {ColorMap::sequential, {0.0, 3.0 * critical}});
  pictures.push_back(
      draw(directory, subject, "statistic", statistic_map,
           fmt::format("The likelihood-ratio statistic of K and H for patches of {} points; below "
                       "{:.1f} the error bars are believed.",
                       kOneSize, critical),
           context));
  report.add_pictures(pictures);
  report.add_heading("Make such pictures yourself");
  const std::string list = fmt::format("{}", fmt::join(sizes, ","));
  report.add_commands(
      {fmt::format("dupin mls scale {} --noise {:.4g} --samples {} --realisations 50 --experiments "
                   "6 --sizes {} --field neighbors=neighbours.npy --report scale.html",
                   shell_quoted(subject.file), sigma, kTested, list),
       fmt::format("dupin render {} -o neighbours.png --color neighbours.npy --no-value -1 "
                   "--no-value-label \"no size passes\" --view {} --size {}x{}",
                   shell_quoted(subject.file), subject.view, kDemoWidth, kDemoHeight)});
  report.add_paragraph(
      fmt::format("The tests took {:.1f} s. The page that --report writes shows the whole "
                  "validation at one vertex.",
                  seconds));
}

}  // namespace dupin::cli
