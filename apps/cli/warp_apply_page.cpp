#include <fmt/format.h>

#include <filesystem>
#include <map>

#include "dupin/base/error.h"
#include "dupin/base/version.h"
#include "dupin/io/file.h"
#include "html_report.h"
#include "warp_apply_row.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string number(const Json& value, int digits) {
  return fmt::format("{:.{}f}", value.get<double>(), digits);
}

std::string words(const Json& list) {
  std::string text;
  for (const Json& one : list) text += (text.empty() ? "" : ", ") + one.get<std::string>();
  return text.empty() ? "-" : text;
}

// Folders of the machine that made the page say nothing on another.
std::string name_of(const Json& row) {
  return std::filesystem::path(row.at("image").get<std::string>()).filename().string();
}

// The strip that a row names, inside the page.
ReportPicture strip_of(const ApplyJob& job, const Json& row) {
  ReportPicture picture;
  picture.alt = "before, mesh and pins, after";
  for (const Json& output : row.at("outputs")) {
    const std::string file = output.at("file").get<std::string>();
    if (!file.ends_with(".strip.png")) continue;
    const FileBytes bytes =
        FileBytes::open(job.directory + "/" + file, job.context.read.limits, job.context.run);
    const auto data = bytes.bytes();
    const auto side = [&](std::size_t at) {
      return (data[at] << 24) | (data[at + 1] << 16) | (data[at + 2] << 8) | data[at + 3];
    };
    // Width and height stand at a fixed place of every PNG.
    if (data.size() >= 24) {
      picture.width = side(16);
      picture.height = side(20);
    }
    picture.file = data_uri(std::string(data.begin(), data.end()));
  }
  return picture;
}

void add_pictures_of(HtmlReport& report, const ApplyJob& job, const Json& rows,
                     const std::string& status, const std::string& heading,
                     const std::string& note) {
  bool is_first = true;
  for (const Json& row : rows) {
    if (row.at("status") != status) continue;
    if (is_first) report.add_section(heading, note);
    is_first = false;
    ReportPicture picture = strip_of(job, row);
    picture.caption = fmt::format(
        "{}: match {}, least pin {}, {} flipped, stretch {} to {}, silhouette overlap {}{}",
        name_of(row), number(row.at("match_confidence"), 2), number(row.at("least_confidence"), 2),
        row.at("flipped").get<std::size_t>(), number(row.at("stretch").at("min"), 2),
        number(row.at("stretch").at("max"), 2), number(row.at("silhouette_overlap"), 3),
        row.at("reasons").empty() ? "" : "; look at: " + words(row.at("reasons")));
    report.add_pictures({picture});
  }
}

void add_failures(HtmlReport& report, const Json& rows) {
  std::vector<std::vector<std::string>> failures;
  for (const Json& row : rows) {
    if (row.at("status") != "failed") continue;
    const Json& error = row.at("error");
    failures.push_back({name_of(row), error.at("code").get<std::string>(),
                        error.at("message").get<std::string>()});
  }
  if (failures.empty()) return;
  report.add_section("Failed");
  report.add_table(
      {"picture", "code", "what is wrong"}, failures,
      "Nothing was written for these; what an earlier run made of them may still lie there.");
}

void add_overview(HtmlReport& report, const Json& rows) {
  std::vector<std::vector<std::string>> cells;
  for (const Json& row : rows) {
    std::vector<std::string> line = {name_of(row), row.at("status").get<std::string>(),
                                     words(row.at("reasons"))};
    if (row.at("status") == "failed") {
      line.resize(11, "-");
    } else {
      for (const char* name : {"match_confidence", "least_confidence"})
        line.push_back(number(row.at(name), 3));
      line.push_back(std::to_string(row.at("pins_to_look_at").get<std::size_t>()));
      line.push_back(std::to_string(row.at("flipped").get<std::size_t>()));
      for (const char* name : {"min", "max"}) line.push_back(number(row.at("stretch").at(name), 3));
      line.push_back(number(row.at("area_change"), 3));
      line.push_back(number(row.at("silhouette_overlap"), 3));
    }
    cells.push_back(std::move(line));
  }
  report.add_section("All pictures");
  report.add_table({"picture", "status", "reasons", "match", "least pin", "pins to look at",
                    "flipped", "least stretch", "most stretch", "area change", "overlap"},
                   cells,
                   "match and least pin: confidence, 0 to 1. Stretch: lengths after over before, "
                   "over all triangles. Overlap: intersection over union of the warped shape and "
                   "that of the template.");
}

}  // namespace

std::string apply_page(const ApplyJob& job, const Json& rows, const std::string& command) {
  std::map<std::string, std::size_t> count;
  for (const Json& row : rows) ++count[row.at("status").get<std::string>()];
  HtmlReport report("One pose on a collection",
                    fmt::format("{} pictures: {} good, {} to look at, {} failed.", rows.size(),
                                count["ok"], count["doubtful"], count["failed"]));
  const std::string note = "Before; mesh and pins after; after.";
  const std::vector<ReportColor> colors = {
      {0.10, 0.53, 0.20, "pin at least 0.93 sure"},
      {0.93, 0.60, 0.05, fmt::format("pin at least {:.2f} sure", job.min_confidence)},
      {0.80, 0.08, 0.12, "pin less sure"}};
  report.add_colors(colors);
  add_overview(report, rows);
  add_failures(report, rows);
  add_pictures_of(report, job, rows, "doubtful", "To look at", note);
  add_pictures_of(report, job, rows, "ok", "Good", note);
  report.add_section("Make this page yourself");
  report.add_commands({command});
  return report.page(fmt::format("Made by dupin {}.", kVersion));
}

}  // namespace dupin::cli
