#include "dupin/warp/warp_render.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/npz.h"
#include "dupin/io/png.h"
#include "warp_input.h"
#include "warp_picture.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

struct RenderRequest {
  std::string project;
  std::string output;
  std::string background;
  std::string map;
  std::string pins_picture;
  std::string method;
  double scale = 1.0;
  bool require_anchored = false;
};

struct Rendered {
  WarpInput input;
  ProjectMesh mesh;
  Deformation deformation;
  WarpPicture picture;
  WarpView view;
  WarningList warnings;
};

// The output is as large as the background, or as the source times the scale.
WarpView view_of(const RenderRequest& request, const Raster& source,
                 const std::optional<LoadedPicture>& background, const Context& context) {
  WarpView view;
  view.target_scale = request.scale;
  const double width = background ? background->raster.width : request.scale * source.width;
  const double height = background ? background->raster.height : request.scale * source.height;
  const auto pixels = [](double side) { return std::max(1.0, std::round(side)); };
  const auto limit = static_cast<double>(context.read.limits.max_image_pixels);
  if (pixels(width) > 32768.0 || pixels(height) > 32768.0 ||
      pixels(width) * pixels(height) > limit) {
    throw Error(Errc::over_limit, "E_IMAGE_TOO_LARGE",
                fmt::format("the output would have {:.0f} x {:.0f} pixels, the limit is {:.0f} and "
                            "32768 a side",
                            width, height, limit),
                {}, "a smaller --scale");
  }
  view.width = static_cast<int>(pixels(width));
  view.height = static_cast<int>(pixels(height));
  return view;
}

void drop_pixels(Raster& raster) {
  raster.rgba8 = {};
  raster.rgba16 = {};
}

Rendered render(Context& context, const RenderRequest& request) {
  Rendered made;
  const RunControl& run = context.run;
  made.input = load_warp(request.project, context, run.stage(0.0, 0.2));
  set_method(made.input.project, request.method);
  require_outputs({request.output, request.map, request.pins_picture},
                  {request.project, made.input.picture.file, request.background});
  made.warnings = made.input.picture.warnings;
  std::optional<LoadedPicture> background;
  if (!request.background.empty()) {
    background = load_picture(request.background, context, run.stage(0.2, 0.3));
    made.warnings.append(background->warnings);
  }
  made.view = view_of(request, made.input.picture.raster, background, context);
  made.mesh = mesh_of(made.input, context, run.stage(0.3, 0.5));
  made.warnings.append(made.mesh.warnings);
  made.deformation = deformation_of(made.input, made.mesh, !request.require_anchored, context,
                                    run.stage(0.5, 0.7));
  made.warnings.append(made.deformation.warnings);
  const PlanarMesh& mesh = made.mesh.meshed.mesh;
  const Deformation& deformation = made.deformation;
  made.picture =
      render_warp(made.input.picture.raster, mesh, deformation.points, deformation.paint_order,
                  made.view, background ? &background->raster : nullptr, run.stage(0.7, 0.9));
  run.throw_if_cancelled();
  WarningList cut;
  warn_of_cut(made.input.project, deformation.points, made.view, cut);
  context.report(request.project, cut);
  made.warnings.append(cut);
  // All work is done before the first output: a run that is stopped leaves none of them. Pixels go
  // as soon as they are packed, for a map takes twice the memory of a picture.
  drop_pixels(made.input.picture.raster);
  std::string pins;
  if (!request.pins_picture.empty()) {
    pins = format_png(pins_picture(made.picture.raster, made.mesh, deformation.points,
                                   made.input.project, made.view.target_scale, run));
  }
  const std::string png = format_png(made.picture.raster);
  drop_pixels(made.picture.raster);
  run.throw_if_cancelled();
  WarpMap map;
  if (!request.map.empty()) {
    map =
        warp_map(mesh, deformation.points, deformation.paint_order, made.view, run.stage(0.9, 1.0));
  }
  begin_outputs(context);
  write_file_atomically(request.output, png);
  if (!request.map.empty()) write_npy(request.map, {map.height, map.width, 2}, map.source_xy);
  if (!pins.empty()) write_file_atomically(request.pins_picture, pins);
  return made;
}

Json stage_json(const WarpStage& stage, const StageReport& report) {
  return {{"mode", stage.mode == StageMode::coarse ? "coarse" : "fine"},
          {"pins", stage.pins.size()},
          {"iterations", report.iterations},
          {"energy", report.energy},
          {"seconds_per_iteration", report.seconds_per_iteration},
          {"seconds_to_prepare", report.seconds_to_prepare},
          {"largest_violation", report.largest_violation_px},
          {"flipped_before_polish", report.flipped_before_polish},
          {"polish_iterations", report.polish_iterations},
          {"unanchored_components", report.still_components}};
}

