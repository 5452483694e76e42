#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/warp/apply_template.h"
#include "dupin/warp/pin_transfer.h"
#include "dupin/warp/project_stages.h"
#include "dupin/warp/silhouette_fit.h"
#include "surface_input.h"
#include "warp_input.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

struct FitRequest {
  std::string project;
  std::string silhouette;
  std::string output;
  SilhouetteFitOptions options;
  double min_confidence = 0.5;  // of the match as a whole
  double min_overlap = 0.95;    // with the silhouette, in the end
};

struct Fitted {
  WarpInput input;
  ProjectMesh mesh;
  SilhouetteFit fit;
  Deformation deformation;  // with the new stage
  double iou_before = 0.0;
  double iou_after = 0.0;
  WarningList warnings;
};

const Points2& largest_loop(const Outline& outline) {
  return *std::max_element(
      outline.loops.begin(), outline.loops.end(),
      [](const Points2& a, const Points2& b) { return signed_area(a) < signed_area(b); });
}

// The silhouette as the project finds shapes: the same threshold and the same margin about it.
Outline silhouette_of(const FitRequest& request, const WarpProject& project, Context& context,
                      WarningList& warnings, const RunControl& run) {
  const LoadedPicture picture = load_picture(request.silhouette, context, run.stage(0.0, 0.5));
  warnings.append(picture.warnings);
  ImageShape shape;
  try {
    shape = shape_from_image(picture.raster, shape_options_of(project), run.stage(0.5, 1.0));
  } catch (const Error& error) {
    throw in_file(error, request.silhouette);
  }
  run.throw_if_cancelled();
  context.report(request.silhouette, shape.warnings);
  warnings.append(shape.warnings);
  return shape.outline;
}

Fitted fit(Context& context, const FitRequest& request) {
  const RunControl& run = context.run;
  Fitted made;
  made.input = load_warp(request.project, context, run.stage(0.0, 0.1));
  require_outputs({request.output}, {request.project, request.silhouette, made.input.picture.file});
  WarpProject& project = made.input.project;
  made.warnings = made.input.picture.warnings;
  const Outline silhouette =
      silhouette_of(request, project, context, made.warnings, run.stage(0.1, 0.2));
  const Points2& target = largest_loop(silhouette);
  made.mesh = mesh_of(made.input, context, run.stage(0.2, 0.4));
  made.warnings.append(made.mesh.warnings);
  const Deformation before =
      deformation_of(made.input, made.mesh, true, context, run.stage(0.4, 0.5));
  run.throw_if_cancelled();
  const Points2 source = largest_loop(border_outline(made.mesh, before.points));
  SilhouetteFitOptions options = request.options;
  options.exterior = exterior_options_of(project);
  try {
    made.fit = fit_silhouette(source, target, options, run.stage(0.5, 0.7));
  } catch (const Error& error) {
    throw in_file(error, request.silhouette);
  }
  run.throw_if_cancelled();
  WarpStage stage;
  stage.mode = StageMode::fine;
  stage.pins = made.fit.pins;
  project.stages.push_back(std::move(stage));
  made.deformation = deformation_of(made.input, made.mesh, true, context, run.stage(0.7, 1.0));
  made.warnings.append(made.deformation.warnings);
  made.iou_before = made.fit.before.iou;
  made.iou_after =
      compute_overlap(largest_loop(border_outline(made.mesh, made.deformation.points)), target).iou;
  project.image.path = picture_path(made.input.picture.file, request.output);
  const std::string text = format_project(project);
  run.throw_if_cancelled();
  write_file_atomically(request.output, text);
  return made;
}

// Shapes of two kinds match as well, and then either the match or what it leads to is poor.
bool is_accepted(const FitRequest& request, const Fitted& made) {
  return made.fit.match.confidence >= request.min_confidence &&
         made.iou_after >= request.min_overlap;
}

Json document_of(const FitRequest& request, const Fitted& made) {
  Json pins = Json::array();
  Index num_doubtful = 0;
  for (std::size_t k = 0; k < made.fit.pins.size(); ++k) {
    const WarpPin& pin = made.fit.pins[k];
    const double confidence = made.fit.confidence(static_cast<Index>(k));
    num_doubtful += confidence < kSureConfidence ? 1 : 0;
    pins.push_back({{"source", {pin.source.x(), pin.source.y()}},
                    {"target", {pin.target.x(), pin.target.y()}},
                    {"confidence", confidence}});
  }
  const WarpQuality& quality = made.deformation.quality;
  return {{"project", request.output},
          {"accepted", is_accepted(request, made)},
          {"iou_before", made.iou_before},
          {"iou_contour", made.fit.fitted.iou},
          {"iou_after", made.iou_after},
          {"confidence", made.fit.match.confidence},
          {"doubtful_pins", num_doubtful},
          {"flipped", quality.flipped.size()},
          {"stretch",
           {{"min", quality.min_stretch},
            {"max", quality.max_stretch},
            {"mean", quality.mean_stretch}}},
          {"pins", pins},
          {"warnings", to_json(made.warnings)}};
}

void run_fit(Context& context, const FitRequest& request) {
  output_format(context, request.output, "", {"dwarp"});
  require_outputs({request.output}, {request.project, request.silhouette});
  Fitted made;
  with_progress(context, "warp fit", [&] { made = fit(context, request); });
  const bool is_good = is_accepted(request, made);
  if (!is_good) context.exit_code = static_cast<int>(Errc::negative);
  context.print_json(document_of(request, made));
  context.say(fmt::format("{}: {} pins, overlap {:.3f} -> {:.3f}, {} flipped, confidence {:.2f}{}",
                          request.output, made.fit.pins.size(), made.iou_before, made.iou_after,
                          made.deformation.quality.flipped.size(), made.fit.match.confidence,
                          is_good ? "" : ": too low, look at it"));
}

}  // namespace

void add_warp_fit(CLI::App& warp, Context& context) {
  CLI::App* verb = warp.add_subcommand("fit", "Pull the shape of a project to a silhouette");
  verb->footer(
      "Examples:\n  dupin warp fit shirt.dwarp --silhouette mannequin.png -o fitted.dwarp\n"
      "  dupin warp fit shirt.dwarp --silhouette mannequin.png -o fitted.dwarp --json\n\n"
      "Adds a fine stage. Exit code 1: the contours do not tell how they belong together, or the "
      "silhouette was not reached; the best guess is written.");
  add_global_options(*verb, context);
  auto request = std::make_shared<FitRequest>();
  verb->add_option("PROJECT", request->project, "Project; - reads standard input")->required();
  verb->add_option("--silhouette", request->silhouette, "PNG whose transparency is the silhouette")
      ->required();
  verb->add_option("-o,--output", request->output, "Project to write: .dwarp")->required();
  verb->add_option("--tolerance", request->options.tolerance,
                   "How far the contour between two pins may stay away, as a share of the height")
      ->check(in_range(1e-4, 1.0))
      ->capture_default_str();
  verb->add_option("--min-confidence", request->min_confidence,
                   "Least confidence of the match that is accepted")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  verb->add_option("--min-overlap", request->min_overlap,
                   "Least overlap with the silhouette (intersection over union) that is accepted")
      ->check(in_range(0.0, 1.0))
      ->capture_default_str();
  verb->callback([request, &context] { run_fit(context, *request); });
}

}  // namespace dupin::cli
