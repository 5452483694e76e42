#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mls/mls_patch.h"
#include "dupin/stats/likelihood_ratio.h"

namespace dupin {

/// How the neighbours of a point are moved in a draw.
enum class PatchNoise {
  directional,  ///< all along one line, the outward normal at the point (Eq. 4.51)
  isotropic     ///< independently along x, y and z
};

/// Draws of a noisy patch and their comparison with first-order error propagation (thesis 4.3.1).
///
/// The given points count as free of noise. Their patch at the point predicts the coefficients and
/// (K, H) with covariances (Eqs. 4.30, 4.37); M patches of noisy copies of the same neighbours are
/// a sample; the likelihood-ratio test compares. That is one experiment; there are L of them.
struct PatchDrawOptions {
  double sigma = 0.0;  ///< standard deviation of the noise, > 0 [mu]
  PatchNoise noise = PatchNoise::directional;
  int realisations = 100;  ///< M, draws of an experiment; >= 5 times the coefficients tested
  int experiments = 20;    ///< L >= 1; for Kolmogorov's test >= 5
  /// Of the patches. `neighbors` is not used; `radius` must be 0.
  MlsOptions patch = {};
  /// The plane is fitted anew in every draw, as an estimate does it; else it stays that of the
  /// points without noise, and the coefficients are linear in the noise. The axes in the plane are
  /// carried over from the points without noise in both cases, since they are arbitrary.
  bool refit_plane = true;
  /// Also the constant and linear coefficients. A plane that is fitted anew absorbs them, so that
  /// their prediction, which holds for a fixed plane, must fail.
  bool test_all_coefficients = false;
  /// Every variable divided by its predicted deviation, so that no unit enters. A variable whose
  /// prediction vanishes to first order is left out: K on a plane.
  bool standardise = true;
  LikelihoodRatioOptions beta_test = {1e-8, 0.0};   ///< of the coefficients
  LikelihoodRatioOptions kappa_test = {1e-2, 0.0};  ///< of (K, H): one variable near an umbilic
  /// Critical values of 65 and 5 degrees of freedom whatever the rank, as the thesis has it;
  /// else K (K + 1) / 2 + K of the rank K in use.
  bool thesis_dof = false;
  double significance = 0.05;  ///< in (0, 1)
  std::uint64_t seed = 0;
};

/// What reproduces the tables of section 4.3.2: uniform weights, all coefficients in units of the
/// input, eigenvalues below 1e-3 dropped, 65 and 5 degrees of freedom, M = L = 100 (erratum E-15).
/// Depends on the unit of length; for surfaces of about unit size.
PatchDrawOptions thesis_patch_draws(double sigma);

/// The test of one neighbourhood size: means and deviations over the experiments.
struct ScaleTest {
  int neighbors = 0;
  double radius = 0.0;          ///< of the neighbourhood without noise [mu]
  int order = 0;                ///< of its patch; below 6 there is no curvature and no test
  Eigen::Index rank_beta = 0;   ///< eigenvalues in use; 0: nothing to test, not passed
  Eigen::Index rank_kappa = 0;  ///< of at most 2
  double T_beta = 0.0;          ///< mean of T over the experiments; infinite if one is
  double T_beta_sd = 0.0;
  double T_kappa = 0.0;
  double T_kappa_sd = 0.0;
  double critical_beta = 0.0;  ///< the means must not exceed
  double critical_kappa = 0.0;
  bool passed = false;
};

/// Options of find_local_scale().
struct LocalScaleOptions {
  PatchDrawOptions draws = {};
  /// Neighbourhood sizes, growing, each >= 10; empty: 30, 40, ..., 300. Sizes beyond the number of
  /// points are left out.
  std::vector<int> sizes = {};
  bool stop_at_first_pass = true;  ///< else every size is tested
};

/// The scale of a point.
struct LocalScale {
  Status status = Status::ok;    ///< cancelled: nothing is valid
  std::vector<ScaleTest> tests;  ///< of the sizes that were tried, in their order
  int chosen = -1;               ///< index of the first size that passed; -1: no size passes

