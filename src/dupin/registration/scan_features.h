#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// A place of a scan that may be found again in another one.
struct Anchor {
  std::int32_t vertex = -1;                                  ///< point of the scan nearest to it
  Eigen::RowVector3d position = Eigen::RowVector3d::Zero();  ///< [mu]
  Eigen::RowVector3d normal = Eigen::RowVector3d::UnitZ();   ///< mean over the neighbourhood, unit
  int kind = 0;         ///< +1 maximum, -1 minimum of the Laplacian, 0 no keypoint
  double radius = 0.0;  ///< of the structure [mu]; 0 where there is no keypoint
};

/// Options of describe_scan().
struct ScanFeatureOptions {
  int max_keypoints = 140;             ///< strongest kept, >= 0
  int min_anchors = 80;                ///< evenly spread points make up for missing keypoints, >= 0
  int min_level = 6;                   ///< finest level searched for keypoints, see KeypointOptions
  int min_persistence = 4;             ///< of the keypoints, see KeypointOptions
  int normal_smoothing = 6;            ///< of signal and normals
  Eigen::Index coarse_points = 10000;  ///< a scan of more is thinned to about so many, >= 100
  double noise_sigma = -1.0;           ///< of the points along the normal [mu]; < 0: estimated
};

/// What registration needs of one scan.
struct ScanFeatures {
  Status status = Status::ok;
  Points points;          ///< #V by 3 [mu]
  Points normals;         ///< #V by 3 unit, smoothed; zero where unknown
  bool has_sides = true;  ///< normals point outward for sure; false: estimated on bare points
  Points coarse;          ///< #C by 3: means of the points in cells, or all points [mu]
  Points coarse_normals;  ///< #C by 3 unit
  std::vector<std::int32_t> coarse_vertex;  ///< #C: a point of the scan near each
  double mean_edge = 0.0;                   ///< of the graph of the coarse points [mu]
  double diameter = 0.0;           ///< of the box between the hundredths of the coordinates [mu]
  double noise_sigma = 0.0;        ///< of the points along the normal [mu]
  double coarse_sigma = 0.0;       ///< of the coarse points [mu]
  std::vector<Anchor> anchors;     ///< keypoints by falling response, then others
  Eigen::Index num_keypoints = 0;  ///< leading anchors that are keypoints
};

/// Persistent keypoints of the scale space (thesis 5.5.2) with a normal each, and, where they are
/// few, points far from all of them (farthest-point sampling). A scan without shape has no keypoint
/// but anchors all the same.
/// Structures that registration can use are many mean edges wide, so a dense scan is first thinned
/// to the means of the points in the cells of a grid: noise is averaged, time is saved.
/// @throws InvalidArgument if an option is out of range or as validate(mesh); AnalysisError
///   E_TOO_FEW_POINTS below 16 points, E_RANGE as surface_graph()
/// Cost: O(V log V), and the scale space of the coarse points.
ScanFeatures describe_scan(const Mesh& mesh, const ScanFeatureOptions& options = {},
                           RunControl run = {});
/// The same of bare points, with or without normals.
ScanFeatures describe_scan(const PointCloud& cloud, const ScanFeatureOptions& options = {},
                           RunControl run = {});

}  // namespace dupin
