#include "warp_apply_row.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/render/color_map.h"
#include "dupin/render/text.h"
#include "dupin/warp/project_stages.h"
#include "dupin/warp/sha256.h"
#include "dupin/warp/warp_render.h"
#include "surface_input.h"
#include "warp_input.h"
#include "warp_picture.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kCell = 320;  // px, of a picture of a strip

const Rgb kSure(0.10, 0.53, 0.20);
const Rgb kLookAt(0.93, 0.60, 0.05);
const Rgb kDoubtful(0.80, 0.08, 0.12);

std::string in_folder(const ApplyJob& job, const std::string& name) {
  return (std::filesystem::path(job.directory) / name).string();
}

std::string digest_of(const ApplyJob& job, const std::string& file) {
  const FileBytes bytes = FileBytes::open(file, job.context.read.limits, job.context.run);
  return bytes.judge(file, [&] { return sha256_hex(bytes.bytes()); });
}

std::string digest_of(Json row) {
  row.erase("digest");
  row.erase("reused");
  return sha256_hex(to_text(row));
}

// The row of an earlier run still holds: the same inputs, and the outputs as it left them.
// @throws AnalysisError E_OUTPUT_CHANGED if somebody has worked on its project since
bool is_current(const ApplyJob& job, const Json& row, const std::string& inputs) {
  if (row.is_null() || row.at("status") == "failed") return false;
  bool is_same = row.at("inputs") == inputs;
  for (const Json& output : row.at("outputs")) {
    const std::string name = output.at("file").get<std::string>();
    try {
      if (digest_of(job, in_folder(job, name)) == output.at("sha256")) continue;
    } catch (const IoError&) {
      is_same = false;
      continue;
    }
    is_same = false;
    if (name != outputs_of(row.at("image").get<std::string>()).project) continue;
    throw in_file(AnalysisError("E_OUTPUT_CHANGED", "the project was changed since it was made",
                                "keep it under another name, or remove it to have it made anew"),
                  in_folder(job, name));
  }
  return is_same;
}

// Outputs that lie there all the same when a picture fails: of an earlier run.
Json stale_outputs(const ApplyJob& job, const std::string& image) {
  Json found = Json::array();
  const ApplyOutputs names = outputs_of(image);
  for (const std::string& name : {names.project, names.picture, names.strip}) {
    std::error_code error;
    if (std::filesystem::is_regular_file(in_folder(job, name), error)) found.push_back(name);
  }
  return found;
}

// A project with the settings of the template. A contour drawn by hand is that of its own picture.
WarpProject target_project(const ApplyJob& job, const LoadedPicture& picture) {
  WarpProject project = new_project(picture, in_folder(job, outputs_of(picture.file).project));
  const WarpProject& from = job.pose.project;
  project.contour = from.contour;
  if (project.contour.source == ContourSource::polyline) {
    project.contour.source = ContourSource::alpha;
    project.contour.loops.clear();
  }
  project.mesh = from.mesh;
  project.deformation = from.deformation;
  return project;
}

// Absolute targets are places of the picture that the template was made in.
WarpView view_of(const ApplyJob& job, const Raster& raster) {
  WarpView view;
  const bool is_absolute = job.options.rule == TargetRule::absolute;
  view.width = is_absolute ? job.pose.project.image.width : raster.width;
  view.height = is_absolute ? job.pose.project.image.height : raster.height;
  return view;
}

const Rgb& color_of(const ApplyJob& job, double confidence) {
  if (confidence >= kSureConfidence) return kSure;
  return confidence >= job.min_confidence ? kLookAt : kDoubtful;
}

void paste(Image& strip, const Image& cell, int left) {
  for (int y = 0; y < cell.height; ++y) {
    for (int x = 0; x < cell.width; ++x) {
      const auto at = [](const Image& image, int px, int py) {
        return 4 * (static_cast<std::size_t>(py) * static_cast<std::size_t>(image.width) +
                    static_cast<std::size_t>(px));
      };
      const std::uint8_t* from = cell.rgba.data() + at(cell, x, y);
      std::uint8_t* to = strip.rgba.data() + at(strip, left + x, y);
      const double share = from[3] / 255.0;
      for (int k = 0; k < 3; ++k)
        to[k] = static_cast<std::uint8_t>(std::lround((1.0 - share) * to[k] + share * from[k]));
    }
  }
}

