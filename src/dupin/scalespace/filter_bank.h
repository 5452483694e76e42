#pragma once

#include <Eigen/Core>
#include <memory>

#include "dupin/base/run_control.h"
#include "dupin/scalespace/level_schedule.h"

namespace dupin {

/// How one level follows from the one before.
enum class Filter {
  implicit,  ///< backward Euler, (I + lambda_l B) F^{l+1} = F^l (Eq. 5.18): f_l(s) = prod 1 / (1 +
             ///< lambda_k s)
  heat,      ///< exact diffusion: f_l(s) = exp(-tau_l s)
  forward    ///< forward Euler, F^{l+1} = (I - lambda_l B) F^l (Eq. 5.15); stable only for lambda_l
             ///< s_max <= 2
};

/// What identifies a filter bank. It does not depend on a mesh but for the bound of its spectrum.
struct FilterBankKey {
  LevelSchedule schedule = {};
  Filter filter = Filter::implicit;
  double spectrum_bound = 1.5;  ///< s_max of the operator B, whose spectrum lies in [0, s_max]
  double tolerance = 1e-8;      ///< truncation error allowed, relative to the norm of the signal
};

/// Every level of the stack, and its Laplacian, as a Chebyshev series of one operator (numerics.md
/// section 1): F^l = sum_k levels(k, l) T_k(Y) F^0 with Y = I - 2 B / s_max. Terms beyond
/// level_length(l) are zero.
///
/// The Laplacian series belongs to LoC^l = (F^{l+1} - F^l) / lambda_l = -B F^{l+1} for the implicit
/// filter (Eq. 5.29 without the doubtful factor, errata E-21), expanded as one function: nothing is
/// subtracted.
struct FilterBank {
  Eigen::MatrixXd levels;        ///< #terms by L
  Eigen::MatrixXd loc;           ///< #terms by L - 1
  Eigen::VectorXi level_length;  ///< L: terms kept
  Eigen::VectorXi loc_length;    ///< L - 1
  /// L: rigorous bound of ||F^l - its series|| / ||F^0|| in the norm of the operator's inner
  /// product: the sum of the dropped |c|, at most the tolerance.
  Eigen::VectorXd level_error;
  /// L - 1: the same for tau_{l+1} LoC^l, the scale-normalised Laplacian.
  Eigen::VectorXd loc_error;
};

/// The bank of `key`, computed once and remembered (the last 16 keys; safe from many threads). Null
/// when cancelled.
/// @throws InvalidArgument if the schedule is invalid, the bound is not finite and > 0, the
///   tolerance is not in [1e-14, 0.1], or forward steps are unstable
/// @throws Error(Errc::numerical) E_NOT_CONVERGED if the spectrum is so wide for these time steps
///   that 16,384 terms are not enough, as cotan weights of very thin triangles make it
/// Cost: 1-2 ms for 35 levels at the first call.
std::shared_ptr<const FilterBank> filter_bank(const FilterBankKey& key, const RunControl& run = {});

/// f_l(s) for all levels, exact: the transfer functions of Eq. 5.21, 5.22 with s = omega^2.
Eigen::VectorXd transfer_functions(const LevelSchedule& schedule, Filter filter, double s);

}  // namespace dupin
