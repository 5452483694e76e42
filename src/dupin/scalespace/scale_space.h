#pragma once

#include <Eigen/Core>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/filter_bank.h"
#include "dupin/scalespace/level_schedule.h"

namespace dupin {

/// Levels as rows, vertices as columns.
using LevelMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using LevelMatrixF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Options of compute_scale_space().
struct ScaleSpaceOptions {
  LevelSchedule schedule = {};
  Filter filter = Filter::implicit;
  double tolerance =
      1e-8;  ///< truncation error relative to the norm of the signal, see ScaleSpace::error_bound
  bool want_levels = true;  ///< compute F
  bool want_loc = true;     ///< compute the Laplacian
};

/// The scale-space representation of a signal on V vertices (thesis 5.1, 5.2). Matrix is
/// LevelMatrix or LevelMatrixF.
template <class Matrix>
struct BasicScaleSpace {
  Status status = Status::ok;  ///< cancelled: the matrices are empty (all levels come out of one
                               ///< recurrence, at its end)
  Eigen::VectorXd lambda;      ///< L - 1 time steps [squared mean edges]
  Eigen::VectorXd tau;         ///< L exact scales, tau_0 = 0 [squared mean edges]
  Matrix levels;               ///< L by V: F^l, in the unit of the signal
  Matrix loc;  ///< L - 1 by V: (F^{l+1} - F^l) / lambda_l = -B F^{l+1}; unit of the signal
  Eigen::Index degree = 0;  ///< terms of the longest series = products with the operator + 1
  double error_bound =
      0.0;  ///< of ||F^l - exact|| / ||F^0|| in the operator's norm, all levels, before rounding
};
using ScaleSpace = BasicScaleSpace<LevelMatrix>;
using ScaleSpaceF = BasicScaleSpace<LevelMatrixF>;

/// All levels of the scale space of `signal` (#V) from one three-term recurrence (numerics.md
/// section 1).
///
/// Same input, same bits, for any number of threads and any instruction set.
/// Memory: 8 L bytes a vertex for each of levels and loc, and about 100 bytes a vertex of work
/// space. Cost: degree (about 310 for the defaults on a closed mesh) products with the operator.
/// @throws InvalidArgument if the signal has the wrong size or is not finite, or an option is out
/// of range
ScaleSpace compute_scale_space(const DiffusionOperator& op, const Eigen::VectorXd& signal,
                               const ScaleSpaceOptions& options = {}, RunControl run = {});

/// The same in single precision, relative error up to 1e-4. Good enough for keypoints. A tolerance
/// below 1e-5 is raised to it: rounding leaves more than that.
ScaleSpaceF compute_scale_space_single(const DiffusionOperator& op, const Eigen::VectorXd& signal,
                                       const ScaleSpaceOptions& options = {}, RunControl run = {});

/// si-LoC (Eq. 5.31, 5.32): every row of `loc` minus its mean over the vertices, divided by its
/// standard deviation. Rows whose deviation is at most 1e-12 of `signal_scale` (largest |F^0|)
/// times the largest factor that B has, are zero.
LevelMatrix scale_invariant_loc(const LevelMatrix& loc, double signal_scale);

}  // namespace dupin