Json document_of(const RenderRequest& request, const Rendered& made, double seconds) {
  const Deformation& deformation = made.deformation;
  int iterations = 0;
  double iterating = 0.0;
  double energy = 0.0;
  Json stages = Json::array();
  for (std::size_t s = 0; s < deformation.stages.size(); ++s) {
    const StageReport& report = deformation.stages[s];
    iterations += report.iterations;
    iterating += report.iterations * report.seconds_per_iteration;
    if (!report.energy.empty()) energy = report.energy.back();
    stages.push_back(stage_json(made.input.project.stages[s], report));
  }
  const WarpQuality& quality = deformation.quality;
  const Eigen::RowVector2d low = deformation.points.colwise().minCoeff() * request.scale;
  const Eigen::RowVector2d high = deformation.points.colwise().maxCoeff() * request.scale;
  return {{"output", request.output},
          {"width", made.picture.raster.width},
          {"height", made.picture.raster.height},
          {"bit_depth", made.picture.raster.bit_depth},
          {"triangles", quality.num_triangles},
          {"flipped", quality.flipped.size()},
          {"iterations", iterations},
          {"energy", energy},
          {"seconds_per_iteration", iterations > 0 ? iterating / iterations : 0.0},
          {"stages", stages},
          {"smallest_angle", made.mesh.meshed.report.smallest_angle_deg},
          {"stretch",
           {{"min", quality.min_stretch},
            {"max", quality.max_stretch},
            {"mean", quality.mean_stretch}}},
          {"area_change", quality.area_change},
          {"bounds", {{low.x(), low.y()}, {high.x(), high.y()}}},
          {"seconds", seconds},
          {"warnings", to_json(made.warnings)}};
}

void run_render(Context& context, const RenderRequest& request) {
  output_format(context, request.output, "", {"png"});
  if (!request.map.empty()) output_format(context, request.map, "", {"npy"});
  if (!request.pins_picture.empty()) output_format(context, request.pins_picture, "", {"png"});
  for (const std::string& path : {request.map, request.pins_picture}) {
    if (path == "-") throw InvalidArgument("only -o can be standard output");
  }
  require_outputs({request.output, request.map, request.pins_picture}, {request.project});
  const auto start = std::chrono::steady_clock::now();
  Rendered made;
  with_progress(context, "warp render", [&] { made = render(context, request); });
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  context.print_json(document_of(request, made, seconds.count()));
  const WarpQuality& quality = made.deformation.quality;
  context.say(fmt::format(
      "{}: {} x {} px, {} triangles, {} flipped, stretch {:.3f} to {:.3f}, {:.2f} s",
      request.output, made.picture.raster.width, made.picture.raster.height, quality.num_triangles,
      quality.flipped.size(), quality.min_stretch, quality.max_stretch, seconds.count()));
}

}  // namespace

void add_warp_render(CLI::App& warp, Context& context) {
  CLI::App* verb = warp.add_subcommand("render", "The picture as the pins of a project bend it");
  verb->footer(
      "Examples:\n  dupin warp render shirt.dwarp -o worn.png\n"
      "  dupin warp render shirt.dwarp -o worn.png --background mannequin.png --json\n"
      "  dupin warp render shirt.dwarp -o worn.png --map map.npy --pins-picture pins.png");
  add_global_options(*verb, context);
  auto request = std::make_shared<RenderRequest>();
  verb->add_option("PROJECT", request->project, "Project; - reads standard input")->required();
  verb->add_option("-o,--output", request->output,
                   "PNG to write, with the depth and colour profile of the picture")
      ->required();
  verb->add_option("--background", request->background,
                   "PNG behind it, which also gives the size of the output");
  verb->add_option("--map", request->map,
                   "NumPy array to write: for every output pixel the source pixel (x, y)");
  add_method_option(*verb, request->method);
  verb->add_option("--scale", request->scale, "Output pixels per pixel of the project")
      ->check(in_range(1.0 / 64.0, 64.0))
      ->capture_default_str();
  verb->add_option("--pins-picture", request->pins_picture,
                   "PNG to write: the output with mesh and pins");
  verb->add_flag("--require-anchored", request->require_anchored,
                 "A part of the shape without a pin is an error");
  verb->callback([request, &context] { run_render(context, *request); });
}

}  // namespace dupin::cli
