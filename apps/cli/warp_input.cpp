#include "warp_input.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "dupin/base/error.h"
#include "dupin/base/version.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/warp/contour_curvature.h"
#include "dupin/warp/project_stages.h"
#include "dupin/warp/sha256.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

// What `work` returns; its errors name `file`.
template <class Work>
auto naming(const std::string& file, Work&& work) {
  try {
    return work();
  } catch (const Error& error) {
    throw in_file(error, file);
  }
}

// The picture of a project, as its own folder sees it.
std::string picture_file(const std::string& project_file, const WarpProject& project) {
  if (project_file == "-") return project.image.path;
  return (std::filesystem::path(project_file).parent_path() / project.image.path).string();
}

LoadedPicture decode(const FileBytes& file, const std::string& name, Context& context,
                     const RunControl& run) {
  LoadedPicture picture;
  picture.file = name;
  PngFile png = file.judge(name, [&] {
    picture.sha256 = sha256_hex(file.bytes());
    return parse_png(file.bytes(), name, context.read.limits, run);
  });
  picture.raster = std::move(png.raster);
  picture.warnings = std::move(png.warnings);
  context.report(name, picture.warnings);
  return picture;
}

}  // namespace

std::string whole_path(const std::string& path) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  if (error) return path;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(absolute, error);
  return error ? path : whole.string();
}

namespace {

bool is_same_file(const std::string& a, const std::string& b) {
  if (a == b) return true;
  std::error_code error;
  if (std::filesystem::equivalent(a, b, error) && !error) return true;
  // Files that are not there yet.
  return whole_path(a) == whole_path(b);
}

}  // namespace

LoadedPicture load_picture(const std::string& file, Context& context, const RunControl& run) {
  return naming(file, [&] {
    const FileBytes bytes = FileBytes::open(file, context.read.limits, run);
    return decode(bytes, file, context, run);
  });
}

std::string read_text(const std::string& file, Context& context) {
  const FileBytes bytes = FileBytes::open(file, context.read.limits, context.run);
  return bytes.judge(file, [&] { return std::string(bytes.bytes().begin(), bytes.bytes().end()); });
}

WarpProject load_project(const std::string& file, Context& context) {
  return naming(file, [&] {
    const std::string text = read_text(file, context);
    if (text.starts_with("\x89PNG")) {
      throw IoError(Errc::malformed, "E_MAGIC", "a PNG picture, not a project", {file},
                    "dupin warp new makes a project of a picture");
    }
    return parse_project(text);
  });
}

WarpInput load_warp(const std::string& file, Context& context, const RunControl& run) {
  WarpInput input;
  input.file = file;
  input.project = load_project(file, context);
  context.input = file;
  const std::string picture = picture_file(file, input.project);
  input.picture = naming(picture, [&] {
    const FileBytes bytes = FileBytes::open(picture, context.read.limits, run);
    bytes.judge(picture, [&] {
      require_image(input.project, bytes.bytes());
      return 0;
    });
    return decode(bytes, picture, context, run);
  });
  const WarpImage& image = input.project.image;
  const Raster& raster = input.picture.raster;
  if (raster.width != image.width || raster.height != image.height) {
    throw in_file(
        AnalysisError("E_IMAGE_CHANGED",
                      fmt::format("the picture has {} x {} pixels, the project says {} x {}",
                                  raster.width, raster.height, image.width, image.height),
                      "correct image.width and image.height of the project"),
        picture);
  }
  return input;
}

bool is_png_file(const std::string& file, const Context& context) {
  const FileBytes bytes = FileBytes::open(file, context.read.limits, context.run);
  return bytes.judge(file, [&] { return is_png(bytes.bytes()); });
}

std::string picture_path(const std::string& picture_file, const std::string& project_file) {
  std::filesystem::path folder = std::filesystem::path(project_file).parent_path();
  if (folder.empty() || project_file == "-") folder = ".";
  std::error_code error;
  const std::filesystem::path relative = std::filesystem::relative(picture_file, folder, error);
  const std::string path = error ? picture_file : relative.generic_string();
  // "a:b" would be a path of another system.
  return path.find(':') == 1 ? "./" + path : path;
}

void warn_of_cut(const WarpProject& project, const Points2& points, const WarpView& view,
                 WarningList& warnings) {
  const double margin = (project.contour.expansion + 1.0) * view.target_scale;
  Eigen::Index first = -1;
  Eigen::Index count = 0;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const Eigen::RowVector2d place = view.target_scale * points.row(v);
    if (place.x() >= -margin && place.y() >= -margin && place.x() <= view.width + margin &&
        place.y() <= view.height + margin)
      continue;
    if (count++ == 0) first = v;
  }
  if (count == 0) return;
  warnings.add(
      "W_CUT_OFF",
      fmt::format("vertex {} at ({:.1f}, {:.1f})", first, view.target_scale * points(first, 0),
                  view.target_scale * points(first, 1)),
      "vertices outside the picture: that part of the shape is not drawn", count);
}

