#pragma once

#include <Eigen/Core>

#include "dupin/warp/contour_match.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin::detail {

/// Where a contour comes to lie on a silhouette when it slides along it as little as its key points
/// permit: what is fitted is the displacement, smooth along the contour, of which the silhouette
/// says only the part across and the key points the rest.
/// @param source #I by 2 at equal steps along `loop`, `arcs` (#I) of it [px]; #I a multiple of 4
/// @param silhouette a loop @param match of the two loops, not reversed
/// @param height of the silhouette [px]
/// @return #I: arc length on the silhouette, never falling but for the turn
Eigen::VectorXd settle_contour(const Points2& loop, const Points2& source,
                               const Eigen::VectorXd& arcs, const Points2& silhouette,
                               const ContourMatch& match, double height);

}  // namespace dupin::detail
