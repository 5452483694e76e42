#include "dupin/warp/project_mesh.h"

#include <algorithm>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/project_stages.h"

namespace dupin {
namespace {

using Eigen::Index;

// Places that the deformation holds at rest: the pins of the first stage that does anything.
Points2 pins_at_rest(const WarpProject& project) {
  const std::vector<DeformStage> stages = stages_of(project);
  const auto first = std::find_if(stages.begin(), stages.end(),
                                  [](const DeformStage& stage) { return !stage.pins.empty(); });
  Points2 places;
  if (first == stages.end() || first->mode != DeformMode::coarse) return places;
  places.resize(static_cast<Index>(first->pins.size()), 2);
  for (Index i = 0; i < places.rows(); ++i)
    places.row(i) = first->pins[static_cast<std::size_t>(i)].source.transpose();
  return places;
}

// A vertex as a place that moves with its triangle.
std::vector<std::optional<MeshPoint>> anchors_at(const TriangulatedOutline& meshed) {
  std::vector<std::optional<MeshPoint>> corner_of(
      static_cast<std::size_t>(meshed.mesh.points.rows()));
  for (Index f = meshed.mesh.triangles.rows() - 1; f >= 0; --f) {
    for (Index k = 0; k < 3; ++k) {
      corner_of[static_cast<std::size_t>(meshed.mesh.triangles(f, k))] =
          MeshPoint{static_cast<std::int32_t>(f), Eigen::Vector3d::Unit(k)};
    }
  }
  std::vector<std::optional<MeshPoint>> anchors;
  for (const std::int32_t vertex : meshed.fixed_vertex) {
    anchors.push_back(vertex < 0 ? std::nullopt : corner_of[static_cast<std::size_t>(vertex)]);
  }
  return anchors;
}

}  // namespace

ShapeOptions shape_options_of(const WarpProject& project) {
  const ContourSettings& contour = project.contour;
  ShapeOptions options;
  options.alpha_threshold = contour.alpha_threshold;
  options.parts = contour.all_components ? ShapeParts::all : ShapeParts::largest;
  options.keep_holes = contour.keep_holes;
  options.expansion_px = contour.expansion;
  options.minimum_area = contour.minimum_area;
  options.minimum_hole_area = contour.minimum_area;
  return options;
}

ExteriorPointOptions exterior_options_of(const WarpProject& project) {
  ExteriorPointOptions options;
  options.detail = project.contour.detail;
  options.prominence = project.contour.prominence;
  options.separation = project.contour.separation;
  // Eight samples to a standard deviation of the kernel.
  const double wanted = std::clamp(8.0 * options.detail, 512.0, 65536.0);
  options.num_samples = static_cast<Index>(wanted);
  return options;
}

ImageShape outline_of(const WarpProject& project, const Raster& image, RunControl run) {
  if (project.contour.source == ContourSource::polyline)
    return outline_from_polylines(project.contour.loops, std::move(run));
  return shape_from_image(image, shape_options_of(project), std::move(run));
}

double spacing_for(double area, double num_triangles) {
  const double of_one = std::sqrt(3.0) / 4.0;  // area of a triangle of side 1
  return std::clamp(std::sqrt(area / (of_one * num_triangles)), 0.5, 16384.0);
}

ProjectMesh make_project_mesh(const WarpProject& project, const Raster& image, RunControl run) {
  ProjectMesh result;
  const auto is_done = [&](Status status) {
    if (status != Status::cancelled) return false;
    result = {};
    result.status = Status::cancelled;
    return true;
  };
  result.shape = outline_of(project, image, run.stage(0.0, 0.4));
  if (is_done(result.shape.status)) return result;
  result.warnings = result.shape.warnings;
  result.spacing_px = project.mesh.spacing > 0.0
                          ? project.mesh.spacing
                          : spacing_for(signed_area(result.shape.outline), project.mesh.triangles);
  OutlineOptions preparing;
  preparing.spacing_px = result.spacing_px;
  PreparedOutline prepared = prepare_outline(result.shape.outline, preparing, run.stage(0.4, 0.5));
  if (is_done(prepared.status)) return result;
  result.warnings.append(prepared.warnings);
  result.outline = std::move(prepared.outline);
  MeshingOptions meshing;
  meshing.spacing_px = result.spacing_px;
  meshing.min_angle_deg = project.mesh.min_angle;
  meshing.smoothing_passes = project.mesh.smoothing;
  result.meshed =
      triangulate_outline(result.outline, pins_at_rest(project), meshing, run.stage(0.5, 1.0));
  if (is_done(result.meshed.status)) return result;
  if (result.meshed.status == Status::not_converged) {
    throw Error(Errc::over_limit, "E_TOO_LARGE",
                "more than " + std::to_string(meshing.max_triangles) + " triangles", {},
                "a wider mesh.spacing");
  }
  result.anchors = anchors_at(result.meshed);
  run.report(1.0);
  return result;
}

}  // namespace dupin