// Before; mesh and pins in the colours of their confidence; after: side by side, small.
Image strip_of(const ApplyJob& job, const Raster& raster, const AppliedTemplate& applied,
               const RunControl& run) {
  const PlanarMesh& mesh = applied.mesh.meshed.mesh;
  const Deformation& moved = applied.deformation;
  const auto small = [](WarpView view) {
    view.target_scale =
        std::min(1.0, static_cast<double>(kCell) / std::max(view.width, view.height));
    view.width = std::max(1, static_cast<int>(std::lround(view.width * view.target_scale)));
    view.height = std::max(1, static_cast<int>(std::lround(view.height * view.target_scale)));
    return view;
  };
  WarpView at_rest;
  at_rest.width = raster.width;
  at_rest.height = raster.height;
  const WarpView view = small(view_of(job, raster));
  const WarpPicture before =
      render_warp(raster, mesh, mesh.points, {}, small(at_rest), nullptr, run);
  const WarpPicture after =
      render_warp(raster, mesh, moved.points, moved.paint_order, view, nullptr, run);
  run.throw_if_cancelled();
  const double scale = view.target_scale;
  Image pins = pins_picture(after.raster, applied.mesh, moved.points, applied.project, scale, run);
  for (std::size_t s = 0; s < applied.pins.size(); ++s) {
    for (std::size_t m = 0; m < applied.pins[s].size(); ++m) {
      const Eigen::Vector2d place = scale * applied.project.stages[s].pins[m].target.transpose();
      draw_stroke(pins, place, place, 9.0, color_of(job, applied.pins[s][m].confidence));
    }
  }
  const Image cells[] = {to_image(before.raster), std::move(pins), to_image(after.raster)};
  int width = 0;
  int height = 0;
  for (const Image& cell : cells) {
    width += cell.width;
    height = std::max(height, cell.height);
  }
  Image strip = make_image(width, height, 255, 255, 255, 255);
  int left = 0;
  for (const Image& cell : cells) {
    paste(strip, cell, left);
    left += cell.width;
  }
  return strip;
}

Json pins_json(const AppliedTemplate& applied) {
  Json pins = Json::array();
  for (std::size_t s = 0; s < applied.pins.size(); ++s) {
    for (std::size_t m = 0; m < applied.pins[s].size(); ++m) {
      const WarpPin& pin = applied.project.stages[s].pins[m];
      pins.push_back({{"stage", s},
                      {"name", pin.name},
                      {"source", {pin.source.x(), pin.source.y()}},
                      {"target", {pin.target.x(), pin.target.y()}},
                      {"confidence", applied.pins[s][m].confidence},
                      {"moved", applied.pins[s][m].moved_px}});
    }
  }
  return pins;
}

// Why a picture wants to be looked at; empty if it does not.
Json reasons_of(const ApplyJob& job, const AppliedTemplate& applied, double least,
                const WarningList& warnings) {
  Json reasons = Json::array();
  if (applied.match_confidence < job.min_confidence) reasons.push_back("match");
  if (least < job.min_confidence) reasons.push_back("pins");
  if (!applied.deformation.quality.flipped.empty()) reasons.push_back("flipped");
  for (const Warning& warning : warnings.all()) {
    if (warning.code == "W_CUT_OFF") reasons.push_back("cut off");
  }
  if (applied.status == Status::not_converged) reasons.push_back("not converged");
  return reasons;
}

void fill_row(Json& row, const ApplyJob& job, const AppliedTemplate& applied,
              const WarningList& warnings) {
  double least = 1.0;
  std::size_t num_unsure = 0;
  for (const auto& stage : applied.pins) {
    for (const AppliedPin& pin : stage) {
      least = std::min(least, pin.confidence);
      num_unsure += pin.confidence < kSureConfidence ? 1 : 0;
    }
  }
  const WarpQuality& quality = applied.deformation.quality;
  const Json reasons = reasons_of(job, applied, least, warnings);
  row["status"] = reasons.empty() ? "ok" : "doubtful";
  row["reasons"] = reasons;
  row["match_confidence"] = applied.match_confidence;
  row["least_confidence"] = least;
  row["pins_to_look_at"] = num_unsure;
  row["triangles"] = quality.num_triangles;
  row["flipped"] = quality.flipped.size();
  row["stretch"] = {
      {"min", quality.min_stretch}, {"max", quality.max_stretch}, {"mean", quality.mean_stretch}};
  row["area_change"] = quality.area_change;
  row["silhouette_overlap"] = applied.overlap.iou;
  row["pins"] = pins_json(applied);
  row["warnings"] = to_json(warnings);
}

