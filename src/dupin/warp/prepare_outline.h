#pragma once

#include <cstdint>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// Options of prepare_outline().
struct OutlineOptions {
  double spacing_px = 20.0;        ///< of the mesh to come; edges get .9 of it; in [0.5, 16384]
  double tolerance_px = 0.5;       ///< of the simplification and again of the sampling, in [0, 64]
  double corner_angle_deg = 30.0;  ///< corners that turn by more are kept, in [0, 180]
};

/// An outline ready for triangulate_outline().
struct PreparedOutline {
  Status status = Status::ok;  ///< cancelled: no outline
  Outline outline;             ///< loops in the order of the raw ones; corners on the 2^-8 px grid
  /// W_OUTLINE_DROPPED: loops without area; W_OUTLINE_REPAIRED: edges that met after simplification
  /// and were drawn closer to the raw outline; W_OUTLINE_PULLED: corners on one place, pulled apart
  WarningList warnings;
};

/// Makes an outline simple, evenly sampled and of grid points: Douglas and Peucker's
/// simplification, corners kept, edges of about .9 spacing between them, shorter where the outline
/// bends, so that no raw corner is farther than 2 tolerance_px (and 1/256 px) from the result.
/// Loops that meet by that are drawn again with less tolerance, there only, in the end corner by
/// corner as they came. Corners that share a place (pixels that touch) are pulled apart by a
/// quarter of a pixel at most. A raw outline that is simple once rounded to 1/256 px is always
/// accepted.
///
/// @throws InvalidArgument  options out of range, a coordinate that is not finite, sizes that
/// differ
/// @throws AnalysisError E_OUTLINE_CROSSED  the raw outline crosses or touches itself: names loops,
///   edges and place
/// @throws AnalysisError E_EMPTY_SHAPE  no loop has an area
/// @throws Error(Errc::over_limit) E_TOO_LARGE  an extent over 32,768 px
/// Cost: O(n log n) for n corners. Sources: thesis 7.4.1; Douglas and Peucker 1973.
PreparedOutline prepare_outline(const Outline& raw, const OutlineOptions& options = {},
                                RunControl run = {});

}  // namespace dupin
