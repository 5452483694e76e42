#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/warp/contour_match.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/project.h"

namespace dupin {

/// Places carried from one shape to another, and how sure each is.
struct TransferredPlaces {
  Points2 places;              ///< #P by 2 [px] of the second picture
  Eigen::VectorXd deviation;   ///< #P, expected standard deviation where the match is right [px]
  Eigen::VectorXd confidence;  ///< #P, probability to be within 3 % of the second shape's height
};

/// Places of less confidence than this want to be looked at: of made garments, nine tenths of the
/// wrong places are among them (docs/methods/warp_contours.md).
inline constexpr double kSureConfidence = 0.93;

/// Carries places of one shape to another along the match of their contours: on the contour by the
/// map of arc length, elsewhere by mean value coordinates of the first contour, which reproduce
/// affine maps. The confidence is the posterior of the pairs of key points about the place times
/// the probability that a normal deviate of `deviation` stays within 3 % of the height; the
/// deviation grows with the way along the contour to the next pair and with how unevenly the map
/// stretches. Its constants come from made garments (docs/methods/warp_contours.md).
/// @param places #P by 2, finite [px]
/// @throws InvalidArgument for bad loops, places, or a match of other loops
/// Cost: O(P I), I = 512.
TransferredPlaces transfer_places(const Points2& from, const Points2& places, const Points2& to,
                                  const ContourMatch& match);

enum class TargetRule : std::uint8_t {
  relative,  ///< the way from source to target, times the ratio of the lengths of the contours
  absolute   ///< the target stays: it is a place of a mannequin in the same picture
};

/// A template's pins on another shape: sources carried, targets by `rule`, radii times the ratio of
/// the lengths; names, rotations, depths and weights as they are. Mirrored: rotations change sign.
struct TransferredPins {
  std::vector<WarpPin> pins;
  Eigen::VectorXd confidence;  ///< as TransferredPlaces
};
TransferredPins transfer_pins(const Points2& from, const std::vector<WarpPin>& pins,
                              const Points2& to, const ContourMatch& match,
                              TargetRule rule = TargetRule::relative);

}  // namespace dupin
