#include <fmt/format.h>

#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "warp_input.h"
#include "warp_picture.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Json = nlohmann::ordered_json;

struct ContourRequest {
  std::string input;
  std::string output;
  std::string format;
};

Json place_json(const Eigen::RowVector2d& place) { return {place.x(), place.y()}; }

Json loop_json(const Points2& loop) {
  Json corners = Json::array();
  for (Index i = 0; i < loop.rows(); ++i) corners.push_back(place_json(loop.row(i)));
  return corners;
}

// Loops alone: what dupin warp new --contour reads. One loop a line.
std::string loops_text(const Outline& outline) {
  std::string text = "[";
  for (std::size_t l = 0; l < outline.loops.size(); ++l)
    text += (l > 0 ? ",\n " : "\n ") + loop_json(outline.loops[l]).dump();
  return text + "\n]\n";
}

Json exterior_json(const std::vector<LoopPoints>& exterior) {
  Json list = Json::array();
  for (const LoopPoints& loop : exterior) {
    for (const ExteriorPoint& point : loop.found.points) {
      list.push_back({{"loop", loop.loop},
                      {"position", place_json(point.position)},
                      {"arc", point.arc},
                      {"curvature", point.curvature},
                      {"prominence", point.prominence}});
    }
  }
  return list;
}

std::vector<LoopPoints> exterior_points(const WarpProject& project, const Outline& outline,
                                        const RunControl& run) {
  std::vector<LoopPoints> exterior;
  const ExteriorPointOptions options = exterior_options_of(project);
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    run.throw_if_cancelled();
    exterior.push_back({l, find_exterior_points(outline.loops[l], options)});
  }
  return exterior;
}

void write_contour(const std::string& path, const std::string& format, const Raster& picture,
                   const Outline& outline, const std::vector<LoopPoints>& exterior,
                   const RunControl& run) {
  if (format == "json") write_file_atomically(path, loops_text(outline));
  if (format == "svg") write_file_atomically(path, outline_svg(picture, outline, exterior));
  if (format == "png") {
    const Image image = outline_picture(picture, outline, exterior, run);
    run.throw_if_cancelled();
    write_png(path, image);
  }
}

// A project, or a picture as a project with the default settings has it.
WarpInput load(const std::string& file, Context& context, const RunControl& run) {
  if (file == "-" || !is_png_file(file, context)) return load_warp(file, context, run);
  WarpInput input;
  input.file = file;
  input.picture = load_picture(file, context, run);
  return input;
}

void run_contour(Context& context, const ContourRequest& request) {
  std::string format;
  if (!request.output.empty()) {
    format = output_format(context, request.output, request.format, {"json", "svg", "png"});
    require_outputs({request.output}, {request.input});
  }
  WarpInput input;
  ProjectMesh mesh;
  std::vector<LoopPoints> exterior;
  with_progress(context, "warp contour", [&] {
    context.input = request.input;
    input = load(request.input, context, context.run.stage(0.0, 0.3));
    require_outputs({request.output}, {input.picture.file});
    mesh = mesh_of(input, context, context.run.stage(0.3, 0.8));
    exterior = exterior_points(input.project, mesh.outline, context.run);
    if (!request.output.empty())
      write_contour(request.output, format, input.picture.raster, mesh.outline, exterior,
                    context.run);
  });
  WarningList warnings = input.picture.warnings;
  warnings.append(mesh.warnings);
  Json loops = Json::array();
  for (std::size_t l = 0; l < mesh.outline.loops.size(); ++l) {
    const Points2& loop = mesh.outline.loops[l];
    loops.push_back({{"component", mesh.outline.component[l]},
                     {"hole", signed_area(loop) < 0.0},
                     {"corners", loop.rows()},
                     {"area", signed_area(loop)},
                     {"length", exterior[l].found.length}});
  }
  Json document{{"loops", loops}, {"exterior_points", exterior_json(exterior)}};
  document.update(shape_json(input, mesh));
  document["warnings"] = to_json(warnings);
  context.print_json(document);
  say_shape(context, input, mesh);
  context.say(fmt::format("{} loops, {} exterior points", loops.size(),
                          document["exterior_points"].size()));
}

}  // namespace

void add_warp_contour(CLI::App& warp, Context& context) {
  CLI::App* verb =
      warp.add_subcommand("contour", "The outline of a cut-out, and where it bends the most");
  verb->footer(
      "Examples:\n  dupin warp contour shirt.png --json\n"
      "  dupin warp contour shirt.dwarp -o loops.json\n"
      "  dupin warp contour shirt.dwarp -o contour.png");
  add_global_options(*verb, context);
  auto request = std::make_shared<ContourRequest>();
  verb->add_option("INPUT", request->input, "Project, or PNG for the default settings")->required();
  verb->add_option("-o,--output", request->output,
                   "Loops (.json), which dupin warp new --contour reads; or a picture: .svg, .png");
  verb->add_option("--format", request->format, "Format of standard output, for -o -")
      ->check(CLI::IsMember({"json", "svg", "png"}));
  verb->callback([request, &context] { run_contour(context, *request); });
}

}  // namespace dupin::cli
