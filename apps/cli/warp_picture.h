#pragma once

#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/image/image.h"
#include "dupin/image/raster.h"
#include "dupin/warp/exterior_points.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/project.h"
#include "dupin/warp/project_mesh.h"

namespace dupin::cli {

/// Exterior points of one loop of an outline.
struct LoopPoints {
  std::size_t loop = 0;
  ExteriorPoints found;
};

/// The picture, faded, with its outline and exterior points.
Image outline_picture(const Raster& picture, const Outline& outline,
                      const std::vector<LoopPoints>& exterior, const RunControl& run);
/// The same as SVG, without the picture; one path a component.
std::string outline_svg(const Raster& picture, const Outline& outline,
                        const std::vector<LoopPoints>& exterior);

/// The picture, faded, with the mesh whose vertices are at `points` times `scale`, and the pins of
/// the project: a line from the source to a dot at the target, with its name.
Image pins_picture(const Raster& picture, const ProjectMesh& mesh, const Points2& points,
                   const WarpProject& project, double scale, const RunControl& run);
/// The mesh at rest and the sources of the pins over the picture, which is inside the SVG.
std::string mesh_svg(const Raster& picture, const ProjectMesh& mesh, const WarpProject& project);

/// The mesh at rest and the sources of the pins over the picture.
Image mesh_picture(const Raster& picture, const ProjectMesh& mesh, const WarpProject& project,
                   const RunControl& run);

}  // namespace dupin::cli
