#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/arap.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// How far a deformation is from rigid, and where it folds over. Stretch is a singular value of the
/// linear map of a triangle: 1 where lengths are kept. Triangles without area at rest are left out
/// of all but `num_triangles` and counted in `degenerate`.
struct WarpQuality {
  Eigen::Index num_triangles = 0;
  std::vector<std::int32_t> flipped;  ///< triangles that lie face down or have lost their area
  Eigen::Index degenerate = 0;        ///< triangles without area at rest
  double min_stretch = 1.0;           ///< smallest singular value of all triangles; 0 if flipped
  double max_stretch = 1.0;
  double mean_stretch = 1.0;  ///< mean of both singular values over the area at rest
  double area_change = 0.0;   ///< (area - area at rest) / area at rest
};

/// @param rest mesh at rest @param deformed #V by 2 @throws InvalidArgument if sizes differ.
/// Cost: O(F).
WarpQuality measure_warp(const PlanarMesh& rest, const Points2& deformed);

struct PolishOptions {
  int max_iterations = 200;  ///< >= 1
  double max_stretch = 3.0;  ///< k > 1: singular values are drawn into [1/k, k]
};

struct PolishResult {
  Points2 points;  ///< #V by 2: the state with the fewest flipped triangles
  int iterations = 0;
  Eigen::Index flipped = 0;  ///< in `points`
};

/// Takes fold-overs out of `deformed`, which meets the constraints of `system`, as far as they
/// permit: turns over the maps of the triangles, with singular values clamped to [1/k, k] and
/// without reflection (every 50 turns it begins anew with k doubled), and the best places for them
/// (ArapSystem::fit_triangles, the factor that is there). Stops at the first state without a
/// flipped triangle. Never returns more flipped triangles than it got.
/// @throws InvalidArgument for an option; Error E_INTERRUPTED. Cost: as many turns, each like an
///   iteration.
PolishResult polish_folds(const ArapSystem& system, const PlanarMesh& rest, const Points2& deformed,
                          const PolishOptions& options = {}, const RunControl& run = {});

}  // namespace dupin