void require_no_warning(const ApplyJob& job, const std::string& image,
                        const WarningList& warnings) {
  if (!job.context.strict || warnings.empty()) return;
  const Warning& first = warnings.all().front();
  throw IoError(Errc::malformed, first.code, first.message + " (" + first.first + ")",
                {image, 0, -1}, "--strict turns every warning into an error");
}

Json make_row(const ApplyJob& job, const std::string& image, const Json& before,
              const RunControl& run) {
  LoadedPicture picture;
  picture.file = image;
  const FileBytes bytes = FileBytes::open(image, job.context.read.limits, run);
  bytes.judge(image, [&] {
    picture.sha256 = sha256_hex(bytes.bytes());
    return 0;
  });
  const ApplyOutputs names = outputs_of(image);
  const std::string inputs = sha256_hex(job.template_digest + picture.sha256 +
                                        picture_path(image, in_folder(job, names.project)));
  if (is_current(job, before, inputs)) {
    Json row = before;
    row["reused"] = true;
    return row;
  }
  PngFile png = bytes.judge(
      image, [&] { return parse_png(bytes.bytes(), image, job.context.read.limits, run); });
  picture.raster = std::move(png.raster);
  const AppliedTemplate applied = apply_template(job.pose, target_project(job, picture),
                                                 picture.raster, job.options, run.stage(0.1, 0.7));
  run.throw_if_cancelled();
  WarningList warnings = png.warnings;
  warnings.append(applied.warnings);
  warnings.append(ignored_pins(applied.project));
  const Deformation& moved = applied.deformation;
  warn_of_cut(applied.project, moved.points, view_of(job, picture.raster), warnings);
  require_no_warning(job, image, warnings);
  const WarpPicture warped =
      render_warp(picture.raster, applied.mesh.meshed.mesh, moved.points, moved.paint_order,
                  view_of(job, picture.raster), nullptr, run.stage(0.7, 0.9));
  run.throw_if_cancelled();
  std::vector<std::pair<std::string, std::string>> outputs = {
      {names.project, format_project(applied.project)}, {names.picture, format_png(warped.raster)}};
  if (job.has_page)
    outputs.emplace_back(names.strip, format_png(strip_of(job, picture.raster, applied, run)));
  run.throw_if_cancelled();
  for (const auto& output : outputs) require_writable(in_folder(job, output.first));
  Json row{{"image", image}};
  fill_row(row, job, applied, warnings);
  row["outputs"] = Json::array();
  for (const auto& [name, text] : outputs) {
    write_file_atomically(in_folder(job, name), text);
    row["outputs"].push_back({{"file", name}, {"sha256", sha256_hex(text)}});
  }
  row["inputs"] = inputs;
  row["reused"] = false;
  row["error"] = nullptr;
  row["digest"] = digest_of(row);
  return row;
}

}  // namespace

bool is_intact(const Json& row) {
  return row.is_object() && row.value("digest", Json()) == Json(digest_of(row));
}

ApplyOutputs outputs_of(const std::string& image) {
  const std::string stem = std::filesystem::path(image).stem().string();
  return {stem + ".dwarp", stem + ".png", stem + ".strip.png"};
}

Json apply_row(const ApplyJob& job, const std::string& image, const Json& before,
               const RunControl& run) {
  try {
    return make_row(job, image, before, run);
  } catch (const Error& error) {
    if (error.errc() == Errc::interrupted) throw;
    const Error placed = in_file(error, image);
    Json row{{"image", image}, {"status", "failed"}, {"reasons", {error.code()}}};
    row["outputs"] = Json::array();
    row["stale"] = stale_outputs(job, image);
    row["reused"] = false;
    row["error"] = to_json(placed);
    row["digest"] = digest_of(row);
    return row;
  }
}

}  // namespace dupin::cli
