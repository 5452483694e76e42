#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mls/mls_patch.h"
#include "dupin/surface/curvature.h"

namespace dupin {

/// Curvature from moving-least-squares patches, with its standard deviations.
struct MlsCurvature {
  Status status = Status::ok;  ///< cancelled: nothing is valid
  CurvatureField field;        ///< is_estimated: order >= 6. H > 0 on a sphere
  Points projected;            ///< #V by 3: every point on the surface of its patch (Eq. 4.13) [mu]
  Eigen::VectorXi order;       ///< #V: coefficients that the neighbourhood determined: 10, 6, 3, 0
  Eigen::VectorXd radius;      ///< #V: of the neighbourhood [mu]
  Eigen::VectorXd dof;         ///< #V: degrees of freedom of sigma; 0: nothing is known of it
  Eigen::VectorXd sigma;       ///< #V: standard deviation of the heights about the patch [mu]
  Eigen::VectorXd mean_sd;     ///< #V: standard deviation of H (Eq. 4.37) [1/mu]
  Eigen::VectorXd gauss_sd;    ///< #V: of K [1/mu^2]
  Eigen::VectorXd normal_sd_rad;  ///< #V: of the angle of the patch normal, root of the sum of both
                                  ///< tangential variances
};

/// Options of estimate_curvature_mls().
struct MlsCurvatureOptions {
  MlsOptions patch = {};
  /// Standard deviation of the noise of the heights [mu]; 0: from the residual of each patch, which
  /// holds what the cubic does not follow besides the noise.
  double noise_sigma = 0.0;
  bool want_deviations = true;  ///< dof, sigma, mean_sd, gauss_sd, normal_sd_rad; else empty
};

/// Curvature at every point of a cloud or mesh, from the cubic patch of its neighbourhood (thesis
/// 4.1.4, 4.2.2). Connectivity is not used. `normals` (#V by 3, or 0 by 3) say which side is
/// outward; without them the sign of H is that of an arbitrary side. Where the fit has no second
/// degree (order 3 or 0) the curvature is 0 and is_estimated false; deviations are 0 where there
/// are no degrees of freedom.
///
/// Same input, same bits, for any number of threads.
/// @throws InvalidArgument if sizes differ, a coordinate is not finite or an option is out of range
/// @throws AnalysisError E_TOO_FEW_POINTS if there are fewer than three points
/// Cost: O(V k), about 4 microseconds a point for k = 100 besides the search.
MlsCurvature estimate_curvature_mls(const Points& points, const Points& normals,
                                    const MlsCurvatureOptions& options = {}, RunControl run = {});

/// Options of project_mls().
struct MlsProjectionOptions {
  MlsOptions patch = {};
  int max_iterations = 10;  ///< of Eq. 4.13, >= 1; 1: one projection, as the thesis smooths
  double tolerance = 1e-6;  ///< smallest step, in radii of the neighbourhood [-]
};

/// Points on the MLS surface of a cloud.
struct MlsProjection {
  Status status = Status::ok;  ///< not_converged: some point still moved; see `step`
  Points points;               ///< #Q by 3 [mu]
  Points normals;              ///< #Q by 3 unit normals of the last patch, sides as `facing`
  Eigen::VectorXd step;        ///< #Q length of the last step [mu]
  Eigen::VectorXi order;       ///< #Q order of the last patch; 0: the point was left where it was
};

/// Projects `queries` (#Q by 3, near the surface) onto the MLS surface of `points` (#V by 3): Psi
/// of Eq. 4.13, repeated until it no longer moves (Eq. 4.14, E-2). Smoothing a cloud or mesh is
/// projecting its own points. `facing` (#Q by 3, or 0 by 3) orients the normals.
/// @throws InvalidArgument, AnalysisError as estimate_curvature_mls()
/// Cost: as estimate_curvature_mls(), for each iteration.
MlsProjection project_mls(const Points& queries, const Points& points, const Points& facing,
                          const MlsProjectionOptions& options = {}, RunControl run = {});

}  // namespace dupin
