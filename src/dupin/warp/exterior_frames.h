#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// An exterior control point in the frame of vertices near it (Eq. 7.31), with partners in reserve:
/// the deformation may bring the first two to one place.
struct ExteriorFrame {
  struct Partner {
    std::int32_t vertex;
    double u, v;  ///< [px] along the way from the base to the partner, and across it
  };
  std::int32_t base = -1;
  std::vector<Partner> partners;  ///< nearest first
};

/// Frame of `point` by the nearest vertices of `points` (#V by 2, at least two places).
/// @throws InvalidArgument if the vertices are all at one place. Cost: O(V log V).
ExteriorFrame attach_exterior(const Points2& points, const Eigen::Vector2d& point);

/// Where the frame carries its point when the vertices are at `points` (Eq. 7.32, 7.33). A rigid
/// motion of the vertices is followed exactly; base and all partners at one place: the base.
Eigen::Vector2d place_exterior(const Points2& points, const ExteriorFrame& frame);

}  // namespace dupin
