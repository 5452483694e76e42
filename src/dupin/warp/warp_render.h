#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/image/raster.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// Where the pixels of the output lie, and what is behind the garment.
struct WarpView {
  int width = 0;              ///< of the output [px]; 0: that of the background, or of the source
  int height = 0;             ///< the same
  double source_scale = 1.0;  ///< source pixels per unit of the mesh, > 0
  double target_scale = 1.0;  ///< output pixels per unit of the target points, > 0
  /// Upper left corner of the output in units of the target points.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  /// Triangles that the warp turned over show their back; false leaves holes instead.
  bool draw_flipped = true;
};

/// A warped picture.
struct WarpPicture {
  Status status = Status::ok;       ///< cancelled: the raster is empty
  Raster raster;                    ///< depth and colour space of the source
  Eigen::Index num_flipped = 0;     ///< triangles of the target with a negative area
  Eigen::Index num_degenerate = 0;  ///< triangles that cover nothing
};

/// Where each output pixel comes from.
struct WarpMap {
  Status status = Status::ok;  ///< cancelled: the map is empty
  int width = 0;               ///< [px]
  int height = 0;              ///< [px]
  /// height by width by 2, row-major: x and y in source pixels, centres at .5, of the frontmost
  /// triangle at the centre of the pixel; NaN where there is none.
  std::vector<float> source_xy;
};

/// Paints `source` as the mesh carries it from mesh.points to `target`, triangle after triangle,
/// each over those before it.
///
/// - Each pixel centre belongs to exactly one of two neighbouring triangles (edges on a grid of
///   1/256 px, top and left ones inclusive): no seams, nothing painted twice, and no smoothing of
///   edges. Let the mesh reach beyond the soft fringe (ShapeOptions::expansion_px): then alpha of
///   the source draws the silhouette.
/// - Pixels are read by Catmull-Rom interpolation, whose kernel is widened by the factor by which
///   the triangle shrinks, so that fine stripes grey out instead of aliasing. Beyond 32 times
///   the kernel grows no more.
/// - Colours are weighted by alpha; beyond the source everything is transparent. No conversion of
///   colours.
/// - Where `target` is mesh.points moved by whole pixels, pixels are copied bit for bit, also the
///   colour of transparent ones.
///
/// Same input, same bits for any number of threads.
/// @param target #V by 2
/// @param draw_order a permutation of the triangles, back to front; empty: by number
/// @param background of the size of the output, converted to the depth of the source; null:
///   transparent
/// @throws InvalidArgument as validate(), for a size, scale, order or coordinate out of range
///   (2^20 px)
/// Cost: O(output pixels + covered pixels of all triangles + source pixels of shrunk ones); memory
/// for the output, and 256 bytes a column for each thread.
/// Source: thesis 7.1 and 7.3.4.
WarpPicture render_warp(const Raster& source, const PlanarMesh& mesh, const Points2& target,
                        const std::vector<std::int32_t>& draw_order = {}, const WarpView& view = {},
                        const Raster* background = nullptr, RunControl run = {});

/// The map that render_warp() reads the source by, for an output of view.width by view.height, both
/// given. @throws InvalidArgument as render_warp()
/// Cost: O(output pixels + covered pixels of all triangles), 8 bytes a pixel.
WarpMap warp_map(const PlanarMesh& mesh, const Points2& target,
                 const std::vector<std::int32_t>& draw_order, const WarpView& view,
                 RunControl run = {});

}  // namespace dupin
