#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/warp/contour_match.h"
#include "dupin/warp/exterior_points.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/project.h"

namespace dupin {

/// Areas of two shapes and of what they share. Inside is where an odd number of loops is around.
struct Overlap {
  double area_a = 0.0;        ///< [px^2]
  double area_b = 0.0;        ///< [px^2]
  double intersection = 0.0;  ///< [px^2]
  double iou = 0.0;           ///< intersection over union, 0 where both are empty
};

/// Overlap of two outlines, exact along x and by the midpoint rule in y over `lines` lines, whose
/// error falls with the square of their number.
/// @param lines 16 to 1e6
/// @throws InvalidArgument as validate(outline). Cost: O(corners lines / height of a side + lines).
Overlap compute_overlap(const Outline& a, const Outline& b, int lines = 4096);
Overlap compute_overlap(const Points2& a, const Points2& b, int lines = 4096);

struct SilhouetteFitOptions {
  ContourMatchOptions match;
  ExteriorPointOptions exterior;
  /// How far the contour between two pins may stay from the silhouette, as a share of its height,
  /// 1e-4 to 1; more pins are put in between until then.
  double tolerance = 0.003;
  Eigen::Index max_pins = 400;  ///< 4 to 10000
  double min_confidence = 0.5;  ///< of key points that the fit relies on, 0 to 1
};

struct SilhouetteFit {
  Status status = Status::ok;
  std::vector<WarpPin> pins;   ///< exterior, by rising arc of the source, targets on the silhouette
  Eigen::VectorXd arcs;        ///< of the pins along the source loop [px]
  Eigen::VectorXd confidence;  ///< of the pins' places along the silhouette, 0 to 1
  ContourMatch match;          ///< with the key points that the fit relies on
  Overlap before;              ///< of source and silhouette as they are
  Overlap fitted;              ///< of the source loop moved by its pins, and silhouette
};

/// Pulls a contour to a target silhouette: key points go where the match of the contours
/// (match_contours) puts them, what lies between slides along the silhouette as little as they
/// permit, exterior points (find_exterior_points) become pins, and more pins come between them
/// where straight control lines would leave the silhouette. The result is the target of a fine
/// stage.
/// @throws InvalidArgument for a bad loop or option; AnalysisError as match_contours()
SilhouetteFit fit_silhouette(const Points2& source, const Points2& silhouette,
                             const SilhouetteFitOptions& options = {}, RunControl run = {});

/// The loop moved by pins on it: between neighbours along the loop the displacement is linear in
/// arc length. @param arcs rising, of the pins. @throws InvalidArgument for sizes that do not agree
Points2 move_loop(const Points2& loop, const Eigen::VectorXd& arcs,
                  const std::vector<WarpPin>& pins);

}  // namespace dupin
