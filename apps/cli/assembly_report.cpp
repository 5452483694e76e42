#include "assembly_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "dupin/base/version.h"
#include "html_report.h"
#include "registration_answer.h"
#include "registration_pictures.h"

namespace dupin::cli {
namespace {

using std::size_t;

constexpr int kWidth = 800;  // px
constexpr int kHeight = 600;

std::string number(double value) { return fmt::format("{:.6g}", value); }

std::string number(const std::optional<double>& value, double unit) {
  return value ? number(unit * *value) : "-";
}

struct Row {
  std::int32_t moving = -1;
  std::int32_t fixed = -1;
  std::vector<std::string> cells;
};

// All pairs in the order of the scans, accepted or not.
void add_pairs(HtmlReport& report, const Assembly& assembly) {
  std::vector<Row> rows;
  const auto name = [&](std::int32_t scan) { return assembly.names[static_cast<size_t>(scan)]; };
  for (const ScanPairResult& pair : assembly.result.pairs) {
    rows.push_back(
        {pair.moving,
         pair.fixed,
         {name(pair.moving), name(pair.fixed), "accepted", pair.is_used ? "used" : "dropped",
          number(pair.fit.overlap_moving), number(pair.fit.overlap_fixed), number(pair.confidence),
          number(pair.loop_turn, 180.0 / std::numbers::pi),
          number(pair.loop_shift, assembly.unit)}});
  }
  for (const RefusedPair& pair : assembly.result.refused) {
    rows.push_back({pair.moving,
                    pair.fixed,
                    {name(pair.moving), name(pair.fixed), name_of(pair.refusal), "-", "-", "-", "-",
                     "-", "-"}});
  }
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
    return a.moving != b.moving ? a.moving < b.moving : a.fixed < b.fixed;
  });
  std::vector<std::vector<std::string>> cells;
  for (Row& row : rows) cells.push_back(std::move(row.cells));
  report.add_section("Pairs");
  report.add_table({"moving", "fixed", "answer", "use", "overlap", "overlap_fixed", "confidence",
                    "loop_turn", "loop_shift"},
                   cells,
                   "Every pair of scans. A pair is used where it agrees with the loops it is part "
                   "of; the loop error says how far its own pose is from that of all scans "
                   "together: turn in degrees, shift in the unit of the scans.");
}

void add_scans(HtmlReport& report, const Assembly& assembly) {
  std::vector<std::vector<std::string>> rows;
  for (size_t i = 0; i < assembly.scans.size(); ++i) {
    const auto used =
        std::count_if(assembly.result.pairs.begin(), assembly.result.pairs.end(),
                      [&](const ScanPairResult& pair) {
                        return pair.is_used && (static_cast<size_t>(pair.moving) == i ||
                                                static_cast<size_t>(pair.fixed) == i);
                      });
    const bool is_frame = assembly.result.reference == static_cast<std::int32_t>(i);
    rows.push_back({assembly.names[i], std::to_string(assembly.scans[i].points.rows()),
                    is_frame            ? "the frame"
                    : assembly.poses[i] ? "registered"
                                        : "left out",
                    std::to_string(used)});
  }
  report.add_section("Scans");
  report.add_table({"scan", "points", "place", "used pairs"}, rows,
                   "All scans are in the frame of the first of the largest set that holds "
                   "together.");
  if (assembly.result.reference >= 0) {
    report.add_paragraph(
        fmt::format("Where the scans rest on each other they are {} apart (root "
                    "mean square of all used pairs).",
                    number(assembly.result.rmse * assembly.unit)));
  }
}

std::string verdict(const Assembly& assembly) {
  size_t placed = 0;
  std::string missing;
  for (size_t i = 0; i < assembly.poses.size(); ++i) {
    if (assembly.poses[i]) {
      ++placed;
    } else {
      missing += (missing.empty() ? "" : ", ") + assembly.names[i];
    }
  }
  std::string text = fmt::format("{} of {} scans are in one frame.", placed, assembly.poses.size());
  if (!missing.empty()) text += " No place was found for: " + missing + ".";
  return text;
}

}  // namespace

std::string assembly_page(const Assembly& assembly, const std::string& command,
                          const RunControl& run) {
  HtmlReport report("Scans in one frame", verdict(assembly));
  std::vector<SceneSurface> before;
  std::vector<SceneSurface> after;
  std::vector<ReportColor> colors;
  for (size_t i = 0; i < assembly.scans.size(); ++i) {
    const Rgb color = scan_color(i);
    before.push_back(drawn_scan(assembly.scans[i], assembly.normals[i], Pose(), color));
    colors.push_back(
        legend_of(color, assembly.names[i] + (assembly.poses[i] ? "" : " (left out)")));
    if (!assembly.poses[i]) continue;
    after.push_back(drawn_scan(assembly.scans[i], assembly.normals[i], *assembly.poses[i], color));
  }
  const auto cameras = two_cameras(after.empty() ? before : after);
  report.add_section("Before and after");
  report.add_colors(colors);
  report.add_pictures({embedded(
      overlay_or_row(before, cameras[0], "the scans before", "Before: as the files give them."),
      kWidth, kHeight, run)});
  run.report(0.4);
  if (!after.empty()) {
    report.add_pictures(
        {embedded(overlay_picture(after, cameras[0], "the scans after", "After: in one frame."),
                  kWidth, kHeight, run),
         embedded(overlay_picture(after, cameras[1], "the scans after, from another side",
                                  "After: from another side."),
                  kWidth, kHeight, run)});
  }
  add_scans(report, assembly);
  add_pairs(report, assembly);
  report.add_section("Make this page yourself");
  report.add_commands({command});
  return report.page(fmt::format("Made by dupin {}.", kVersion));
}

}  // namespace dupin::cli
