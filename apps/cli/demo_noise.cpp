#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "demo_parts.h"
#include "dupin/features/keypoint_uncertainty.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/mls/noise_level.h"
#include "dupin/render/ticks.h"
#include "svg_plot.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kPercent = 50.0;  // of the mean edge
constexpr double kSignificance = 0.05;
constexpr double kReach = 2.0;  // mean edges to a counterpart
constexpr int kCoarse = 15;     // clean keypoints of this level up are looked for
constexpr std::size_t kCurves = 3;

struct Scan {
  DemoSubject subject;
  DemoAnalysis analysis;  // input unit
  double sigma = 0.0;     // that was added, input unit
  NoiseLevel level;       // that is found, input unit
  NoiseLevel floor;       // found without any, input unit
  StackNoise noise;       // local unit
  int advised_level = -1;
  std::vector<KeypointUncertainty> sure;  // aligned with the keypoints
  std::vector<bool> is_kept;
  std::vector<bool> is_real;  // has a clean keypoint near
  double seconds = 0.0;       // of the error bars
};

NoiseLevel noise_level(const DemoAnalysis& analysis, Context& context) {
  NoiseLevelOptions options;
  options.seed = context.seed;
  NoiseLevel level = estimate_noise(analysis.surface.graph.points, options, context.run);
  context.run.throw_if_cancelled();
  level.sigma *= analysis.surface.unit;
  level.sigma_standard_error *= analysis.surface.unit;
  return level;
}

// Vertex of the clean surface.
std::int32_t clean_vertex(const Scan& scan, const Keypoint& point) {
  return scan.analysis.surface.input_vertex[static_cast<std::size_t>(point.vertex)];
}

// Clean positions on both sides: noise moves a vertex, not what it is a vertex of.
bool are_near(const DemoAnalysis& clean, std::int32_t a, std::int32_t b) {
  const Points& points = clean.surface.points;
  return (points.row(a) - points.row(b)).norm() <= kReach * clean.mean_edge;
}

Scan make_scan(const fs::path& directory, const DemoSubject& subject, const DemoAnalysis& clean,
               Context& context) {
  Scan scan;
  NoiseOptions options;
  options.percent = kPercent;
  options.seed = context.seed;
  const NoisyMesh noisy = add_noise({clean.surface.points, clean.surface.graph.triangles}, options);
  scan.sigma = noisy.sigma;
  scan.subject = subject;
  scan.subject.name = subject.name + "-noisy";
  scan.subject.title = subject.title + " with noise";
  scan.subject.file = (directory / (scan.subject.name + ".ply")).string();
  scan.subject.mesh = to_polygon_mesh(noisy.mesh);
  write_subject(scan.subject);
  return scan;
}

// As `dupin keypoints --noise auto --significance 0.05` does it.
void add_error_bars(Scan& scan, const DemoAnalysis& clean, Context& context) {
  DemoTiming timing;
  scan.analysis = analyse(scan.subject, timing, context);
  DemoAnalysis& analysis = scan.analysis;
  scan.level = noise_level(analysis, context);
  scan.floor = noise_level(clean, context);
  const SurfaceGraph& graph = analysis.surface.graph;
  Watch watch;
  SignalNoiseOptions positions;
  positions.sigma = scan.level.sigma / analysis.surface.unit;
  positions.seed = context.seed;
  const KeypointOptions options;
  const DiffusionOperator op = umbrella_operator(graph.topology.ring, &graph.topology);
  scan.noise =
      estimate_stack_noise(op, make_signal_noise(graph, Signal::height, positions),
                           keypoint_noise_options(graph, analysis.schedule, options), context.run);
  context.run.throw_if_cancelled();
  scan.sure = estimate_keypoint_uncertainty(graph, analysis.loc, analysis.schedule, scan.noise,
                                            analysis.keypoints, options, context.run);
  context.run.throw_if_cancelled();
  scan.advised_level = advise_level(analysis.loc, scan.noise.loc_sd);
  for (std::size_t i = 0; i < analysis.keypoints.size(); ++i) {
    scan.is_kept.push_back(is_significant(scan.sure[i], kSignificance));
    const std::int32_t vertex = clean_vertex(scan, analysis.keypoints[i]);
    scan.is_real.push_back(
        std::any_of(clean.keypoints.begin(), clean.keypoints.end(),
                    [&](const Keypoint& other) { return are_near(clean, vertex, other.vertex); }));
  }
  scan.seconds = watch.lap();
  to_input_unit(analysis);
}

