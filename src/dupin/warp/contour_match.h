#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

struct ContourMatchOptions {
  /// How much the direction of outward normals counts: garments hang the same way up. 0: contours
  /// may be turned against each other at will; 1: a corner turned by 60 degrees costs as much as
  /// one that is 0.6 rad sharper. 0 to 100.
  double upright = 1.0;
  bool allow_mirrored = false;     ///< also try the mirror image of the second contour
  double detail = 160.0;           ///< key points at sigma = I / detail, 24 to 512
  Eigen::Index num_samples = 512;  ///< I, 64 to 8192
  Eigen::Index max_keys = 40;      ///< the most prominent, 4 to 200
};

/// A pair of key points that belong together.
struct KeyMatch {
  double arc_from = 0.0;    ///< [px] along the first loop
  double arc_to = 0.0;      ///< [px] along the second
  double confidence = 0.0;  ///< posterior probability of the pair, 0 to 1
  double deviation = 0.0;   ///< of the place on the second loop where the pair is right [px]
};

/// A map of the arc length of one closed contour to that of another, monotone and once round.
struct ContourMatch {
  Status status = Status::ok;
  std::vector<KeyMatch> keys;  ///< by rising arc_from; between them the map is linear
  double length_from = 0.0;    ///< [px]
  double length_to = 0.0;      ///< [px]
  bool is_reversed = false;    ///< arc_to falls along the first loop
  bool is_mirrored = false;    ///< the second contour was matched by its mirror image
  double cost = 0.0;           ///< of the alignment, per key point [-]
  /// Share of the first contour between pairs that are right, as the posterior expects it.
  double confidence = 0.0;
};

/// Aligns two closed contours by their key points (maxima of unsigned curvature): cyclic dynamic
/// programming over pairs, with the curvature at three scales, the arc length and the turning
/// between successive pairs, and a price for key points left out that grows with their prominence.
/// Posteriors of the pairs come from the sum over all alignments (forward and backward).
/// Loops of opposite direction are compared along opposite directions.
/// @param from, to at least three corners, finite, not all at one place
/// @throws InvalidArgument for a bad loop or option; AnalysisError E_DEGENERATE where one of them
/// has
///   no key point (a circle), since any turn of it would do as well
/// Cost: O(keys^4) at worst, some milliseconds.
ContourMatch match_contours(const Points2& from, const Points2& to,
                            const ContourMatchOptions& options = {}, RunControl run = {});

/// Arc length on the second loop, in [0, length_to), of a place on the first.
double map_arc(const ContourMatch& match, double arc_from);

/// Posterior probability that the stretch of the map at `arc_from` is right: the smaller of those
/// of the pairs on both sides, more of the nearer one.
double confidence_at(const ContourMatch& match, double arc_from);

/// The stretch between two pairs in which a place lies.
struct MatchedRun {
  double before = 0.0;     ///< [px] along the first loop from the pair before
  double after = 0.0;      ///< [px] to the pair after
  double stretch = 1.0;    ///< length on the second loop over that on the first
  double deviation = 0.0;  ///< of the pairs, interpolated [px of the second loop]
};
MatchedRun matched_run(const ContourMatch& match, double arc_from);

}  // namespace dupin
