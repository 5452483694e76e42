#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin {

enum class MlsKind {
  rigid,       ///< rotation and translation at every vertex (Eq. 7.2 to 7.13)
  similarity,  ///< with one factor of scale
  affine,      ///< any linear map; a similarity where the controls lie on a line
};

enum class MlsFalloff {
  power,  ///< theta = d^-alpha
  csch,   ///< theta = 1 / sinh(d / scale): faster than any power; the thesis found it unstable
};

struct MlsWarpOptions {
  MlsKind kind = MlsKind::rigid;
  MlsFalloff falloff = MlsFalloff::power;
  double alpha = 2.0;     ///< exponent of `power`, in (0, 20] [-]
  double scale_px = 0.0;  ///< length of `csch`, >= 0 [px]; 0: a tenth of the box of the sources
};

/// A place on the straight line from control `first` to control `second`. A control itself has
/// first = second, t = 0.
struct ControlSample {
  std::int32_t first = 0;
  std::int32_t second = 0;
  double t = 0.0;
};

/// Moving least squares with everything that does not depend on the targets computed beforehand
/// (Alg. 2): a drag is one weighted sum a vertex (Alg. 5). Samples of control lines move linearly
/// with their two ends, so that their sums fold into those of the controls: a line costs nothing
/// while dragging.
class MlsWarp {
 public:
  /// @param rest      #V by 2 vertices [px]
  /// @param sources   #M by 2 controls at rest [px]
  /// @param samples   #S places that act, each with the weight `weights` > 0 (#S) [-]
  /// @param distances #V by #S [px], infinity where a sample does not act: geodesic for the
  ///   object-space deformation, Euclidean for the image-space one; below 1e-12 box diagonals a
  ///   vertex takes the target of the sample (erratum E-42)
  /// @param radius    #M lengths [px]: how much of a shape takes part in the rotation of a control
  /// @throws InvalidArgument if sizes do not fit, an index or option is out of range, a number is
  ///   NaN; Error E_INTERRUPTED if cancelled. Cost: O(V S).
  MlsWarp(const Points2& rest, const Points2& sources, const std::vector<ControlSample>& samples,
          const Eigen::VectorXd& weights, const Eigen::MatrixXd& distances,
          const Eigen::VectorXd& radius, const MlsWarpOptions& options = {},
          const RunControl& run = {});

  /// Vertices for controls at `targets` (#M by 2) [px]. `rotations` [rad, from x to y] has #M
  /// entries or none; a NaN entry means that the control does not say. Vertices that no sample
  /// reaches stay. Where the targets determine no rotation (one control, all at one place,
  /// mirrored) the vertex is translated (errata list 3). Bits do not depend on threads.
  /// Cost: O(V M). @throws InvalidArgument if a size does not fit
  Points2 deform(const Points2& targets, const Eigen::VectorXd& rotations = {}) const;

  Eigen::Index num_controls() const { return num_controls_; }

  /// #V by #M normalised weights theta / sum theta; rows of vertices that nothing reaches are 0.
  Eigen::MatrixXd weights() const;

 private:
  void precompute_vertex(Eigen::Index v, const Points2& rest, const Points2& places,
                         const std::vector<ControlSample>& samples, const Eigen::VectorXd& weights,
                         const Eigen::MatrixXd& distances, double floor_px, double scale_px);

  MlsWarpOptions options_;
  Eigen::Index num_vertices_ = 0;
  Eigen::Index num_controls_ = 0;
  Eigen::RowVector2d origin_ = Eigen::RowVector2d::Zero();
  Points2 rest_;  // about origin_
  Points2 sources_;
  Points2 arm_;                 // #V by 2: p_n - a-bar
  Eigen::VectorXd inverse_;     // #V: 1 / sum theta |a-hat|^2, or 1 where that is zero
  Eigen::VectorXd is_turning_;  // #V: 1 where the controls determine a rotation, else 0
  Eigen::VectorXd size_;        // #V: sum of the moduli of the coefficients
  Eigen::VectorXd radius_;      // #M
  std::vector<double> table_;   // blocks of kBlock vertices: [control][w, c, s][vertex]
};

}  // namespace dupin
