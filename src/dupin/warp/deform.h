#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/warp/warp_quality.h"
#include "dupin/warp/warper.h"

namespace dupin {

enum class DeformMode {
  coarse,  ///< pins inside the shape: moving least squares, then ARAP (7.4.3)
  fine,    ///< exterior points joined to control lines: moving least squares (7.4.4); nothing is
           ///< held, so that a triangle may have any number of them
};

/// One step of an edit. Its sources lie on the shape as the steps before left it (P := Q, 7.4.4),
/// so that the list of steps, not the last pins, is the edit.
struct DeformStage {
  DeformMode mode = DeformMode::coarse;
  std::vector<Pin> pins;
  std::vector<ControlLine> lines;  ///< (fine) empty: each pin to the next, the last to the first
};

struct DeformOptions {
  WarpOptions warp;
  int fine_iterations = 0;  ///< ARAP iterations of a fine stage, >= 0; they hold the border where
                            ///< its lines put it
  bool is_polished = true;  ///< take fold-overs out after every stage: a coarse one holds its pins,
                            ///< a fine one the border, as far as it is not folded itself
  PolishOptions polish;
};

/// How one stage went.
struct StageReport {
  int iterations = 0;
  std::vector<double> energy;  ///< before each iteration and after the last; never rises
  bool is_converged = true;    ///< warp.tolerance was reached, or 0
  double seconds_per_iteration = 0.0;
  double seconds_to_prepare = 0.0;         ///< distances, tables, factor
  double largest_violation_px = 0.0;       ///< (coarse) of a held place
  Eigen::Index flipped_before_polish = 0;  ///< against the shape at rest of this stage
  int polish_iterations = 0;
  std::vector<std::int32_t> still_components;  ///< parts without a pin, left where they were
};

struct Deformation {
  Status status = Status::ok;  ///< cancelled: num_done stages are in `points`; not_converged
  std::size_t num_done = 0;
  Points2 points;                         ///< #V by 2 [px]
  Eigen::VectorXd depth;                  ///< #V from the last coarse stage; larger is nearer
  std::vector<std::int32_t> paint_order;  ///< #F triangles, farthest first
  WarpQuality quality;                    ///< against the mesh that was given
  std::vector<StageReport> stages;
  WarningList warnings;  ///< W_COMPONENT_UNANCHORED, W_FOLD_OVER, W_PIN_REPEATED,
                         ///< W_WEIGHT_CLAMPED
};

/// The shape after all stages. A stage without pins changes nothing.
/// @throws as Warper, naming pins; E_INTERRUPTED is not thrown but Status::cancelled.
Deformation deform(const PlanarMesh& mesh, const std::vector<DeformStage>& stages,
                   const DeformOptions& options = {}, RunControl run = {});

/// One coarse stage.
Deformation deform(const PlanarMesh& mesh, const std::vector<Pin>& pins,
                   const DeformOptions& options = {}, RunControl run = {});

}  // namespace dupin
