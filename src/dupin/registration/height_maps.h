#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/registration/scan_features.h"

namespace dupin::detail {

/// Rotation and scale of one local frame against another, and how well the surfaces agree there.
struct FeatureMatch {
  int moving = -1;          ///< anchor of the moving scan
  int fixed = -1;           ///< anchor of the fixed scan
  bool is_flipped = false;  ///< the moving normals point to the other side
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< of the frames, moving to fixed
  double scale = 1.0;
  double mismatch = 1.0;  ///< mean square difference of the slopes [-]
  double weight = 0.0;    ///< the match among its rivals: 1 outstanding .. 0 like all others
};

/// The surface around anchors as slope h / rho of the height h over the anchor's tangent plane, on
/// a log-polar grid of the distance rho in that plane: turning the surface about the normal shifts
/// the angle, scaling it shifts the ring, and what the scan does not cover is known to be missing.
struct HeightMaps {
  static constexpr int kAngles = 16;
  static constexpr double kRatio = 1.25;  ///< of neighbouring rings

  int rings = 0;
  double base = 0.0;          ///< radius of the first ring [mu]
  std::vector<float> slope;   ///< #A by rings by kAngles; 0 where missing
  std::vector<float> weight;  ///< the same, in [0, 1]; 0: missing
  Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor> frame;  ///< #A, rows u, w, n

  int cells() const { return rings * kAngles; }
};

/// Maps of all anchors of `scan`. Cells weigh by how surely the points in them tell the slope for
/// noise of `scan.coarse_sigma`. Cost: O(A points within the last ring).
HeightMaps build_height_maps(const ScanFeatures& scan, double base, int rings,
                             const RunControl& run);

/// The maps of the same surface seen from its other side: u stays, w and n point the other way.
HeightMaps flipped(const HeightMaps& maps);

/// Options of match_height_maps().
struct MapMatchOptions {
  int candidates = 6;  ///< best matches kept of every anchor of either side
  int max_shift = 0;   ///< rings by which scales may differ beyond what the radii say; 0: no scale
};

/// Best matches of every anchor of either side, by falling weight. Anchors that are both keypoints
/// match only if of one kind. Cost: O(A B angles cells shifts).
std::vector<FeatureMatch> match_height_maps(const ScanFeatures& moving, const HeightMaps& of_moving,
                                            const ScanFeatures& fixed, const HeightMaps& of_fixed,
                                            bool is_flipped, const MapMatchOptions& options,
                                            const RunControl& run);

}  // namespace dupin::detail
