#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/registration/pose.h"
#include "dupin/registration/surface_samples.h"

namespace dupin {

/// Options of refine_pose().
struct IcpOptions {
  bool with_scale = false;
  bool is_flipped = false;      ///< the normals of the moving surface point to the other side
  double start_distance = 0.0;  ///< of pairs at first, >= 0; 0: four spacings [mu of fixed]
  double last_distance = 0.0;   ///< of pairs at the end, >= 0; 0: one and a half spacings
  int max_iterations = 60;      ///< >= 1
  Eigen::Index every = 1;       ///< take only every so many samples, >= 1
  double tolerance = 1e-5;      ///< smallest step, in spacings, > 0
};

/// A refined pose and what it rests on. Order of the seven parameters: rotation vector about
/// `center` [rad], shift of `center` [mu of fixed], logarithm of the scale.
struct IcpResult {
  Status status = Status::ok;  ///< not_converged: the last step is still larger than the tolerance
  Pose pose;
  int iterations = 0;
  Eigen::Index num_pairs = 0;  ///< samples of both sides that rest on the other
  double rmse = 0.0;           ///< of their distances [mu of fixed]
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< mean of the pairs [mu of fixed]
  /// Mean of J J^T over the pairs for the parameters, lengths in units of `extent`: its small
  /// eigenvalues are motions that the surfaces do not resist (sliding of planes, turning of
  /// spheres). Rows of the scale are zero without it.
  Eigen::Matrix<double, 7, 7> information = Eigen::Matrix<double, 7, 7>::Zero();
  double extent = 0.0;  ///< root mean square distance of the pairs from `center` [mu of fixed]
};

/// Aligns two sampled surfaces from a start near the truth: each sample of either side is paired
/// with the patch that it lies over (normals within 60 degrees), distances are measured to the
/// patch along its normal, steps are Gauss-Newton with Tukey weights whose width follows the median
/// distance, and pairs farther apart than a bound that shrinks are left out (trimmed point-to-plane
/// ICP, after Chen and Medioni 1992, both ways). Without overlap the pose stays what it was and
/// there are no pairs.
/// @throws InvalidArgument if an option is out of range or the start is not finite
/// Cost: O(iterations S).
IcpResult refine_pose(const SurfaceSamples& moving, const SurfaceSamples& fixed, const Pose& start,
                      const IcpOptions& options = {}, RunControl run = {});

namespace detail {

/// A sample over a patch of the other surface, all in the frame of the fixed surface.
struct SurfacePair {
  Eigen::RowVector3d point;   ///< on the moving surface
  Eigen::RowVector3d normal;  ///< of the patch
  double distance = 0.0;      ///< of the moving above the fixed surface along `normal`
  double weight = 1.0;        ///< usual variance of a distance over that of these two patches
};

/// Pairs of the samples of both sides within `bound`; moving samples first. `every` > 1 takes only
/// every so many samples.
std::vector<SurfacePair> find_pairs(const SurfaceSamples& moving, const SurfaceSamples& fixed,
                                    const Pose& pose, bool is_flipped, double bound,
                                    Eigen::Index every = 1);

}  // namespace detail
}  // namespace dupin
