#pragma once

#include <Eigen/Core>
#include <functional>

#include "dupin/base/run_control.h"

namespace dupin {

/// Chebyshev expansions of several functions on [0, s_max] at once:
/// f_l(s) = sum_k c(k, l) T_k(y) with y = 1 - 2 s / s_max, so that y = 1 is s = 0.
///
/// `functions(s)` returns the values of all functions at s. The number of nodes is doubled from 64
/// until the last quarter of every column is below 1e-14 of its largest coefficient, so that what
/// lies beyond is rounding. Returns the coefficients, #terms by #functions; empty when cancelled.
/// @throws Error(Errc::numerical) E_NOT_CONVERGED if that is not so with `max_nodes`: a bound from
/// fewer terms would be a guess. Cost: O(nodes (log nodes) #functions) beside the functions.
Eigen::MatrixXd chebyshev_coefficients(const std::function<Eigen::VectorXd(double)>& functions,
                                       double s_max, Eigen::Index max_nodes = 1 << 14,
                                       const RunControl& run = {});

/// Smallest number of leading terms of each column whose tail sum |c| is at most tolerance(l). At
/// least 1.
Eigen::VectorXi truncation_lengths(const Eigen::MatrixXd& coefficients,
                                   const Eigen::VectorXd& tolerance);

/// Value at s of the first `length` terms of column `l` (Clenshaw). For tests and plots.
double evaluate_chebyshev(const Eigen::MatrixXd& coefficients, Eigen::Index l, Eigen::Index length,
                          double s, double s_max);

}  // namespace dupin
