#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/warp_quality.h"
#include "dupin/warp/warper.h"

namespace dupin::detail {

/// Where control lines move a shape (7.3.5, 7.4.4).
struct LineWarp {
  Points2 points;                              ///< #V by 2 [px]
  std::vector<std::int32_t> still_components;  ///< that no line reaches
};

/// Moving least squares from the points of control lines between `pins`. Nothing is held: a
/// triangle may have any number of pins, and a pin off the vertices moves what is around it, not a
/// corner alone.
/// @throws InvalidArgument for a pin that is not finite or an option out of range; AnalysisError
///   E_PIN_CONFLICT; Error E_INTERRUPTED. Cost: a geodesic search a sample, at most 256 and the
///   pins.
LineWarp warp_by_lines(const PlanarMesh& rest, const PlanarGraph& graph,
                       const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                       const WarpOptions& options, RunControl run);

/// The inside of a shape whose border is where it should be.
class HeldBorder {
 public:
  /// @param rest the shape that is to stay as rigid as possible
  HeldBorder(const PlanarMesh& rest, const PlanarGraph& graph, EdgeWeights weights);

  const ArapSystem& system() const { return *system_; }
  Eigen::Index num_clamped_weights() const { return weighting_.num_clamped; }

  /// Takes fold-overs out: first with the whole border held, then, where that is not enough, with
  /// less and less of it about the fold-overs. The silhouette stays as it is elsewhere.
  PolishResult polish(const PlanarMesh& first, const Points2& deformed,
                      const PolishOptions& options, const RunControl& run) const;

 private:
  std::shared_ptr<const ArapSystem> holding(const std::vector<std::uint8_t>& is_held) const;

  const PlanarMesh& rest_;
  const PlanarGraph& graph_;
  EdgeWeighting weighting_;
  std::vector<std::uint8_t> is_border_;  // #V, and vertices without a triangle
  std::shared_ptr<const ArapSystem> system_;
};

}  // namespace dupin::detail
