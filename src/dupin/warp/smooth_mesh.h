#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_triangulation.h"

namespace dupin {

/// Largest cotangent of the three angles of abc: falls as the smallest angle grows; HUGE_VAL unless
/// orientation(a, b, c) > 0.
double largest_cotangent(GridPoint a, GridPoint b, GridPoint c);

struct SmoothingCounts {
  std::int64_t num_moves = 0;
  std::int64_t num_refused = 0;  ///< moves that would have lowered an angle, even halved
};

/// Laplacian smoothing: `passes` times, every vertex that `is_free` moves to the mean of its
/// neighbours, or half way, if that does not lower the smallest angle of its star nor bring it into
/// the circle over a border edge; then flips make the star Delaunay again, which never lowers a
/// smallest angle either (Lawson 1977). So afterwards the mesh is constrained Delaunay and its
/// smallest angle not below what it was. Stops early when cancelled, the mesh then as valid.
SmoothingCounts smooth_mesh(PlanarTriangulation& mesh, const std::vector<char>& is_free, int passes,
                            const RunControl& run);

}  // namespace dupin