// Solid balls of one size: two hundred bubbles of the radii of their structures hide the surface.
void add_pin(Scene& scene, const Keypoint& keypoint, const Rgb& color) {
  const Points& points = scene.surfaces.front().points;
  SceneSphere pin;
  pin.center = points.row(keypoint.vertex).transpose();
  pin.radius = 0.011 * (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  pin.color = color;
  pin.opacity = 1.0;
  scene.spheres.push_back(pin);
}

ReportPicture clean_picture(const fs::path& directory, const DemoSubject& subject,
                            const DemoAnalysis& clean, Context& context) {
  Scene scene = plain_scene(clean, "Without noise: all keypoints");
  for (const Keypoint& keypoint : clean.keypoints) {
    add_pin(scene, keypoint, keypoint_color(keypoint.kind == KeypointKind::maximum));
  }
  return draw(directory, subject, "all", scene,
              fmt::format("The surface as it came, with all of its {} keypoints: blue for bumps, "
                          "orange for hollows.",
                          scene.spheres.size()),
              context);
}

// All keypoints of the scan, or those that are kept, in the colours of their signal-to-noise ratio.
ReportPicture snr_picture(const fs::path& directory, const Scan& scan, bool only_kept,
                          const ColorScale& scale, Context& context) {
  Scene scene = plain_scene(scan.analysis,
                            only_kept ? fmt::format("Kept at significance {}", kSignificance)
                                      : fmt::format("{:.0f} % noise: all keypoints", kPercent));
  std::size_t num_real = 0;
  for (std::size_t i = 0; i < scan.sure.size(); ++i) {
    if (only_kept && !scan.is_kept[i]) continue;
    if (scan.is_real[i]) ++num_real;
    add_pin(scene, scan.analysis.keypoints[i], scale.color(scan.sure[i].snr));
  }
  scene.scale = scale;
  scene.legend.scale_label = "SNR";
  scene.legend.has_color_bar = true;
  const std::string caption =
      only_kept ? fmt::format(
                      "What stays: {} keypoints, {} of them within {:.0f} mean edges of a "
                      "keypoint of the surface without noise.",
                      scene.spheres.size(), num_real, kReach)
                : fmt::format(
                      "The scan with all {} keypoints, dark where noise could have made "
                      "them. {} have a counterpart on the surface without noise.",
                      scene.spheres.size(), num_real);
  return draw(directory, scan.subject, only_kept ? "kept" : "snr", scene, caption, context);
}

// |LoC| over its standard deviation at the advised level, everywhere.
ReportPicture level_picture(const fs::path& directory, const Scan& scan, int level,
                            Context& context) {
  Scene scene = plain_scene(scan.analysis, fmt::format("How sure, at level {}", level));
  const double unit = scan.analysis.surface.unit;
  ColorSignal signal;
  signal.values = (scan.analysis.loc.row(level).array().abs() * unit /
                   scan.noise.loc_sd.row(level).array().cast<double>().max(1e-300))
                      .matrix()
                      .transpose();
  signal.label = "|LoC| / sd";
  signal.is_signed = false;
  color_by(scene, signal);
  return draw(directory, scan.subject, "sure", scene,
              fmt::format("The response over its standard deviation at every vertex at level {}{}. "
                          "Dark: nothing there that noise does not explain.",
                          level,
                          level == scan.advised_level ? ", the first at which noise is less than "
                                                        "half of what the surface shows"
                                                      : ""),
              context);
}

// The largest responses of different places among those that are kept (else among all).
std::vector<std::size_t> shown_keypoints(const Scan& scan, const DemoAnalysis& clean) {
  std::vector<std::size_t> out;
  for (const bool want_kept : {true, false}) {
    for (std::size_t i = 0; i < scan.sure.size() && out.size() < kCurves; ++i) {
      if (scan.is_kept[i] != want_kept) continue;
      const auto is_seen = [&](std::size_t k) {
        return (clean.surface.points.row(clean_vertex(scan, scan.analysis.keypoints[i])) -
                clean.surface.points.row(clean_vertex(scan, scan.analysis.keypoints[k])))
                   .norm() < scan.analysis.keypoints[i].radius;
      };
      if (std::none_of(out.begin(), out.end(), is_seen)) out.push_back(i);
    }
  }
  return out;
}

struct Curves {
  Plot response;
  Plot snr;
};

Curves curves_of(const Scan& scan, const DemoAnalysis& clean) {
  Curves out;
  out.response.title = "Responses with their error bars";
  out.response.y_label = "τ · LoC · e² ± 2 sd";
  out.snr.title = "Signal over noise";
  out.snr.y_label = "|LoC| / sd";
  for (Plot* plot : {&out.response, &out.snr}) {
    plot->x_label = "scale √τ · mean edge (unit of the input)";
    plot->has_log_x = true;
  }
  const DemoAnalysis& noisy = scan.analysis;
  const Eigen::VectorXd factor = response_factors(noisy.schedule, ScaleMeasure::exact);
  const auto scale_of = [&](Eigen::Index l) { return std::sqrt(noisy.tau[l]) * clean.mean_edge; };
  // The signal is a height over the squared mean edge, and noise makes edges longer: that factor,
  // the same for all vertices, is no matter of error bars.
  const double squared[] = {noisy.mean_edge * noisy.mean_edge, clean.mean_edge * clean.mean_edge};
  int color = 0;
  // Below, noise is all there is, and the bands would be all of the picture.
  const Eigen::Index first = std::clamp<Eigen::Index>(scan.advised_level - 2, 4, 12);
  for (const std::size_t i : shown_keypoints(scan, clean)) {
    const Keypoint& point = noisy.keypoints[i];
    const std::int32_t there = clean_vertex(scan, point);
    PlotSeries curve;
    curve.label = fmt::format("vertex {}", there);
    curve.color = color;
    PlotSeries truth;
    truth.color = color;
    truth.is_dashed = true;
    PlotSeries ratio;
    ratio.label = curve.label;
    ratio.color = color++;
    for (Eigen::Index l = first; l < noisy.loc.rows(); ++l) {
      if (l == point.level) {
        curve.marks.push_back(curve.x.size());
        ratio.marks.push_back(ratio.x.size());
      }
      const double sd =
          static_cast<double>(scan.noise.loc_sd(l, point.vertex)) / noisy.surface.unit;
      for (PlotSeries* series : {&curve, &truth, &ratio}) series->x.push_back(scale_of(l));
      curve.y.push_back(squared[0] * factor[l] * noisy.loc(l, point.vertex));
      curve.band.push_back(2.0 * squared[0] * factor[l] * sd);
      truth.y.push_back(squared[1] * factor[l] * clean.loc(l, there));
      ratio.y.push_back(std::abs(noisy.loc(l, point.vertex)) / std::max(sd, 1e-300));
    }
    out.response.series.push_back(curve);
    out.response.series.push_back(truth);
    out.snr.series.push_back(ratio);
  }
  if (scan.advised_level > 0) {
    for (Plot* plot : {&out.response, &out.snr}) {
      plot->guides.push_back({scale_of(std::max<Eigen::Index>(first, scan.advised_level)),
                              fmt::format("advised level {}", scan.advised_level)});
    }
  }
  return out;
}

// Share of all vertices at which the truth is within two standard deviations at `level`.
double coverage(const Scan& scan, const DemoAnalysis& clean, Eigen::Index level) {
  const DemoAnalysis& noisy = scan.analysis;
  const double ratio = clean.mean_edge * clean.mean_edge / (noisy.mean_edge * noisy.mean_edge);
  Eigen::Index inside = 0;
  for (Eigen::Index v = 0; v < noisy.loc.cols(); ++v) {
    const std::int32_t there = noisy.surface.input_vertex[static_cast<std::size_t>(v)];
    const double sd = static_cast<double>(scan.noise.loc_sd(level, v)) / noisy.surface.unit;
    if (std::abs(noisy.loc(level, v) - ratio * clean.loc(level, there)) <= 2.0 * sd) ++inside;
  }
  return static_cast<double>(inside) / static_cast<double>(noisy.loc.cols());
}

std::string share(std::size_t part, std::size_t whole) {
  return whole == 0 ? "-"
                    : fmt::format("{:.0f} %",
                                  100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

nlohmann::ordered_json add_counts(HtmlReport& report, const Scan& scan, const DemoAnalysis& clean) {
  std::size_t kept = 0;
  std::size_t kept_real = 0;
  std::size_t real = 0;
  for (std::size_t i = 0; i < scan.sure.size(); ++i) {
    if (scan.is_real[i]) ++real;
    if (scan.is_kept[i]) ++kept;
    if (scan.is_kept[i] && scan.is_real[i]) ++kept_real;
  }
  std::size_t coarse = 0;
  std::size_t again = 0;
  for (const Keypoint& point : clean.keypoints) {
    if (point.level < kCoarse) continue;
    ++coarse;
    for (std::size_t i = 0; i < scan.sure.size(); ++i) {
      if (!scan.is_kept[i]) continue;
      if (are_near(clean, clean_vertex(scan, scan.analysis.keypoints[i]), point.vertex)) {
        ++again;
        break;
      }
    }
  }
  const std::size_t all = scan.sure.size();
  report.add_table(
      {"keypoints of the scan", "how many", "with a clean counterpart", "share"},
      {{"all", std::to_string(all), std::to_string(real), share(real, all)},
       {fmt::format("kept at significance {}", kSignificance), std::to_string(kept),
        std::to_string(kept_real), share(kept_real, kept)},
       {"given up", std::to_string(all - kept), std::to_string(real - kept_real),
        share(real - kept_real, all - kept)}},
      fmt::format("A counterpart is a keypoint of the surface without noise within {:.0f} mean "
                  "edges. Of its {} keypoints of level {} and up, {} are found again among those "
                  "that are kept.",
                  kReach, coarse, kCoarse, again));
  const auto percent = [&](double sigma) {
    return fmt::format("{:.1f}", 100.0 * sigma / clean.mean_edge);
  };
  const double expected = std::hypot(scan.sigma, scan.floor.sigma);
  report.add_table(
      {"noise along the normal", "standard deviation", "± standard error", "% of the mean edge"},
      {{"added", format_number(scan.sigma), "0", percent(scan.sigma)},
       {"estimated from the scan", format_number(scan.level.sigma),
        format_number(scan.level.sigma_standard_error, 2), percent(scan.level.sigma)},
       {"estimated from the surface without it", format_number(scan.floor.sigma),
        format_number(scan.floor.sigma_standard_error, 2), percent(scan.floor.sigma)}},
      fmt::format(
          "Whatever a surface does within 20 points that a cubic does not follow counts as "
          "noise, so the surface as it came has some of its own: together, √(a² + b²), {}.{}",
          format_number(expected),
          scan.level.sigma > expected + 2.0 * scan.level.sigma_standard_error
              ? " Here the estimate is above even that; then the bars are too long, and fewer "
                "keypoints are kept than could be."
              : ""));
  return {{"surface", scan.subject.file},
          {"sigma_added", scan.sigma},
          {"sigma", scan.level.sigma},
          {"sigma_standard_error", scan.level.sigma_standard_error},
          {"sigma_without", scan.floor.sigma},
          {"advised_level", scan.advised_level},
          {"keypoints", all},
          {"with_counterpart", real},
          {"kept", kept},
          {"kept_with_counterpart", kept_real},
          {"seconds", scan.seconds}};
}

}  // namespace

nlohmann::ordered_json add_noisy_scan(HtmlReport& report, const fs::path& directory,
                                      const DemoSubject& subject, const DemoAnalysis& clean,
                                      Context& context) {
  Scan scan = make_scan(directory, subject, clean, context);
  report.add_section(
      "How sure are we?",
      fmt::format("{} again, every vertex moved along its normal by noise of {:.0f} % of the mean "
                  "edge. The noise is estimated from the scan alone, sent through the whole chain "
                  "as 32 replicas, and every response gets its standard deviation.",
                  subject.title, kPercent));
  add_error_bars(scan, clean, context);
  Eigen::VectorXd snr(static_cast<Eigen::Index>(scan.sure.size()));
  for (std::size_t i = 0; i < scan.sure.size(); ++i) {
    snr[static_cast<Eigen::Index>(i)] = scan.sure[i].snr;
  }
  const ColorScale scale{ColorMap::sequential, robust_range(snr)};
  std::vector<ReportPicture> pictures{clean_picture(directory, subject, clean, context),
                                      snr_picture(directory, scan, false, scale, context),
                                      snr_picture(directory, scan, true, scale, context)};
  const int level = scan.advised_level > 0 ? scan.advised_level : 20;
  pictures.push_back(level_picture(directory, scan, level, context));
  report.add_pictures(pictures);
  nlohmann::ordered_json figures = add_counts(report, scan, clean);
  const Curves curves = curves_of(scan, clean);
  if (!curves.response.series.empty()) {
    report.add_svg(
        format_svg(curves.response),
        fmt::format(
            "What the scan shows (solid) with a band of two standard deviations, computed "
            "without knowing the truth, and the truth (dashed): the same vertex without "
            "noise. The square is the level of the keypoint. e is the mean edge of each "
            "surface, by whose square the signal is divided; noise makes it {:.0f} % longer. "
            "Of all vertices {:.0f} % are within the band at level 10, {:.0f} % at 16, {:.0f} % at "
            "24; 95 % are promised, but for noise in all directions, and this goes along the "
            "normals alone.",
            100.0 * (scan.analysis.mean_edge / clean.mean_edge - 1.0),
            100.0 * coverage(scan, clean, 10), 100.0 * coverage(scan, clean, 16),
            100.0 * coverage(scan, clean, 24)));
    report.add_svg(format_svg(curves.snr),
                   "The same keypoints: smoothing takes noise away faster than structure, until "
                   "the structure itself is smoothed away.");
  }
  report.add_heading("Make such pictures yourself");
  const std::string base = subject.name + "-noisy";
  report.add_commands(
      {fmt::format("dupin mls noise {}", shell_quoted(scan.subject.file)),
       fmt::format("dupin keypoints {} --significance {} --json > {}-kept.json",
                   shell_quoted(scan.subject.file), kSignificance, base),
       fmt::format("dupin render {} -o {}-kept.png --keypoints {}-kept.json --color snr --view {} "
                   "--size {}x{}",
                   shell_quoted(scan.subject.file), base, base, subject.view, kDemoWidth,
                   kDemoHeight)});
  report.add_paragraph(fmt::format("The error bars took {:.1f} s.", scan.seconds));
  return figures;
}

}  // namespace dupin::cli
