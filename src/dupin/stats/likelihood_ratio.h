#pragma once

#include <Eigen/Core>

namespace dupin {

/// Which eigenvalues of the covariance count as zero: those below the larger of the two.
struct LikelihoodRatioOptions {
  double relative_epsilon = 1e-8;  ///< in [0, 1), of the largest eigenvalue; free of units
  double absolute_epsilon = 0.0;   ///< >= 0, in squared units of the sample
};

/// The rule of section 4.3.1 with the value that reproduces its tables: 1e-3 in absolute units.
LikelihoodRatioOptions thesis_likelihood_ratio_options();

struct LikelihoodRatio {
  double statistic = 0.0;  ///< T = -2 log(likelihood ratio) >= 0 [-]; infinity if the sample spans
                           ///< less than the covariance does
  Eigen::Index rank = 0;   ///< K: number of eigenvalues kept
  double dof = 0.0;        ///< K (K + 1) / 2 + K
  double p_value = 1.0;    ///< P(chi^2 with dof >= T)
  double outside_rms = 0.0;  ///< root mean square distance of the sample from the plane through the
                             ///< mean that the kept eigenvectors span, in units of the sample
};

/// Tests whether M draws of a p-vector come from N(mean, covariance), both given (Eq. 4.52):
///
///     T = M (tr(S C^-1) + d^T C^-1 d - log det(S C^-1) - p)                       (Eq. 4.53)
///
/// with d the sample mean minus `mean` and S the covariance of the sample divided by M, not M - 1
/// (Eq. 4.56). Where C has rank K < p, inverse and determinant are taken in the space of its K kept
/// eigenvectors, and p is K (Eq. 4.57). T is asymptotically chi^2 with K (K + 1) / 2 + K degrees of
/// freedom; its mean is higher for small M (K = 10: 70.68 at M = 50, 66.29 at 200, against 65).
///
/// What the sample does outside that space does not enter T: a propagated covariance is of first
/// order and its null space holds the second order. `outside_rms` tells how much there is.
/// Variables of different units should be standardised first, or relative_epsilon compares unlike
/// things.
///
/// A covariance of exact zeros is the point mass at `mean`: rank 0, T = 0 and p_value 1 if every
/// draw is `mean` up to rounding, T infinite and p_value 0 otherwise.
///
/// @param sample     M by p, one draw a row
/// @param mean       p
/// @param covariance p by p, symmetric to 1e-9 of its largest entry and with no eigenvalue below
///                   -1e-9 of its largest
/// @throws InvalidArgument if the sizes differ, p = 0, an entry is not finite, sample or mean is
///   beyond 1e150, the covariance is not symmetric or not positive semidefinite, or an option is
///   outside its range
/// @throws AnalysisError (exit 5) E_TOO_FEW_SAMPLES if M < 5 K or M = 0: K depends on the data;
///   E_COVARIANCE if the covariance is not zero and absolute_epsilon drops all of it
/// Cost: O(p^3 + M p^2).
LikelihoodRatio likelihood_ratio_test(const Eigen::MatrixXd& sample, const Eigen::VectorXd& mean,
                                      const Eigen::MatrixXd& covariance,
                                      const LikelihoodRatioOptions& options = {});

}  // namespace dupin
