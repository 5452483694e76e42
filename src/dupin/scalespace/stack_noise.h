#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/filter_bank.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/signal_noise.h"

namespace dupin {

/// Options of estimate_stack_noise().
struct StackNoiseOptions {
  LevelSchedule schedule = {};
  Filter filter = Filter::implicit;
  int num_replicas = 32;  ///< 8 to 4096; rounded up to a multiple of 16
  /// The variance of R replicas at a vertex is averaged over the surface by diffusion for
  /// max(4, pooling tau_l) squared mean edges; 0: not at all.
  double pooling = 1.0;
  bool want_levels = true;  ///< the noise of F
  /// Levels of LoC searched for the largest extremum, [first_searched, last_searched]; 0 for the
  /// last: L - 2.
  int first_searched = 1;
  int last_searched = 0;
  /// #V or empty: no extremum is looked for here (SurfaceGraph::is_guarded).
  std::vector<std::uint8_t> is_excluded = {};
  bool want_samples = false;  ///< StackNoise::samples
};

/// The noise of LoC in sixteen replicas, at the levels at which the walk stops; in between,
/// add_noise_sample() interpolates. 64 bytes a vertex and stop.
struct NoiseSamples {
  std::vector<Eigen::Index> level;  ///< of LoC, ascending
  std::vector<LevelMatrixF> loc;    ///< aligned with level: 16 by #V, a replica a row [unit]
  Eigen::VectorXd deviation;        ///< aligned with level: root mean square of loc [unit]
  Eigen::VectorXd correlation;      ///< of loc with that of the next stop; one fewer
  double unit = 0.0;                ///< of loc in units of the signal
};

/// Noise of a scale-space stack.
struct StackNoise {
  Status status = Status::ok;  ///< cancelled: the matrices are empty
  /// L by V: root mean square error of F^l [signal], its standard deviation and its bias together:
  /// coarse levels average the noise away, but not its bias. Empty: not wanted.
  LevelMatrixF level_sd;
  LevelMatrixF loc_sd;  ///< L - 1 by V: standard deviation of LoC^l [signal]
  /// R: of every replica, the largest |LoC| / sd over the extrema of the levels searched: what
  /// noise alone would offer to a detector. 0 where there is none.
  Eigen::VectorXd maxima;
  /// From the stop at or below the level before the first one searched to the stop at or above the
  /// one after the last; empty: not wanted.
  NoiseSamples samples;
};

/// Standard deviation of every level of the stack, and of its Laplacian, at every vertex, for a
/// signal with the noise `signal`: Cov_l = P_l Sigma P_l^T (thesis 5.3 with erratum E-26), from R
/// replicas of the noise that walk up the levels together (numerics.md 3).
///
/// Levels follow one another by least-squares polynomials (detail::replica_plan) in single
/// precision; coarse levels between two stops are interpolated. Both are within 2 % of a standard
/// deviation where the spectrum is that of a large surface; once only its slowest modes are left
/// (tau of the order of #V) LoC is overestimated. The sample of R replicas itself
/// leaves 1 / sqrt(2 (R - 1)), 13 % for 32; pooling brings it to a few percent
/// (docs/methods/keypoint_uncertainty.md has the measured figures).
///
/// Same input, same bits, for any number of threads and any instruction set.
/// @throws InvalidArgument if an option is out of range or a size differs
/// Cost: about 300 products with the operator for 35 levels and every sixteen replicas; with levels
/// one more stack for the bias.
StackNoise estimate_stack_noise(const DiffusionOperator& op, const SignalNoise& signal,
                                const StackNoiseOptions& options = {}, RunControl run = {});

/// Levels of a replica: replica = loc + share * noise, from the first stop to the last; others are
/// left. Both matrices are L - 1 by V of `schedule`. Between two stops the noise, divided by the
/// root mean square of its level, is linear in the logarithm of the scale: what the walk itself
/// would give there correlates with that by .99 and more.
/// @throws InvalidArgument if there are no samples, index is not in [0, 16) or a size differs
/// Cost: O(V) a level.
void add_noise_sample(const NoiseSamples& samples, const LevelSchedule& schedule,
                      Eigen::Index index, double share, const LevelMatrix& loc,
                      LevelMatrix& replica);

}  // namespace dupin
