#pragma once

#include <Eigen/Core>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// Weight of a neighbour at distance d from the centre of the patch (Eq. 4.8).
enum class MlsWeight {
  gaussian,  ///< exp(-(d / width)^2)
  uniform    ///< 1 within the neighbourhood: least noise, but bumps pass through in steps
};

/// Options of everything that fits moving-least-squares patches (thesis 4.1).
struct MlsOptions {
  int neighbors = 100;  ///< k nearest points, itself included; >= 3; fewer points: all of them
  double radius = 0.0;  ///< [mu]; > 0: all points within it instead of the k nearest
  MlsWeight weight = MlsWeight::gaussian;
  /// Width of the Gaussian over the radius of the neighbourhood, > 0 [-].
  double weight_width = 1.0;
  int degree = 3;  ///< of the height map, 1 to 3
  /// Centre of the plane fit: the weighted mean of the neighbourhood, or the point itself as
  /// Eq. 4.3 has it, which tilts the plane of a noisy point (erratum E-3).
  bool centre_on_mean = true;
  /// Smallest part of a column of the fit that the columns before it must leave unexplained,
  /// squared; below it the order falls (10, 6, 3 coefficients). In (0, 1).
  double rank_tolerance = 1e-10;
};

/// Coefficients of Eq. 4.7: x^3, x^2 y, x y^2, y^3, x^2, x y, y^2, x, y, 1.
using PatchVector = Eigen::Matrix<double, 10, 1>;
using PatchMatrix = Eigen::Matrix<double, 10, 10>;

/// A surface patch z = g(x, y) over the reference plane of one point (thesis 4.1).
struct MlsPatch {
  int order = 0;  ///< coefficients that the neighbourhood determines: 10, 6, 3, or 0 for none
  int num_neighbors = 0;  ///< points in the neighbourhood
  double radius = 0.0;    ///< largest distance of a neighbour, or the given radius [mu]
  Eigen::RowVector3d u1{1.0, 0.0, 0.0};    ///< x axis: direction of the largest spread
  Eigen::RowVector3d u2{0.0, 1.0, 0.0};    ///< y axis, u1 x u2 = n
  Eigen::RowVector3d n{0.0, 0.0, 1.0};     ///< normal of the plane
  Eigen::RowVector3d q{0.0, 0.0, 0.0};     ///< origin, r - t n [mu]
  double t = 0.0;                          ///< signed distance of r from the plane [mu]
  PatchVector beta = PatchVector::Zero();  ///< [mu^(1 - a - b)] for x^a y^b; beyond the order: 0
  /// Degrees of freedom of the residual: N - order for uniform weights, in general
  /// tr W - tr((A^T W A)^-1 A^T W^2 A) (erratum E-6); 0 if there are none.
  double dof = 0.0;
  double variance = 0.0;  ///< of the noise in the heights, xi^T W xi / dof [mu^2]; 0 without dof
  /// Covariance of beta for heights of variance 1 (Eq. 4.30); times `variance` or sigma^2 it is
  /// that of the estimate. Rows and columns beyond the order are 0.
  PatchMatrix unit_covariance = PatchMatrix::Zero();

  /// The projection of r onto the surface, Eq. 4.13 [mu].
  Eigen::RowVector3d projected() const { return q + beta[9] * n; }
};

/// Fits the patch of the point `r` to its neighbourhood, all rows of `neighbors` (#N by 3) [mu].
/// The plane: smallest principal axis of the weighted neighbourhood, then the signed distance t
/// that minimises Eq. 4.2 with |t| <= half the width (E-3). The heights: weighted least squares in
/// coordinates divided by the radius, by a Cholesky factor whose pivots reveal the rank
/// (docs/methods/mls.md). `facing`: if not zero, n points to its side.
/// @throws InvalidArgument if an option is out of range or a coordinate is not finite
/// Cost: O(N), about 100 flops a neighbour.
MlsPatch fit_mls_patch(const Eigen::RowVector3d& r, const Points& neighbors,
                       const MlsOptions& options = {},
                       const Eigen::RowVector3d& facing = Eigen::RowVector3d::Zero());

/// Curvature of a patch at its origin. Sign: n outward, a sphere has H > 0 (the thesis prints the
/// opposite sign for H; E-4).
struct PatchCurvature {
  double mean = 0.0;   ///< H [1/mu]
  double gauss = 0.0;  ///< K [1/mu^2]
  double k1 = 0.0;     ///< larger principal curvature [1/mu]
  double k2 = 0.0;
  Eigen::RowVector3d d1{1.0, 0.0, 0.0};      ///< unit direction of k1, in x, y, n of the patch
  Eigen::RowVector3d d2{0.0, 1.0, 0.0};      ///< unit direction of k2
  Eigen::RowVector3d normal{0.0, 0.0, 1.0};  ///< unit normal of the patch surface, same frame
};

/// Eq. 4.18 and the principal directions of S = I^-1 II.
PatchCurvature patch_curvature(const PatchVector& beta);

/// Throws InvalidArgument, naming field and range, unless all options are in range.
void validate(const MlsOptions& options);

}  // namespace dupin
