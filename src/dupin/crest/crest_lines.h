#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/crest/edge_crossing.h"
#include "dupin/scalespace/filter_bank.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// Options of find_crest_lines().
struct CrestOptions {
  LevelSchedule schedule = {24, 1.0, 1.2};  ///< levels among which a scale is chosen
  Filter filter = Filter::implicit;
  int normal_smoothing = 6;  ///< times that normals are averaged before their gradient is taken
  /// >= 1: the lines of this level alone, as the thesis draws them. 0: every place at the scale of
  /// its own, lines of all scales in one set.
  int level = 0;
  int finest = 4;      ///< finest level of a scale, >= 1
  double gamma = 1.0;  ///< 5.44 as t^(gamma / 2) s, in (0, 2]; 1/2 suits rounded creases (E-30)
  /// Standard deviation of every coordinate of the points, >= 0 [mu]. No scale is chosen at which
  /// the strength is not `noise_factor` times what this noise makes of a plane.
  double noise_sigma = 0.0;
  double noise_factor = 6.0;
  /// Largest radius |k0| of a scale, > 0 [-], with the largest |k0| of all finer levels: tensors of
  /// places whose normals differ by much more than a radian have no average that means anything.
  double max_turn = 2.0;
  /// The line of a place is drawn at this share of the tau of its scale, in (0, .95], or as far
  /// above as noise asks. Lines drift with tau: the tensor is extrapolated to no smoothing by what
  /// it changes from there to the scale (with 1 it is not).
  double drawn_share = 0.8;
  /// Hysteresis on strength times scale, radius (|k0| - |k1|) [-], the angle that the surface turns
  /// more across the line than along it: a line is followed while it is above `low` and kept if it
  /// is above `high` somewhere.
  double high = 0.1;
  double low = 0.03;
  double min_anisotropy = 0.2;  ///< least (|k0| - |k1|) / |k0|, in [0, 1): lines end at umbilics
  double min_sharpness = 0.1;   ///< least CrestLine::sharpness [-]
  double min_length = 8.0;      ///< shortest line kept [mean edges]
  double max_gap = 4.0;         ///< widest gap between ends that are joined [mean edges]
};

/// A point of a crest line, on an edge of the mesh.
struct CrestPoint {
  Eigen::RowVector3d position;  ///< [mu]
  EdgeCrossing edge;            ///< where on the mesh
  double level = 0.0;           ///< at which the line was drawn, possibly between two
  double scale_level = 0.0;     ///< of its scale, possibly between two
  double curvature = 0.0;       ///< k0, the principal curvature across: < 0 of a valley [1/mu]
  double strength = 0.0;        ///< radius (|k0| - |k1|) at its scale [-]
  double radius = 0.0;          ///< its scale: sqrt(tau) e [mu]
  /// -<grad e, t0> tau e^2 / |k0| at `level` [-]: about twice the share of its curvature that the
  /// surface loses from the line to a radius beside it. Where the tensor is extrapolated, tau is
  /// that of as much noise without: half that of the scale with the default drawn_share.
  double sharpness = 0.0;
  double anisotropy = 0.0;     ///< (|k0| - |k1|) / |k0| at `level` [-]
  bool is_scale_peak = false;  ///< false: the strength grows or falls over all levels searched
};

struct CrestLine {
  CrestKind kind = CrestKind::ridge;
  std::vector<CrestPoint> points;  ///< in order; a closed line repeats its first at the end
  bool is_closed = false;
  double length = 0.0;      ///< [mu]
  double strength = 0.0;    ///< mean over the length [-]
  double mean_scale = 0.0;  ///< mean radius over the length [mu]
  double sharpness = 0.0;   ///< mean over the length [-]
};

/// Crest lines of a surface, with what they were found on.
struct CrestSet {
  Status status = Status::ok;    ///< cancelled: no lines
  std::vector<CrestLine> lines;  ///< by falling strength times length
  Eigen::VectorXd tau;    ///< L scales, with that of the averaged normals [squared mean edges]
  Eigen::VectorXd level;  ///< #V: level at which each vertex was looked at
};

/// Crest lines of a surface (thesis 5.6). The curvature tensor, the symmetric gradient of the unit
/// normals, is smoothed over the levels; k0 is the principal curvature of larger magnitude and t0
/// its direction; lines are where e = <grad |k0|, t0> vanishes on edges of the mesh and |k0| is
/// largest along t0 (Eq. 5.43 with erratum E-29). The scale of a place is the first level at which
/// t^(gamma / 2) (|k0| - |k1|) has a maximum (Eq. 5.44, E-30).
///
/// Lines of all scales in one set, which the thesis leaves open: the scales of the vertices, each
/// with the square of its normalised strength for a weight, are averaged over the surface, every
/// vertex takes the tensor of its own level, and the lines are those of that one field
/// (docs/methods/crest_lines.md).
///
/// Surfaces whose principal curvatures are constant along their own lines (planes, spheres,
/// cylinders, circular tori) have no crest lines: `min_sharpness` keeps what the sampling makes
/// of them.
///
/// Same input, same bits for any number of threads.
/// @throws InvalidArgument if an option is out of range; AnalysisError E_NO_FACES for a cloud
/// Cost: nine scale spaces of `schedule` in single precision, and O(L V + F); 36 L bytes a vertex.
CrestSet find_crest_lines(const SurfaceGraph& graph, const CrestOptions& options = {},
                          RunControl run = {});

/// Throws InvalidArgument, naming field and range, unless all options are in range.
void validate(const CrestOptions& options);

}  // namespace dupin
