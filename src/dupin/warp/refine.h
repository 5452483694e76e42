#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_triangulation.h"

namespace dupin {

/// What the refinement has to know about the border of the mesh.
struct BorderKnowledge {
  /// Per vertex that lies on the border: the segments it is on, equal unless it is a corner of the
  /// outline; kNone inside.
  std::vector<std::int32_t> segment_before, segment_after;
  /// Per vertex: corner of the outline with an inner angle below 60 degrees.
  std::vector<char> is_sharp;
  /// Per segment: its corners.
  std::vector<std::int32_t> from, to;
};

struct RefinementOptions {
  double min_angle_rad = 0.0;
  double min_length = 0.0;  ///< no border edge is split into parts shorter than this [mesh steps]
  std::int64_t max_triangles = 0;
};

struct RefinementCounts {
  std::int64_t num_splits = 0;   ///< points added on the border
  std::int64_t num_steiner = 0;  ///< points added inside
  bool hit_limit = false;        ///< max_triangles reached
};

/// True if the smallest angle of triangle t cannot grow because the outline is sharp there: it lies
/// at a corner below 60 degrees between the two border edges, or its shortest edge spans two
/// segments that meet at such a corner (Miller, Pav and Walkington 2003).
bool is_forced_by_corner(const PlanarTriangulation& mesh, const BorderKnowledge& border,
                         std::int32_t t);

/// Ruppert's refinement of a constrained Delaunay triangulation whose outside is gone: border edges
/// with a visible vertex inside their diametral circle are split, then circumcentres of triangles
/// under the angle are inserted, the worst first; a centre that would encroach upon a border edge
/// or lies beyond one splits that edge instead. Points on the border are grid points exactly on
/// their segment: the middle one, or on a circle of a power of two about a sharp corner. Ends
/// always: no border edge gets shorter than min_length, and a centre is never nearer to a vertex
/// than the shortest edge of its triangle. Vertices are appended; `border` grows with them.
RefinementCounts refine(PlanarTriangulation& mesh, BorderKnowledge& border,
                        const RefinementOptions& options, const RunControl& run);

}  // namespace dupin