  bool passed() const { return chosen >= 0; }
  /// The chosen test, or the last one if no size passes.
  const ScaleTest& test() const {
    return chosen >= 0 ? tests[static_cast<std::size_t>(chosen)] : tests.back();
  }
};

/// The smallest neighbourhood at `vertex` for which the predicted covariances of the coefficients
/// and of (K, H) hold: both mean test statistics at most the critical value (thesis 4.3.2). No size
/// may pass: then the noise is too high for curvature with known uncertainty.
/// @param normal outward at the point, or zero: that of the patch. Direction of the noise.
/// @throws InvalidArgument if an option is out of range, M is below 5 times the variables, a
///   coordinate is not finite or vertex is out of range
/// @throws AnalysisError E_TOO_FEW_POINTS if there are fewer points than the smallest size
/// Cost: O(V log V) and M L patches for each size. Same bits for any number of threads.
LocalScale find_local_scale(const Points& points, Eigen::Index vertex,
                            const Eigen::RowVector3d& normal, const LocalScaleOptions& options,
                            RunControl run = {});

/// Scales of many points.
struct LocalScaleField {
  Status status = Status::ok;
  std::vector<std::int32_t> vertices;
  std::vector<LocalScale> scales;  ///< one for each of `vertices`
};

/// find_local_scale() at each of `vertices` (empty: all); bit for bit what it returns.
/// @param normals #V by 3, or 0 by 3: those of the patches
/// @throws as find_local_scale(), and InvalidArgument if the number of normals is another
LocalScaleField find_local_scales(const Points& points, const Points& normals,
                                  const std::vector<std::int32_t>& vertices,
                                  const LocalScaleOptions& options, RunControl run = {});

/// Test statistics of one neighbourhood size against their distribution (thesis 4.3.1).
struct PatchValidation {
  Status status = Status::ok;
  ScaleTest test;
  Eigen::VectorXd T_beta;        ///< L values
  Eigen::VectorXd T_kappa;       ///< L values
  double dof_beta = 0.0;         ///< of the chi-square that they are compared with
  double dof_kappa = 0.0;        ///< 0: nothing to test, ks_kappa is 1
  double ks_beta = 1.0;          ///< Kolmogorov's D of T_beta
  double ks_kappa = 1.0;         ///< and of T_kappa
  double ks_critical = 0.0;      ///< for L values and the significance: .134 for 100 and .05
  double ks_critical_two = 0.0;  ///< for two samples of L, which the thesis prints: .19
};

/// The protocol of section 4.3.1 at one point and size. It holds where the fit is linear in the
/// noise and fails for neighbourhoods so small that the curvature is not.
/// @throws as find_local_scale(), and InvalidArgument unless L >= 5
PatchValidation validate_patch_statistics(const Points& points, Eigen::Index vertex,
                                          const Eigen::RowVector3d& normal, int neighbors,
                                          const PatchDrawOptions& options, RunControl run = {});

/// Type of a point by its curvature (thesis 4.3.2, Fig. 4.10).
enum class PointType {
  planar,      ///< K = 0 and H = 0
  parabolic,   ///< K = 0, H not
  elliptic,    ///< K > 0
  hyperbolic,  ///< K < 0
};

/// Type from K [1/mu^2] and H [1/mu] with their standard deviations: a value counts as zero within
/// `tolerance` deviations of it. Where K does, H decides between parabolic and planar.
/// @throws InvalidArgument if a value is not finite, a deviation or the tolerance negative
PointType classify_point(double gauss, double mean, double gauss_sd, double mean_sd,
                         double tolerance = 2.0);

/// "planar", "parabolic", "elliptic" or "hyperbolic".
const char* point_type_name(PointType type);

}  // namespace dupin
