#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/features/keypoints.h"

namespace dupin::detail {

/// One row of responses (level l) with its factor applied.
struct ResponseStack {
  const LevelMatrix* loc;
  Eigen::VectorXd factor;
  double at(Eigen::Index level, Eigen::Index vertex) const {
    return factor[level] * (*loc)(level, vertex);
  }
};

/// +1 strict maximum of the ring, -1 strict minimum, 0 neither, of row `level` at v. A positive
/// factor does not change it.
int ring_extremum(const Adjacency& ring, const LevelMatrix& loc, Eigen::Index level,
                  Eigen::Index v);

/// Steepest climb (descent for sign < 0) of row `level` from `start`.
std::int32_t climb(const Adjacency& ring, const LevelMatrix& loc, Eigen::Index level, int sign,
                   std::int32_t start);

/// An extremum followed from its coarsest level down: vertex[i] belongs to level coarsest - i.
struct Track {
  int coarsest = 0;
  int sign = 0;
  std::vector<std::int32_t> vertex;
};

/// Follows extrema of levels [first, last]. From the extremum at level l + 1 the field of level l
/// is climbed to its extremum; it is the same feature if the climb ends within max(2, sqrt(tau_l) /
/// 2) edges (in a straight line, in units of the mean edge). Of two that end at one extremum the
/// nearer continues (ties: the stronger, then the smaller vertex). Deterministic.
std::vector<Track> follow_extrema(const SurfaceGraph& graph, const ResponseStack& responses,
                                  const std::vector<std::uint8_t>& is_level_live,
                                  const Eigen::VectorXd& tau, int first, int last,
                                  const RunControl& run);

/// Second derivatives of row `level` at v along and across, in the tangent plane (least squares
/// over two rings) [unit of the row / squared mean edge]. Not determined: fewer than five
/// neighbours or collinear ones.
struct SecondDerivatives {
  bool is_determined = false;
  double large = 0.0;  ///< of larger magnitude
  double small = 0.0;
};
SecondDerivatives second_derivatives(const SurfaceGraph& graph, const LevelMatrix& loc,
                                     Eigen::Index level, Eigen::Index v);

/// Ratio of the larger to the smaller second derivative of row `level` at v in the tangent plane
/// (least squares over two rings), or infinity when they differ in sign.
double edge_ratio(const SurfaceGraph& graph, const LevelMatrix& loc, Eigen::Index level,
                  Eigen::Index v);

}  // namespace dupin::detail
