#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/warp/exterior_frames.h"
#include "surface_input.h"
#include "warp_input.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

struct NewRequest {
  std::string image;
  std::string output;
  std::string contour;
  std::string pins;
  std::string density = "normal";
  std::string method;
  ContourSettings settings;
  bool no_holes = false;
};

// fewer, normal, more, or a number of triangles.
int triangles_of(const std::string& density) {
  if (density == "fewer") return 600;
  if (density == "normal") return MeshSettings{}.triangles;
  if (density == "more") return 10000;
  return std::stoi(density);
}

CLI::Validator is_density() {
  return CLI::Validator(
      [](const std::string& text) {
        int value = 0;
        if (text == "fewer" || text == "normal" || text == "more") return std::string();
        if (CLI::detail::lexical_cast(text, value) && value >= 16 && value <= 2000000)
          return std::string();
        return fmt::format("{} is not fewer, normal, more or a number of triangles, 16 to 2000000",
                           escaped(text, 40));
      },
      "fewer|normal|more|N", "DENSITY");
}

template <class Parse>
auto parse_file(const std::string& file, Context& context, Parse&& parse) {
  try {
    return parse(read_text(file, context));
  } catch (const Error& error) {
    throw in_file(error, file);
  }
}

// Interior pins move the shape first, exterior ones refine what they left (7.4.4). The sources of
// the latter are still those of the picture.
std::vector<WarpStage> stages_with(const std::vector<WarpPin>& pins) {
  std::vector<WarpStage> stages;
  for (const auto& [kind, mode] : {std::pair(PinKind::interior, StageMode::coarse),
                                   std::pair(PinKind::exterior, StageMode::fine)}) {
    WarpStage stage;
    stage.mode = mode;
    std::copy_if(pins.begin(), pins.end(), std::back_inserter(stage.pins),
                 [kind = kind](const WarpPin& pin) { return pin.kind == kind; });
    if (!stage.pins.empty()) stages.push_back(std::move(stage));
  }
  return stages;
}

WarpProject project_of(const NewRequest& request, const LoadedPicture& picture, Context& context) {
  WarpProject project = new_project(picture, request.output);
  project.contour = request.settings;
  project.contour.keep_holes = !request.no_holes;
  if (!request.contour.empty()) {
    project.contour.source = ContourSource::polyline;
    project.contour.loops = parse_file(request.contour, context, parse_loops);
  }
  project.mesh.triangles = triangles_of(request.density);
  set_method(project, request.method);
  if (!request.pins.empty())
    project.stages = stages_with(parse_file(request.pins, context, parse_pins));
  return project;
}

// Where the exterior pins are after the stage before has moved the shape under them (7.3.5).
void carry_exterior(WarpProject& project, const ProjectMesh& mesh, const Points2& moved) {
  if (project.stages.size() < 2) return;
  for (WarpPin& pin : project.stages.back().pins) {
    const ExteriorFrame frame = attach_exterior(mesh.meshed.mesh.points, pin.source.transpose());
    pin.source = place_exterior(moved, frame).transpose();
  }
}

// The deformation by the stages of the input; with two of them the second is carried along.
// Pins that cannot move the shape are told now, not when the picture is made.
Deformation try_stages(WarpInput& input, const ProjectMesh& mesh, Context& context,
                       const RunControl& run) {
  if (input.project.stages.size() < 2) return deformation_of(input, mesh, true, context, run);
  WarpInput first = input;
  first.project.stages.pop_back();
  const Deformation moved = deformation_of(first, mesh, true, context, run.stage(0.0, 0.5));
  carry_exterior(input.project, mesh, moved.points);
  return deformation_of(input, mesh, true, context, run.stage(0.5, 1.0));
}

void run_new(Context& context, const NewRequest& request) {
  output_format(context, request.output, "", {"dwarp"});
  require_outputs({request.output}, {request.image, request.contour, request.pins});
  WarpInput input;
  ProjectMesh mesh;
  WarningList warnings;
  with_progress(context, "warp new", [&] {
    context.input = request.image;
    input.picture = load_picture(request.image, context, context.run.stage(0.0, 0.4));
    input.file = request.image;
    input.project = project_of(request, input.picture, context);
    if (!request.contour.empty()) input.file = request.contour;
    mesh = mesh_of(input, context, context.run.stage(0.4, 0.7));
    if (!request.pins.empty()) input.file = request.pins;
    const Deformation deformation = try_stages(input, mesh, context, context.run.stage(0.7, 1.0));
    warnings = input.picture.warnings;
    warnings.append(mesh.warnings);
    warnings.append(deformation.warnings);
    const std::string text = format_project(input.project);
    context.run.throw_if_cancelled();
    write_file_atomically(request.output, text);
  });
  const std::vector<WarpPin> pins = all_pins(input.project);
  Json document{{"project", request.output}};
  document.update(shape_json(input, mesh));
  document["pins"] = pins.size();
  document["warnings"] = to_json(warnings);
  context.print_json(document);
  say_shape(context, input, mesh);
  context.say(fmt::format("{}: {} pins", request.output, pins.size()));
}

}  // namespace

void add_warp_new(CLI::App& warp, Context& context) {
  CLI::App* verb = warp.add_subcommand("new", "A project that bends the cut-out in a picture");
  verb->footer(
      "Examples:\n  dupin warp new shirt.png -o shirt.dwarp\n"
      "  dupin warp new shirt.png -o shirt.dwarp --pins pins.json --density more --json\n\n"
      "PINS.json: [{\"source\": [x, y], \"target\": [x, y], \"name\": \"hem\", \"rotation\": 30}], "
      "pixels, x right, y down.");
  add_global_options(*verb, context);
  auto request = std::make_shared<NewRequest>();
  ContourSettings& settings = request->settings;
  verb->add_option("IMAGE", request->image, "PNG whose background is transparent")->required();
  verb->add_option("-o,--output", request->output, "Project to write: .dwarp")->required();
  CLI::Option* contour =
      verb->add_option("--contour", request->contour,
                       "Shape drawn by hand: JSON list of loops [[[x, y], ...], ...]");
  verb->add_option("--density", request->density,
                   "Triangles: fewer (600), normal (2500), more (10000), or a number")
      ->check(is_density())
      ->capture_default_str();
  verb->add_option("--pins", request->pins, "Control points, JSON");
  const auto of_alpha = [&](CLI::Option* option) { option->excludes(contour); };
  of_alpha(verb->add_option("--expansion", settings.expansion,
                            "Moves the contour outward, so that soft edges lie inside [px]")
               ->check(in_range(0.0, 256.0))
               ->capture_default_str());
  of_alpha(verb->add_option("--alpha-threshold", settings.alpha_threshold,
                            "Inside is where alpha is above this")
               ->check(in_range(0.0, 0.999999))
               ->capture_default_str());
  of_alpha(verb->add_flag("--all-components", settings.all_components,
                          "Every part of the picture, not the largest alone"));
  of_alpha(verb->add_flag("--no-holes", request->no_holes, "Close holes"));
  add_method_option(*verb, request->method);
  verb->callback([request, &context] { run_new(context, *request); });
}

}  // namespace dupin::cli
