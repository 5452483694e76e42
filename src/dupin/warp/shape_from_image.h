#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/image/raster.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

enum class ShapeParts { largest, all };

/// How the border between inside and outside pixels becomes a polyline.
enum class ContourKind {
  sub_pixel,    ///< marching squares: one corner where alpha passes the threshold
  pixel_edges,  ///< along the edges of the pixels: the area is the number of pixels
};

/// Options of shape_from_image().
struct ShapeOptions {
  /// Inside is alpha > threshold, in [0, 1): 0.5 is where a soft edge is half covered. 0 is the
  /// rule of the thesis (7.4.1), which takes in the faintest shadow.
  double alpha_threshold = 0.5;
  ShapeParts parts = ShapeParts::largest;
  bool keep_holes = true;
  ContourKind contour = ContourKind::sub_pixel;
  /// The outline is moved outward by this, in [0, 256] [px], so that the soft fringe of the picture
  /// lies inside it. Parts that meet become one.
  double expansion_px = 0.0;
  double minimum_area = 16.0;       ///< smaller parts are left out, >= 1 [px^2]
  double minimum_hole_area = 16.0;  ///< smaller holes are closed, >= 1 [px^2]
  bool opaque_is_shape = false;     ///< a picture without transparency is a rectangle, no error
  bool keep_outline = true;  ///< false: numbers and areas only; a noisy picture has 16 bytes of
                             ///< outline a pixel
};

/// The shape that the alpha channel shows.
struct ImageShape {
  Status status = Status::ok;  ///< cancelled: the outline is empty
  /// Outer loops positive, holes negative, each hole after the outer loop of its part. Parts are
  /// numbered by falling area, and by their first pixel where areas are equal.
  Outline outline;
  double area = 0.0;               ///< enclosed by the loops, holes taken off [px^2]
  std::vector<double> part_areas;  ///< of the parts of the outline, in pixels less their holes
  std::int64_t num_left_out = 0;   ///< parts that are not in the outline, specks too
  double left_out_area = 0.0;      ///< of those, in pixels
  std::int64_t num_parts = 0;      ///< 4-connected parts of the picture of minimum_area or more
  std::int64_t num_holes = 0;      ///< in the outline
  WarningList warnings;            ///< W_COMPONENTS, W_SPECK, W_HOLE_CLOSED, W_NONMANIFOLD_VERTEX,
                                   ///< W_THIN_SHAPE
};

/// The outline of the inside of a picture, in pixels of the picture.
///
/// Inside pixels are connected through their sides, outside pixels also through their corners. What
/// lies beyond the picture is outside, so transparent borders change nothing but the origin, bit
/// for bit: coordinates are multiples of 2^-16.
///
/// Loops of sub_pixel are simple and disjoint. Where alpha is 0 or 1 everywhere and nothing is left
/// out or expanded, they enclose N - (P - Q) / 2 pixels for N inside pixels, P parts and Q holes.
/// Loops of pixel_edges enclose exactly N; they touch, without crossing, at the corners that
/// W_NONMANIFOLD_VERTEX counts. An expanded outline is exact to about half a pixel.
///
/// @throws InvalidArgument as validate(image), or for an option outside its range
/// @throws AnalysisError E_NO_ALPHA (every pixel is opaque), E_EMPTY_SHAPE (none is inside),
///   E_SHAPE_TOO_SMALL (no part of minimum_area)
/// Cost: O(pixels) time; memory for 4 bytes a run of pixels, a bit or two a pixel and the outline,
/// 10 bytes a pixel of the box of the shape more with expansion. Source: thesis 7.4.1.
ImageShape shape_from_image(const Raster& image, const ShapeOptions& options = {},
                            RunControl run = {});

/// An outline drawn by hand, and how it was mended.
struct PolylineOutline {
  Outline outline;                   ///< one loop, positive
  std::vector<Eigen::Index> corner;  ///< of each corner of the loop: its row in the input
  WarningList warnings;              ///< W_REPEATED_POINT, W_ORIENTATION_FIXED
};

/// The shape that closed polylines enclose: loops inside no other or in a hole are outer ones,
/// loops inside an outer one are holes. Outer loops come as they are given, each with its holes
/// after it. What outline_from_polyline() says of one holds for each of `loops`.
/// @throws as outline_from_polyline(), naming loops; InvalidArgument without a loop
/// Cost: O(n log n + pairs of edges that overlap in x, or in y if those are fewer + loops n).
ImageShape outline_from_polylines(const std::vector<Points2>& loops, RunControl run = {});

/// The closed polyline through `corners` (#corners by 2 [px]) as an outline. Coordinates are
/// rounded to multiples of 2^-16, on which all tests are exact. Repeated points are dropped, and
/// the loop is turned to be positive.
/// @throws InvalidArgument for coordinates that are not finite or beyond 2^20
/// @throws AnalysisError E_SHAPE_TOO_SMALL (no area), E_OUTLINE_CROSSED naming the two edges that
///   cross, touch or overlap, and the place
/// Cost: O(n log n + pairs of edges whose boxes overlap in x).
PolylineOutline outline_from_polyline(const Points2& corners);

}  // namespace dupin
