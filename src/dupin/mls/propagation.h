#pragma once

#include <Eigen/Core>

#include "dupin/mls/mls_patch.h"

namespace dupin {

/// Jacobian of (K, H) with respect to beta, 2 by 10 (Eq. 4.39; H with our sign, > 0 on a sphere).
Eigen::Matrix<double, 2, 10> curvature_jacobian(const PatchVector& beta);

/// Covariance of (K, H), first order: J Sigma J^T (Eq. 4.37). At an umbilic it has rank 1.
/// @param covariance of beta
Eigen::Matrix2d curvature_covariance(const PatchVector& beta, const PatchMatrix& covariance);

/// Covariance of the unit normal of the patch surface at its origin, in x, y, n of the patch.
Eigen::Matrix3d patch_normal_covariance(const PatchVector& beta, const PatchMatrix& covariance);

/// Covariance of the plane normal n, the eigenvector of the smallest eigenvalue of C = sum w (p -
/// r) (p - r)^T, for noise of covariance `noise` (3 by 3 [mu^2]) in every neighbour, r held (thesis
/// 4.2.3). It is the constrained form of the implicit model with the Lagrange term that the thesis
/// leaves out: A = [2 (C - lambda I), 2 n; 2 n^T, 0], Sigma = A^-1 B S B^T A^-T (errata E-11,
/// E-12).
/// @param offsets p - r, #N by 3 [mu]
/// @param weights #N
/// @throws InvalidArgument if the sizes differ or fewer than three offsets are given
/// @throws AnalysisError E_DEGENERATE if the smallest eigenvalue is not single: no normal
Eigen::Matrix3d plane_normal_covariance(const Points& offsets, const Eigen::VectorXd& weights,
                                        const Eigen::Matrix3d& noise);

/// Covariance of parameters b that minimise an objective D(h, b), for data h of covariance `noise`
/// (thesis 4.2.1, after Haralick): with g = dD/db = 0, Sigma = G_b^-1 G_h S G_h^T G_b^-T.
/// @param g_parameters dg_i/db_j, p by p
/// @param g_data dg_i/dh_j, p by n
/// @param noise covariance of h, n by n
/// @throws InvalidArgument if sizes differ or an entry is not finite
/// @throws AnalysisError E_DEGENERATE if g_parameters is singular
/// Cost: O(p^3 + p n^2).
Eigen::MatrixXd implicit_covariance(const Eigen::MatrixXd& g_parameters,
                                    const Eigen::MatrixXd& g_data, const Eigen::MatrixXd& noise);

}  // namespace dupin
