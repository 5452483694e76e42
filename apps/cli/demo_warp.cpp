#include "demo_warp.h"

#include <fmt/format.h>

#include "demo_garments.h"
#include "dupin/io/file.h"
#include "dupin/io/png.h"
#include "dupin/warp/warp_render.h"
#include "warp_input.h"
#include "warp_picture.h"

namespace dupin::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Warped {
  Deformation deformation;
  Raster picture;
};

Warped warped(WarpInput input, WarpMethod method, const ProjectMesh& mesh, Context& context) {
  input.project.deformation.method = method;
  Warped made;
  made.deformation = deformation_of(input, mesh, true, context, context.run);
  made.picture = render_warp(input.picture.raster, mesh.meshed.mesh, made.deformation.points,
                             made.deformation.paint_order, {}, nullptr, context.run)
                     .raster;
  context.run.throw_if_cancelled();
  return made;
}

ReportPicture shown(const fs::path& directory, const std::string& file, const std::string& png,
                    const std::string& caption, const Raster& raster) {
  write_file_atomically((directory / file).string(), png);
  return {file, caption, caption, raster.width, raster.height};
}

Json add_garment(HtmlReport& report, const fs::path& directory, const DemoGarment& garment,
                 Context& context) {
  const std::string image = (directory / (garment.name + ".png")).string();
  const std::string file = (directory / (garment.name + ".dwarp")).string();
  write_png(image, garment.picture);
  WarpInput input;
  input.file = file;
  input.picture = load_picture(image, context, context.run);
  input.project = new_project(input.picture, file);
  input.project.stages.push_back({StageMode::coarse, garment.pins});
  write_file_atomically(file, format_project(input.project));

  const ProjectMesh mesh = mesh_of(input, context, context.run);
  const Warped arap = warped(input, WarpMethod::arap, mesh, context);
  const Warped straight = warped(input, WarpMethod::image_mls, mesh, context);
  const Raster& source = input.picture.raster;
  const Image pins =
      pins_picture(arap.picture, mesh, arap.deformation.points, input.project, 1.0, context.run);
  context.run.throw_if_cancelled();

  report.add_heading(garment.title);
  report.add_pictures(
      {{garment.name + ".png", garment.title + ", before", "Before.", source.width, source.height},
       shown(directory, garment.name + "-mesh.png",
             format_png(mesh_picture(source, mesh, input.project, context.run)),
             fmt::format("Mesh and pins. {}", garment.note), source),
       shown(directory, garment.name + "-pins.png", format_png(pins),
             "The same mesh after; grey dots are where the pins came from.", source),
       shown(directory, garment.name + "-after.png", format_png(arap.picture), "After.", source),
       shown(directory, garment.name + "-straight.png", format_png(straight.picture),
             "The same pins with straight distances, through gaps (image-space moving least "
             "squares).",
             source)});
  const WarpQuality& quality = arap.deformation.quality;
  return {{"name", garment.name},
          {"triangles", quality.num_triangles},
          {"flipped", quality.flipped.size()},
          {"stretch_min", quality.min_stretch},
          {"stretch_max", quality.max_stretch},
          {"straight_flipped", straight.deformation.quality.flipped.size()},
          {"straight_stretch_min", straight.deformation.quality.min_stretch},
          {"straight_stretch_max", straight.deformation.quality.max_stretch}};
}

std::string range(const Json& figures, const std::string& prefix) {
  return fmt::format("{:.2f} to {:.2f}", figures[prefix + "stretch_min"].get<double>(),
                     figures[prefix + "stretch_max"].get<double>());
}

}  // namespace

Json add_warps(HtmlReport& report, const fs::path& directory, Context& context) {
  report.add_section(
      "Warping",
      "Three garments drawn here, cut out by their transparency, meshed, and bent by pins: the "
      "distance between a pin and a place is measured inside the cloth, so that a sleeve moves "
      "without the body beside it.");
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows;
  for (const DemoGarment& garment : demo_garments()) {
    const Json figures = add_garment(report, directory, garment, context);
    rows.push_back({garment.name, figures["triangles"].dump(), figures["flipped"].dump(),
                    range(figures, ""), figures["straight_flipped"].dump(),
                    range(figures, "straight_")});
    all.push_back(figures);
  }
  report.add_table({"garment", "triangles", "flipped", "stretch", "flipped, straight distances",
                    "stretch, straight distances"},
                   rows,
                   "Triangles that fold over, and by what factor lengths change at most: 1 is "
                   "none. Straight distances are for comparison.");
  report.add_heading("Make such pictures yourself");
  const auto file = [&](const char* ending) {
    return shell_quoted((directory / ("shirt" + std::string(ending))).string());
  };
  report.add_commands({fmt::format("dupin warp new {} -o mine.dwarp --density more", file(".png")),
                       fmt::format("dupin warp render {} -o {} --pins-picture {}", file(".dwarp"),
                                   file("-after.png"), file("-pins.png")),
                       fmt::format("dupin warp render {} -o {} --method image-mls", file(".dwarp"),
                                   file("-straight.png"))});
  return all;
}

}  // namespace dupin::cli
