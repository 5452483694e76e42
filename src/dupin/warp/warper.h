#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/arap.h"
#include "dupin/warp/mls_warp.h"
#include "dupin/warp/planar_geodesics.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// A control point. Positions are pixels, x right, y down; angles turn from x towards y.
struct Pin {
  std::string name;                                  ///< for messages
  Eigen::Vector2d source = Eigen::Vector2d::Zero();  ///< on the shape at rest [px]
  Eigen::Vector2d target = Eigen::Vector2d::Zero();  ///< [px]
  std::optional<double> rotation;                    ///< [rad]; absent: the deformation decides
  double depth = 0.0;                                ///< larger is nearer to the viewer
  double radius = 0.0;              ///< [px] >= 0, inside the shape: what is held rigidly with a
                                    ///< rotation, and stiffened without one
  double weight = 1.0;              ///< > 0: factor of theta [-]
  std::optional<MeshPoint> anchor;  ///< where `source` is on the mesh, if that is known: on a shape
                                    ///< that overlaps itself a place can be two. The motion
                                    ///< from `source` to `target` is applied at the anchor
};

/// A straight piece of the control polyline, between two pins.
struct ControlLine {
  std::int32_t first = 0;
  std::int32_t second = 0;
};

enum class WarpMetric {
  geodesic,   ///< inside the shape, exact
  edges,      ///< inside the shape along edges: the thesis's
  euclidean,  ///< through anything: image-space deformation, for comparison
};

enum class RotationMode {
  held,    ///< the ring (or radius) of a pin with a rotation is held rigidly at its angle
  thesis,  ///< 7.3.3: the angle gives the start only, vertices with small residuals are frozen
};

struct WarpOptions {
  MlsWarpOptions mls;
  WarpMetric metric = WarpMetric::geodesic;
  EdgeWeights edge_weights = EdgeWeights::uniform;
  double beta = 4.0;       ///< vertex weight at pins, half of it on their rings, >= 1 (Alg. 3) [-]
  int iterations = 10;     ///< ARAP iterations, >= 0; 0: moving least squares alone
  double tolerance = 0.0;  ///< in [0, 1): stop when an iteration lowers E by less than that share
                           ///< of it; 0: do all iterations [-]
  RotationMode rotation = RotationMode::held;
  int rotation_iterations = 6;    ///< K of 7.3.3, >= 1
  double frozen_residual = 1e-6;  ///< epsilon of 7.3.3 over sum w |p_k - p_n|^2, >= 0 [-]
  double line_spacing_px = 0.0;   ///< of samples on control lines, >= 0; 0: the mean edge, at most
                                  ///< 256 samples in all [px]
  bool is_unanchored_allowed =
      true;  ///< false: E_COMPONENT_UNANCHORED where it would be left still
};

/// What a drag did.
struct WarpStep {
  Points2 points;              ///< #V by 2 [px]
  std::vector<double> energy;  ///< E before every iteration and, with a tolerance or `measure`,
                               ///< after the last; never rises
  int iterations = 0;
  bool is_converged = true;  ///< false: `tolerance` was not reached
  double seconds_per_iteration = 0.0;
};

/// All that depends on the sources of a set of pins alone (insert/delete mode, 7.4.2): distances,
/// moving-least-squares tables, and one factor of the ARAP system. While dragging it is constant.
class Warper {
 public:
  /// @param mesh the shape at rest
  /// @param lines pieces of a control polyline between pins; its pins may lie outside the shape and
  ///   are then not held by ARAP
  /// @throws InvalidArgument if the mesh is broken, a pin is not finite, or an option is outside
  /// its
  ///   range; AnalysisError E_PIN_OUTSIDE, E_PIN_CONFLICT (two pins at one place), E_PINS_CROWDED,
  ///   E_COMPONENT_UNANCHORED; Error E_INTERRUPTED if cancelled.
  /// Cost: a geodesic search a pin and one sparse Cholesky.
  Warper(const PlanarMesh& mesh, const std::vector<Pin>& pins,
         const std::vector<ControlLine>& lines = {}, const WarpOptions& options = {},
         RunControl run = {});

  /// The deformation for pins at `targets` (#M by 2) and `rotations` (#M or none [rad]; those of
  /// pins without a rotation at construction are not looked at). Starts from the moving least
  /// squares, so that it does not depend on the drags before. With `measure` E is also taken at the
  /// end. Bits do not depend on threads. @throws InvalidArgument if a size does not fit or a number
  /// is not finite; Error E_INTERRUPTED if cancelled, which is looked at before every iteration.
  WarpStep drag(const Points2& targets, const Eigen::VectorXd& rotations = {}, bool measure = false,
                const RunControl& run = {}) const;

  /// The targets and rotations that the pins were given.
  Points2 targets() const { return targets_; }
  Eigen::VectorXd rotations() const { return rotations_; }

  /// #V: depth from those of the pins.
  Eigen::VectorXd depth(const Eigen::VectorXd& depths) const;

  /// Where the pins are on the mesh; triangle -1 outside.
  const std::vector<MeshPoint>& places() const { return places_; }
  /// Components without a pin, by number: they stay where they are.
  const std::vector<std::int32_t>& still_components() const { return still_components_; }
  const PlanarGraph& graph() const { return *graph_; }
  const ArapSystem& arap() const { return *arap_; }
  Eigen::Index num_clamped_weights() const { return weighting_.num_clamped; }
  /// Largest distance of a held place from where it should be [px].
  double largest_violation(const Points2& q, const Points2& targets,
                           const Eigen::VectorXd& rotations) const;

 private:
  struct Held {
    std::int32_t vertex;
    std::int32_t pin;
    Eigen::RowVector2d offset;
  };

  void place_pins(const std::vector<Pin>& pins, bool may_be_outside);
  void prepare_mls(const std::vector<Pin>& pins, const std::vector<ControlLine>& lines,
                   RunControl run);
  void prepare_arap(const std::vector<Pin>& pins, const RunControl& run);
  std::vector<Held> held_rings(const std::vector<Pin>& pins) const;
  Eigen::VectorXd vertex_weights(const std::vector<Pin>& pins) const;
  Points2 constraint_values(const Points2& start, const Points2& targets,
                            const Eigen::VectorXd& rotations) const;
  Points2 nearest_pin_start(const Points2& targets, const Eigen::VectorXd& rotations) const;
  WarpStep drag_as_thesis(const Points2& targets, const Eigen::VectorXd& rotations, bool measure,
                          const RunControl& run) const;
  void iterate(WarpStep& step, bool measure, const RunControl& run) const;

  PlanarMesh mesh_;
  WarpOptions options_;
  std::shared_ptr<const PlanarGraph> graph_;
  Points2 sources_;
  Points2 targets_;
  Eigen::VectorXd rotations_;  // NaN: none
  std::vector<MeshPoint> places_;
  std::vector<std::int32_t> still_components_;
  std::vector<std::uint8_t> is_still_;  // by component
  Eigen::MatrixXd pin_distance_;        // #V by #M
  std::shared_ptr<const MlsWarp> mls_;
  EdgeWeighting weighting_;
  Eigen::VectorXd vertex_weight_;
  std::vector<PlaceConstraint> rows_;  // pins, then held vertices, then still ones
  std::vector<std::int32_t> row_pin_;  // pin of the rows of pins
  std::vector<Held> held_;
  LinearConstraints constraints_;
  std::shared_ptr<const ArapSystem> arap_;
};

}  // namespace dupin
