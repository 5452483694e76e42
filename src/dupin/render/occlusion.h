#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/mesh/mesh.h"

namespace dupin::detail {

/// Share of the sky over each vertex that the surface leaves free, weighted by the cosine to the
/// normal, in [0, 1]: 1 on convex bodies. `points` must lie in the unit ball; `normals` are unit or
/// zero (zero: 1). Visibility is read from depth maps along 24 fixed axes and then averaged
/// once with the neighbours, so it does not depend on the view.
///
/// Cost: O(24 (V + F) + texels). Cancelled: the axes done so far.
std::vector<float> sky_visibility(const Points& points, const Points& normals,
                                  const Triangles& triangles, const RunControl& run);

}  // namespace dupin::detail
