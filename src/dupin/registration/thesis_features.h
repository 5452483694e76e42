#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/features/keypoints.h"
#include "dupin/mesh/mesh.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// How the tangents of a frame are found (5.5.3).
enum class FrameRule {
  loc,       ///< principal axes of the neighbourhood weighted by |LoC|: the thesis
  uniform,   ///< principal axes, all weights equal
  gaussian,  ///< principal axes, weights exp(-2 d^2 / r^2) at the distance d
  /// Mean gradient of the smoothed signal, with the same weights: v_1 points uphill. What the
  /// thesis tried first, and gave up as not robust to noise.
  gradient
};

/// What the descriptor counts (5.5.4).
enum class DescriptorValue {
  loc,    ///< Laplacian of the curvature at the feature's level: the thesis
  signal  ///< the smoothed curvature itself, which the thesis found less distinctive
};

/// Options of describe_by_thesis() (5.5.2 to 5.5.4).
struct ThesisFeatureOptions {
  Signal signal = Signal::height;  ///< `mean` is the thesis; it needs a mesh and dislikes noise
  LevelSchedule schedule = {};
  /// 5.5.2: persistent, its scale the highest level with a locally largest response, else the last.
  KeypointRule rule = KeypointRule::persistent;
  double min_contrast = 0.01;  ///< of a keypoint, see KeypointOptions, >= 0: below it a sphere has
                               ///< the features of its sampling
  Eigen::Index max_features = 200;  ///< strongest kept, >= 0; 0: all
  /// Size of the neighbourhood over the radius of the keypoint, > 0.
  double neighborhood = 1.5;
  FrameRule frame = FrameRule::loc;
  DescriptorValue value = DescriptorValue::loc;
};

/// A feature point with its principal frame and what its descriptor is made of.
struct ThesisFeature {
  Keypoint keypoint;
  Eigen::RowVector3d position = Eigen::RowVector3d::Zero();  ///< [mu]
  double radius = 0.0;                                       ///< r_i of the neighbourhood [mu]
  /// Columns v_1, v_2 (tangent, of falling extent, signs arbitrary but with FrameRule::gradient)
  /// and v_3 on the side of the vertex normal; v_1 x v_2 = v_3.
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  /// Scale-normalised LoC (or the smoothed signal) times the radius of the keypoint at each vertex
  /// of the neighbourhood: without a unit, and comparable between levels and samplings. In rising
  /// order.
  std::vector<double> values;
};

/// Features of one surface by falling response.
struct ThesisFeatures {
  Status status = Status::ok;
  std::vector<ThesisFeature> features;
};

/// Feature points, principal frames and LoC values of a surface (5.5.2, 5.5.3, 5.5.4). A
/// neighbourhood is the part of the surface within r_i of the feature that hangs together with it.
/// Guarded vertices are no features, but belong to neighbourhoods.
/// @throws InvalidArgument if an option is out of range; AnalysisError as compute_signal()
/// Cost: that of the scale space, and O(sum of the neighbourhoods).
ThesisFeatures describe_by_thesis(const SurfaceGraph& graph,
                                  const ThesisFeatureOptions& options = {}, RunControl run = {});

/// Principal frame of weighted points (5.5.3): the eigenvectors of their covariance about the
/// weighted mean, with |weight| (erratum E-27: LoC is signed, and an indefinite "covariance" would
/// swap normal and tangent when its sign is turned). v_3 is the eigenvector most parallel to
/// `normal`, turned to its side. `points` #N by 3, `weights` #N; where all weights are zero, equal
/// ones. Its tangents are arbitrary on a round neighbourhood.
/// @throws InvalidArgument if sizes differ or a value is not finite. Cost: O(N).
Eigen::Matrix3d principal_frame(const Points& points, const Eigen::VectorXd& weights,
                                const Eigen::RowVector3d& normal);

/// Frame whose v_1 is the weighted mean of `gradients` (#N by 3) in the plane of `normal`, v_3 is
/// `normal`; the tangent is arbitrary where that mean is zero.
/// @throws InvalidArgument if sizes differ or a value is not finite. Cost: O(N).
Eigen::Matrix3d gradient_frame(const Points& gradients, const Eigen::VectorXd& weights,
                               const Eigen::RowVector3d& normal);

/// Histogram of `values` over [-range, range] in `bins` equal bins, as shares of all values, each
/// multiplied by the value at the middle of its bin (5.5.4) over `range`. Values beyond the range
/// count in the last bin. #bins; zero without values.
/// @throws InvalidArgument if bins < 1 or range is not > 0
Eigen::VectorXd loc_histogram(const std::vector<double>& values, double range, int bins);

}  // namespace dupin
