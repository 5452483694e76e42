#include <fmt/format.h>

#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/io/surface_io.h"
#include "warp_input.h"
#include "warp_picture.h"
#include "warp_verb.h"

namespace dupin::cli {
namespace {

using Json = nlohmann::ordered_json;

struct MeshRequest {
  std::string project;
  std::string output;
  std::string format;
};

// In the plane z = 0, in pixels, y down.
SurfaceOutput to_surface(const PlanarMesh& mesh) {
  SurfaceOutput surface;
  surface.points.setZero(mesh.points.rows(), 3);
  surface.points.leftCols(2) = mesh.points;
  surface.triangles = mesh.triangles;
  return surface;
}

void write_mesh(const std::string& path, const std::string& format, const WarpInput& input,
                const ProjectMesh& mesh, const RunControl& run) {
  if (format == "png") {
    const Image image = mesh_picture(input.picture.raster, mesh, input.project, run);
    run.throw_if_cancelled();
    write_png(path, image);
  } else if (format == "svg") {
    write_file_atomically(path, mesh_svg(input.picture.raster, mesh, input.project));
  } else {
    const SurfaceFormat kind = surface_format_of("mesh." + format);
    write_surface(path, to_surface(mesh.meshed.mesh), kind);
  }
}

void run_mesh(Context& context, const MeshRequest& request) {
  const std::string format =
      output_format(context, request.output, request.format, {"obj", "ply", "off", "png", "svg"});
  require_outputs({request.output}, {request.project});
  WarpInput input;
  ProjectMesh mesh;
  with_progress(context, "warp mesh", [&] {
    input = load_warp(request.project, context, context.run.stage(0.0, 0.3));
    require_outputs({request.output}, {input.picture.file});
    mesh = mesh_of(input, context, context.run.stage(0.3, 0.9));
    write_mesh(request.output, format, input, mesh, context.run);
  });
  WarningList warnings = input.picture.warnings;
  warnings.append(mesh.warnings);
  Json document{{"output", request.output}};
  document.update(shape_json(input, mesh));
  document["pins"] = all_pins(input.project).size();
  document["warnings"] = to_json(warnings);
  context.print_json(document);
  say_shape(context, input, mesh);
}

}  // namespace

void add_warp_mesh(CLI::App& warp, Context& context) {
  CLI::App* verb = warp.add_subcommand("mesh", "The triangles that a project moves");
  verb->footer(
      "Examples:\n  dupin warp mesh shirt.dwarp -o mesh.png\n"
      "  dupin warp mesh shirt.dwarp -o mesh.obj --json\n\n"
      "OBJ, PLY and OFF lie in z = 0, in pixels, y down.");
  add_global_options(*verb, context);
  auto request = std::make_shared<MeshRequest>();
  verb->add_option("PROJECT", request->project, "Project; - reads standard input")->required();
  verb->add_option("-o,--output", request->output,
                   "Mesh to write: .obj, .ply, .off; or a picture of it: .png, .svg")
      ->required();
  verb->add_option("--format", request->format, "Format of standard output, for -o -")
      ->check(CLI::IsMember({"obj", "ply", "off", "png", "svg"}));
  verb->callback([request, &context] { run_mesh(context, *request); });
}

}  // namespace dupin::cli
