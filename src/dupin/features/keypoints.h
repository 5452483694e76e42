#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// Which vertices of the stack are keypoints (the thesis has three rules, erratum E-24).
enum class KeypointRule {
  persistent,   ///< extrema followed over the levels; scale: highest level with a locally largest
                ///< response (5.5.2)
  space_scale,  ///< strict extremum over the ring and both neighbouring levels (5.2, after Lowe)
  level         ///< strict extremum over the ring at one level (Fig. 5.3)
};

/// Extremum of the Laplacian of the signal. A bump (H > 0 peak on outward normals) is a minimum.
enum class KeypointKind { maximum, minimum };

/// Options of find_keypoints().
struct KeypointOptions {
  KeypointRule rule = KeypointRule::persistent;
  /// KeypointRule::level: the level, in [1, L - 2]. KeypointRule::persistent: the position is read
  /// at the level of the track nearest to this one, at most six levels above its own scale (extrema
  /// move least there, docs/methods/keypoints.md); 0: at the level of the scale.
  int level = 20;
  /// Scale number of normaliser and radius. `exact`: response tau LoC, radius sqrt(tau) e. Anything
  /// else: response 2 t_l (F^{l+1} - F^l) / (t_{l+1} - t_l) (Eq. 5.30 as printed), radius t e
  /// (Eq. 5.33).
  ScaleMeasure measure = ScaleMeasure::exact;
  int min_persistence = 6;  ///< persistent: levels over which an extremum must be followed, >= 1
  /// Finest level considered; 0: 1, but for `persistent` 12 of 35 levels (in proportion for other
  /// numbers), since finer extrema do not survive noise. For `space_scale` at least 2: the response
  /// of level 0 is zero everywhere, and an extremum of level 1 would be compared with nothing.
  int min_level = 0;
  /// Smallest contrast |response| * radius^contrast_power; 0: all. With the power that makes it
  /// dimensionless (1 for height, H, k1, k2; 2 for K) it is about the height of a structure over
  /// its width, and does not depend on the unit of length; 0 for signals that are no length.
  double min_contrast = 0.0;
  int contrast_power = 1;  ///< 0, 1 or 2
  /// Largest ratio of the second derivatives of the response across and along, where the response
  /// was read: at `level` and `scale_vertex` of the keypoint; 0: all.
  double max_edge_ratio = 0.0;
  Eigen::Index top = 0;  ///< keep so many of the largest |response|; 0: all
};

/// A feature of a surface at its own scale.
struct Keypoint {
  std::int32_t vertex = -1;
  int level = 0;  ///< level of the stack where its scale is
  /// Diffusion time, interpolated between levels but for KeypointRule::level [squared mean edges].
  double tau = 0.0;
  double t = 0.0;         ///< the same in the scale number of KeypointOptions::measure
  double radius = 0.0;    ///< of the structure [mu]
  double response = 0.0;  ///< scale-normalised Laplacian at its scale, signed [unit of the signal]
  KeypointKind kind = KeypointKind::maximum;
  int persistence = 1;      ///< levels over which it was followed (1 for the other rules)
  double edge_ratio = 0.0;  ///< 1 round .. large edge-like; 0: not computed (max_edge_ratio == 0)
  std::int32_t scale_vertex = -1;  ///< where `response` was read, at `level`
  int position_level = 0;          ///< level at which `vertex` is an extremum
  bool is_scale_peak = false;      ///< the response is largest at `level`: tau was interpolated
};

/// Keypoints by falling |response| (ties by vertex, then level).
struct KeypointSet {
  Status status = Status::ok;
  std::vector<Keypoint> keypoints;
};

/// Keypoints of a stack. `loc` is ScaleSpace::loc, L - 1 by V, of `schedule` on `graph`. Guarded
/// vertices, vertices with fewer than three neighbours and plateaus (an equal neighbour) are no
/// keypoints; a level whose response deviates nowhere by more than 1e-12 of `signal_scale` (largest
/// |F^0|) has none.
/// @throws InvalidArgument if sizes differ, an option is out of range, or as response_factors()
/// Cost: O(V L valence).
KeypointSet find_keypoints(const SurfaceGraph& graph, const LevelMatrix& loc,
                           const LevelSchedule& schedule, double signal_scale,
                           const KeypointOptions& options = {}, RunControl run = {});

/// Finest level at which find_keypoints() looks for extrema.
int finest_level(const LevelSchedule& schedule, const KeypointOptions& options);

/// Factor of every level from LoC to the scale-normalised response, L - 1; 0 at level 0.
/// @throws InvalidArgument for ScaleMeasure::variance, which has no scale at level 1
Eigen::VectorXd response_factors(const LevelSchedule& schedule, ScaleMeasure measure);

}  // namespace dupin
