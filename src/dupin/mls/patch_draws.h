#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/mls/local_scale.h"

namespace dupin::detail {

/// `beta` in axes turned by the angle whose cosine and sine are given: x = c x' - s y',
/// y = s x' + c y'.
PatchVector turned(const PatchVector& beta, double c, double s);

/// The prediction at one point for one size, and experiments that test it.
class PatchDraws {
 public:
  /// @param index, squared the neighbours, nearest first, and their squared distances
  PatchDraws(const Points& points, const Eigen::RowVector3d& r, const Eigen::RowVector3d& normal,
             std::span<const std::int32_t> index, const PatchDrawOptions& options);

  struct Outcome {
    double T_beta = 0.0;
    double T_kappa = 0.0;
    Eigen::Index rank_beta = 0;
    Eigen::Index rank_kappa = 0;
  };

  /// One experiment of M draws; cancelled: nothing. Safe to call from many threads.
  Outcome experiment(std::uint64_t seed, const RunControl& run = {}) const;

  /// Whether there is a curvature to test.
  bool can_test() const { return reference_.order >= 6; }
  const MlsPatch& reference() const { return reference_; }

 private:
  struct Prediction {
    std::vector<Eigen::Index> variables;  // that are tested
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    Eigen::VectorXd unit;  // by which a draw is divided
  };
  static Prediction predict(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance,
                            const std::vector<Eigen::Index>& variables, bool standardise);

  PatchDrawOptions options_;
  Points neighbors_;  // relative to the point
  Eigen::RowVector3d direction_;
  MlsPatch reference_;
  Prediction beta_;
  Prediction kappa_;
};

}  // namespace dupin::detail
