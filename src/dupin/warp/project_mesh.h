#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/image/raster.h"
#include "dupin/warp/exterior_points.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/project.h"
#include "dupin/warp/shape_from_image.h"
#include "dupin/warp/triangulate_outline.h"

namespace dupin {

/// How the settings of a project find the shape in its picture.
ShapeOptions shape_options_of(const WarpProject& project);

/// How the settings of a project find exterior points on a loop, with enough samples for `detail`.
ExteriorPointOptions exterior_options_of(const WarpProject& project);

/// The contour of a project: from the transparency of `image`, or the polylines it holds.
/// @throws as shape_from_image(), or outline_from_polylines()
ImageShape outline_of(const WarpProject& project, const Raster& image, RunControl run = {});

/// Spacing of the lattice that fills `area` [px^2] with about `num_triangles` equilateral
/// triangles, in [0.5, 16384] [px]. Narrow shapes get more triangles than that.
double spacing_for(double area, double num_triangles);

/// What warping moves, from the picture to the mesh.
struct ProjectMesh {
  Status status = Status::ok;  ///< cancelled: nothing is valid
  ImageShape shape;            ///< the contour as it was found
  Outline outline;             ///< as meshed
  double spacing_px = 0.0;
  TriangulatedOutline meshed;
  /// Where the pins of the first stage of stages_of() are, if that is a coarse one: they are
  /// vertices. Empty for pins outside.
  std::vector<std::optional<MeshPoint>> anchors;
  WarningList warnings;  ///< of the contour and of the outline
};

/// The mesh of a project: the same for every pose of the pins, but for their sources at rest.
/// @throws as outline_of(), prepare_outline() and triangulate_outline(); Error(Errc::over_limit)
///   E_TOO_LARGE for a mesh of more than 2 million triangles
/// Cost: O(pixels + n log n).
ProjectMesh make_project_mesh(const WarpProject& project, const Raster& image, RunControl run = {});

}  // namespace dupin
