#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/scalespace/scale_space.h"

namespace dupin {

/// What the conjugate-gradient path computed and how well.
struct ReferenceScaleSpace {
  Status status = Status::ok;     ///< not_converged: a residual stayed above the tolerance
  LevelMatrix levels;             ///< L by V
  Eigen::VectorXd residual;       ///< L - 1: relative residual of every solve
  Eigen::Index num_products = 0;  ///< products with the operator in all
};

/// The implicit stack by one solve a level, as the thesis writes it (Eq. 5.18-5.20) but in
/// symmetric form (M + lambda M B) F^{l+1} = M F^l (erratum E-18), with Jacobi-preconditioned
/// conjugate gradients started at F^l. Slow and plain: the independent reference of
/// compute_scale_space().
/// @throws InvalidArgument if the signal has the wrong size, a tolerance is not in (0, 1),
/// max_iterations < 1
ReferenceScaleSpace reference_scale_space(const DiffusionOperator& op,
                                          const Eigen::VectorXd& signal,
                                          const LevelSchedule& schedule, double tolerance = 1e-12,
                                          Eigen::Index max_iterations = 10'000,
                                          RunControl run = {});

}  // namespace dupin
