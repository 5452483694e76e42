#include "warp_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "dupin/io/png.h"
#include "dupin/render/color_map.h"
#include "dupin/render/text.h"
#include "html_report.h"
#include "warp_input.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

// Told apart on garments of any colour: the picture behind is faded.
const Rgb kMeshColor(0.16, 0.35, 0.62);
const Rgb kOutlineColor(0.05, 0.15, 0.35);
const Rgb kInteriorColor(0.84, 0.19, 0.12);
const Rgb kExteriorColor(0.95, 0.55, 0.05);
const Rgb kSourceColor(0.25, 0.25, 0.25);

constexpr double kFading = 0.5;  // share of white

Image faded(const Raster& picture) {
  Image image = to_image(picture);
  for (std::size_t i = 0; i < image.rgba.size(); i += 4) {
    const double ink = (1.0 - kFading) * image.rgba[i + 3] / 255.0;
    for (std::size_t k = 0; k < 3; ++k) {
      image.rgba[i + k] =
          static_cast<std::uint8_t>(std::lround(255.0 + ink * (image.rgba[i + k] - 255.0)));
    }
    image.rgba[i + 3] = 255;
  }
  return image;
}

// Thin lines of a picture of this size [px].
double line_width(int width, int height) {
  return std::clamp(std::max(width, height) / 1000.0, 0.8, 8.0);
}

void draw_loops(Image& image, const Outline& outline, double width, const RunControl& run) {
  for (const Points2& loop : outline.loops) {
    for (Index i = 0; i < loop.rows() && !run.cancelled(); ++i) {
      draw_stroke(image, loop.row(i).transpose(), loop.row((i + 1) % loop.rows()).transpose(),
                  width, kOutlineColor);
    }
  }
}

void draw_dot(Image& image, const Vector2d& place, double diameter, const Rgb& color) {
  draw_stroke(image, place, place, diameter + 0.4 * diameter, Rgb(1.0, 1.0, 1.0));
  draw_stroke(image, place, place, diameter, color);
}

// Dark on a white edge: to be read over lines.
void draw_name(Image& image, const std::string& name, const Vector2d& place, double size) {
  for (const bool is_edge : {true, false}) {
    TextStyle style;
    style.size_px = size;
    style.is_bold = is_edge;
    style.color = is_edge ? Rgb(1.0, 1.0, 1.0) : kSourceColor;
    for (const double shift : {-0.06, 0.06}) {
      draw_text(image, name, place.x() + (is_edge ? shift * size : 0.0), place.y(), TextAlign::left,
                style);
    }
  }
}

void draw_mesh(Image& image, const ProjectMesh& mesh, const Points2& points, double scale,
               double width, const RunControl& run) {
  const auto draw = [&](std::int32_t a, std::int32_t b, double line, const Rgb& color) {
    draw_stroke(image, scale * points.row(a).transpose(), scale * points.row(b).transpose(), line,
                color);
  };
  const Triangles& triangles = mesh.meshed.mesh.triangles;
  for (Index f = 0; f < triangles.rows() && !run.cancelled(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t a = triangles(f, k);
      const std::int32_t b = triangles(f, (k + 1) % 3);
      if (a < b) draw(a, b, 0.7 * width, kMeshColor);
    }
  }
  for (const BorderEdge& edge : mesh.meshed.border) {
    if (run.cancelled()) return;
    draw(edge.from, edge.to, 1.5 * width, kOutlineColor);
  }
}

const Rgb& color_of(const WarpPin& pin) {
  return pin.kind == PinKind::interior ? kInteriorColor : kExteriorColor;
}

std::string hex(const Rgb& color) {
  const auto byte = [](double x) { return static_cast<int>(std::lround(255.0 * x)); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(color.x()), byte(color.y()), byte(color.z()));
}

std::string svg_head(const Raster& picture) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
      "{1}\">\n",
      picture.width, picture.height);
}

std::string svg_dot(const Eigen::RowVector2d& place, double radius, const Rgb& color) {
  return fmt::format(
      "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"{}\"/>\n",
      place.x(), place.y(), radius, hex(color), 0.4 * radius);
}

}  // namespace

