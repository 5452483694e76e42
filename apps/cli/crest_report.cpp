#include "crest_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/render/renderer.h"
#include "html_report.h"
#include "line_files.h"
#include "surface_picture.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 1000;  // px
constexpr int kHeight = 800;  // px
constexpr std::size_t kRows = 40;

std::string title_of(const CrestSubject& subject) {
  return subject.added_percent > 0.0 ? fmt::format("With {:g} % noise", subject.added_percent)
                                     : std::string("As it is");
}

bool has_snr(const CrestAnalysis& found, std::size_t line) {
  return !found.uncertainty.empty() &&
         found.uncertainty[line].snr < std::numeric_limits<double>::max();
}

std::string summary_of(const CrestAnalysis& found) {
  double length[2] = {0.0, 0.0};
  std::size_t count[2] = {0, 0};
  for (const CrestLine& line : found.set.lines) {
    const std::size_t kind = line.kind == CrestKind::ridge ? 0 : 1;
    length[kind] += line.length / found.surface.graph.mean_edge;
    ++count[kind];
  }
  return fmt::format(
      "{} vertices, mean edge {:.4g}, noise {:.1f} % of it in every coordinate. {} ridges, {:.0f} "
      "mean edges long together, and {} valleys, {:.0f}.",
      found.surface.graph.points.rows(), found.surface.graph.mean_edge * found.surface.unit,
      100.0 * found.sigma / found.surface.graph.mean_edge, count[0], length[0], count[1],
      length[1]);
}

std::vector<ReportPicture> draw_sides(const CrestSubject& subject, const std::string& view,
                                      Context& context) {
  Scene scene;
  scene.surfaces.push_back(to_scene_surface(subject.found.surface));
  scene.legend.title = title_of(subject);
  scene.legend.has_scale_bar = true;
  add_crest_lines(scene, subject.found.surface, subject.found.set);
  std::vector<ReportPicture> pictures;
  for (const bool is_back : {false, true}) {
    RenderOptions options;
    options.width = kWidth;
    options.height = kHeight;
    options.camera = camera_of(view);
    if (is_back) options.camera.azimuth_deg += 180.0;
    const Image image = render_surface(scene, options, context.run);
    context.run.throw_if_cancelled();
    pictures.push_back({data_uri(format_png(image)), "Crest lines: " + title_of(subject),
                        is_back ? "From the other side." : "Ridges red, valleys blue.", kWidth,
                        kHeight});
  }
  return pictures;
}

void add_line_table(HtmlReport& report, const CrestAnalysis& found) {
  const double unit = found.surface.unit;
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < std::min(kRows, found.set.lines.size()); ++i) {
    const CrestLine& line = found.set.lines[i];
    rows.push_back(
        {kind_name(line), fmt::format("{:.4g}", line.length * unit),
         fmt::format("{:.3f}", line.strength),
         found.uncertainty.empty() ? std::string("-")
                                   : fmt::format("{:.3f}", found.uncertainty[i].strength_sd),
         fmt::format("{:.4g}", line.mean_scale * unit), fmt::format("{:.2f}", line.sharpness),
         has_snr(found, i) ? fmt::format("{:.1f}", found.uncertainty[i].snr) : std::string("-"),
         line.is_closed ? "yes" : "no"});
  }
  const std::size_t count = found.set.lines.size();
  report.add_table(
      {"kind", "length", "strength [rad]", "\u00b1", "scale", "sharpness", "snr", "closed"}, rows,
      count > kRows
          ? fmt::format("The first {} of {} lines, by strength times length.", kRows, count)
          : std::string("All lines, by strength times length."));
}

}  // namespace

const char* kind_name(const CrestLine& line) {
  return line.kind == CrestKind::ridge ? "ridge" : "valley";
}

void add_crest_lines(Scene& scene, const LoadedSurface& surface, const CrestSet& set) {
  constexpr double kLineWidth = 3.5;  // px, of the median scale
  std::vector<std::vector<double>> scales;
  for (const CrestLine& line : set.lines) {
    ScenePolyline polyline;
    polyline.color = crest_color(line.kind);
    polyline.points.resize(static_cast<Eigen::Index>(line.points.size()), 3);
    scales.emplace_back();
    for (std::size_t k = 0; k < line.points.size(); ++k) {
      const EdgeCrossing& c = line.points[k].edge;
      polyline.points.row(static_cast<Eigen::Index>(k)) =
          (1.0 - c.weight) * surface.points.row(c.a) + c.weight * surface.points.row(c.b);
      scales.back().push_back(line.points[k].radius);
    }
    scene.polylines.push_back(std::move(polyline));
  }
  set_widths(scene.polylines, scales, kLineWidth);
}

void write_crest_report(const std::string& page, const std::string& mesh, const std::string& view,
                        const std::vector<CrestSubject>& subjects, Context& context) {
  HtmlReport report("Crest lines of " + fs::path(mesh).filename().string(),
                    "Ridges and valleys: where a surface bends most across its own bend. Lines are "
                    "as thick as the "
                    "scale found along them; strength is the angle that the surface turns more "
                    "across a line than "
                    "along it, over its scale.");
  for (const CrestSubject& subject : subjects) {
    report.add_section(title_of(subject), summary_of(subject.found));
    report.add_pictures(draw_sides(subject, view, context));
    if (!subject.found.set.lines.empty()) add_line_table(report, subject.found);
  }
  write_file_atomically(page, report.page("Made by dupin crest."));
}

}  // namespace dupin::cli