WarpProject new_project(const LoadedPicture& picture, const std::string& project_file) {
  if (picture.file == "-")
    throw InvalidArgument("a project needs a picture in a file", "save it first");
  WarpProject project;
  project.program = kVersion;
  project.image.path = picture_path(picture.file, project_file);
  project.image.sha256 = picture.sha256;
  project.image.width = picture.raster.width;
  project.image.height = picture.raster.height;
  naming(picture.file, [&] {
    validate(project);
    return 0;
  });
  return project;
}

ProjectMesh mesh_of(const WarpInput& input, Context& context, const RunControl& run) {
  ProjectMesh mesh = naming(
      input.file, [&] { return make_project_mesh(input.project, input.picture.raster, run); });
  context.run.throw_if_cancelled();
  context.report(input.file, mesh.warnings);
  return mesh;
}

Deformation deformation_of(const WarpInput& input, const ProjectMesh& mesh,
                           bool is_unanchored_allowed, Context& context, const RunControl& run) {
  DeformOptions options = deform_options_of(input.project);
  options.warp.is_unanchored_allowed = is_unanchored_allowed;
  Deformation deformation = naming(input.file, [&] {
    const std::vector<DeformStage> stages = stages_of(input.project, mesh.anchors);
    require_tables(mesh.meshed.mesh, stages);
    return deform(mesh.meshed.mesh, stages, options, run);
  });
  context.run.throw_if_cancelled();
  deformation.warnings.append(ignored_pins(input.project));
  context.report(input.file, deformation.warnings);
  return deformation;
}

void require_outputs(const std::vector<std::string>& outputs,
                     const std::vector<std::string>& inputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const std::string& path = outputs[i];
    if (path.empty()) continue;
    for (std::size_t k = 0; k < i; ++k) {
      if (!outputs[k].empty() && is_same_file(path, outputs[k]))
        throw InvalidArgument("two outputs are one file: " + escaped(path),
                              "give each a name of its own");
    }
    for (const std::string& input : inputs) {
      if (path != "-" && !input.empty() && is_same_file(path, input))
        throw InvalidArgument("the output " + escaped(path) + " is an input",
                              "give it a name of its own");
    }
    if (path != "-") require_writable(path);
  }
}

void add_method_option(CLI::App& verb, std::string& method) {
  verb.add_option("--method", method,
                  "arap; mls: moving least squares alone; image-mls: the same through gaps")
      ->check(CLI::IsMember({"arap", "mls", "image-mls"}));
}

void set_method(WarpProject& project, const std::string& method) {
  if (method == "arap") project.deformation.method = WarpMethod::arap;
  if (method == "mls") project.deformation.method = WarpMethod::mls;
  if (method == "image-mls") project.deformation.method = WarpMethod::image_mls;
}

double contour_length(const Outline& outline) {
  double length = 0.0;
  for (const Points2& loop : outline.loops) length += loop_length(loop);
  return length;
}

std::vector<WarpPin> all_pins(const WarpProject& project) {
  std::vector<WarpPin> pins;
  for (const WarpStage& stage : project.stages)
    pins.insert(pins.end(), stage.pins.begin(), stage.pins.end());
  return pins;
}

Json shape_json(const WarpInput& input, const ProjectMesh& mesh) {
  const Raster& raster = input.picture.raster;
  const MeshingReport& report = mesh.meshed.report;
  return {{"image",
           {{"file", input.picture.file},
            {"width", raster.width},
            {"height", raster.height},
            {"bit_depth", raster.bit_depth},
            {"sha256", input.picture.sha256}}},
          {"components", mesh.shape.part_areas.size()},
          {"component_areas", mesh.shape.part_areas},
          {"components_left_out",
           {{"count", mesh.shape.num_left_out}, {"area", mesh.shape.left_out_area}}},
          {"holes", mesh.shape.num_holes},
          {"area", signed_area(mesh.outline)},
          {"contour_length", contour_length(mesh.outline)},
          {"vertices", mesh.meshed.mesh.points.rows()},
          {"triangles", mesh.meshed.mesh.triangles.rows()},
          {"spacing", mesh.spacing_px},
          {"smallest_angle", report.smallest_angle_deg},
          {"mean_smallest_angle", report.mean_smallest_angle_deg},
          {"small_angles",
           {{"count", report.num_below},
            {"at_corners", report.below_at_corners},
            {"at_pins", report.below_at_fixed_points},
            {"in_narrows", report.below_in_narrows},
            {"otherwise", report.below_otherwise}}}};
}

void say_shape(const Context& context, const WarpInput& input, const ProjectMesh& mesh) {
  const Raster& raster = input.picture.raster;
  const MeshingReport& report = mesh.meshed.report;
  context.say(fmt::format(
      "{} x {} px, {} bits; {} component{} kept, {} left out; {} hole{}; contour {:.6g} px",
      raster.width, raster.height, raster.bit_depth, mesh.shape.part_areas.size(),
      mesh.shape.part_areas.size() == 1 ? "" : "s", mesh.shape.num_left_out, mesh.shape.num_holes,
      mesh.shape.num_holes == 1 ? "" : "s", contour_length(mesh.outline)));
  context.say(
      fmt::format("{} triangles of {:.3g} px, smallest angle {:.1f} degrees, {} under the limit",
                  mesh.meshed.mesh.triangles.rows(), mesh.spacing_px, report.smallest_angle_deg,
                  report.num_below));
}

}  // namespace dupin::cli