Image outline_picture(const Raster& picture, const Outline& outline,
                      const std::vector<LoopPoints>& exterior, const RunControl& run) {
  Image image = faded(picture);
  const double width = line_width(image.width, image.height);
  draw_loops(image, outline, 1.5 * width, run);
  for (const LoopPoints& loop : exterior) {
    for (const ExteriorPoint& point : loop.found.points)
      draw_dot(image, point.position.transpose(), 7.0 * width, kExteriorColor);
  }
  return image;
}

std::string outline_svg(const Raster& picture, const Outline& outline,
                        const std::vector<LoopPoints>& exterior) {
  const double width = line_width(picture.width, picture.height);
  std::string svg = svg_head(picture);
  for (std::size_t l = 0; l < outline.loops.size();) {
    svg += "<path fill=\"none\" fill-rule=\"evenodd\" stroke=\"" + hex(kOutlineColor) +
           fmt::format("\" stroke-width=\"{}\" d=\"", width);
    const std::int32_t component = outline.component[l];
    for (; l < outline.loops.size() && outline.component[l] == component; ++l) {
      const Points2& loop = outline.loops[l];
      for (Index i = 0; i < loop.rows(); ++i)
        svg += fmt::format("{}{} {}", i == 0 ? "M" : " L", loop(i, 0), loop(i, 1));
      svg += " Z ";
    }
    svg.back() = '"';
    svg += "/>\n";
  }
  for (const LoopPoints& loop : exterior) {
    for (const ExteriorPoint& point : loop.found.points)
      svg += svg_dot(point.position, 3.5 * width, kExteriorColor);
  }
  return svg + "</svg>\n";
}

Image pins_picture(const Raster& picture, const ProjectMesh& mesh, const Points2& points,
                   const WarpProject& project, double scale, const RunControl& run) {
  Image image = faded(picture);
  const double width = line_width(image.width, image.height);
  draw_mesh(image, mesh, points, scale, width, run);
  const std::vector<WarpPin> pins = all_pins(project);
  for (const WarpPin& pin : pins) {
    if (run.cancelled()) return image;
    const Vector2d source = scale * pin.source.transpose();
    draw_stroke(image, source, scale * pin.target.transpose(), 1.5 * width, kSourceColor);
    draw_dot(image, source, 4.0 * width, kSourceColor);
  }
  for (const WarpPin& pin : pins) {
    if (run.cancelled()) return image;
    const Vector2d target = scale * pin.target.transpose();
    draw_dot(image, target, 8.0 * width, color_of(pin));
    if (pin.name.empty()) continue;
    draw_name(image, pin.name, target + Vector2d(8.0, -5.0) * width, 18.0 * width);
  }
  return image;
}

Image mesh_picture(const Raster& picture, const ProjectMesh& mesh, const WarpProject& project,
                   const RunControl& run) {
  WarpProject at_rest = project;
  for (WarpStage& stage : at_rest.stages) {
    for (WarpPin& pin : stage.pins) pin.target = pin.source;
  }
  return pins_picture(picture, mesh, mesh.meshed.mesh.points, at_rest, 1.0, run);
}

std::string mesh_svg(const Raster& picture, const ProjectMesh& mesh, const WarpProject& project) {
  const double width = line_width(picture.width, picture.height);
  std::string svg = svg_head(picture);
  svg +=
      fmt::format("<image width=\"{}\" height=\"{}\" opacity=\"{}\" href=\"{}\"/>\n", picture.width,
                  picture.height, 1.0 - kFading, data_uri(format_png(with_bit_depth(picture, 8))));
  svg += "<path fill=\"none\" stroke-linejoin=\"round\" stroke=\"" + hex(kMeshColor) +
         fmt::format("\" stroke-width=\"{}\" d=\"", 0.7 * width);
  const PlanarMesh& planar = mesh.meshed.mesh;
  for (Index f = 0; f < planar.triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const auto p = planar.points.row(planar.triangles(f, k));
      svg += fmt::format("{}{} {}", k == 0 ? "M" : "L", p.x(), p.y());
    }
    svg += "Z";
  }
  svg += "\"/>\n";
  for (const WarpPin& pin : all_pins(project))
    svg += svg_dot(pin.source, 4.0 * width, color_of(pin));
  return svg + "</svg>\n";
}

}  // namespace dupin::cli
