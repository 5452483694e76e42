#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dupin/mls/mls_patch.h"
#include "dupin/mls/patch_kernels.h"

namespace dupin::detail {

/// What a fit is asked for besides the coefficients.
enum class PatchParts {
  coefficients,  ///< beta alone
  variance,      ///< and the variance of the noise
  covariance     ///< and the covariance of beta
};

/// Fits patches one after another in the same memory. Not to be shared between threads.
class PatchFitter {
 public:
  explicit PatchFitter(const MlsOptions& options) : options_(options) {}

  /// @param squared |p_i - r|^2 of the neighbours points.row(index[i]) [mu^2]
  MlsPatch fit(const Points& points, const Eigen::RowVector3d& r,
               std::span<const std::int32_t> index, std::span<const double> squared,
               const Eigen::RowVector3d& facing, PatchParts parts);

  /// The same over a given plane: `normal` is taken as it is.
  MlsPatch fit_over(const Points& points, const Eigen::RowVector3d& r,
                    std::span<const std::int32_t> index, std::span<const double> squared,
                    const Eigen::RowVector3d& normal, PatchParts parts);

 private:
  // Coefficients by rising degree, so that the factor of a lower order leads that of a higher one:
  // 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3.
  using Ordered = std::array<double, 10>;
  using Factor = std::array<std::array<double, 10>, 10>;

  void gather(const Points& points, const Eigen::RowVector3d& r,
              std::span<const std::int32_t> index, std::span<const double> squared);
  void weigh(double shift);
  bool start(MlsPatch& patch, const Points& points, const Eigen::RowVector3d& r,
             std::span<const std::int32_t> index, std::span<const double> squared);
  void find_axes(MlsPatch& patch, const Eigen::RowVector3d& facing) const;
  void enter_frame(MlsPatch& patch);
  double find_shift();
  void fit_heights(MlsPatch& patch, PatchParts parts);
  int factorise(const PatchMoments& moments, int wanted, Factor& factor, Ordered& scale) const;
  void measure(const PatchMoments& moments, const Ordered& solution, const Factor& factor,
               const Ordered& scale, PatchParts parts, MlsPatch& patch);
  static void solve_lower(const Factor& factor, std::size_t order, Factor& x);
  static void solve_upper(const Factor& factor, std::size_t order, Factor& x);
  static void transpose(Factor& x);
  double residual(const Ordered& solution) const;

  MlsOptions options_;
  Eigen::Index count_ = 0;   // neighbours
  Eigen::Index padded_ = 0;  // rounded up to whole blocks
  double unit_ = 1.0;        // radius: everything below is divided by it [mu]
  std::array<double, 4> inverse_power_ = {1.0, 1.0, 1.0, 1.0};  // unit^-d
  std::vector<double> memory_;
  double* dx_ = nullptr;  // neighbours relative to r, then in the frame of the patch: x, y, h
  double* dy_ = nullptr;
  double* dz_ = nullptr;
  double* squared_ = nullptr;
  double* along_ = nullptr;  // n . (p - r)
  double* weight_ = nullptr;
  double* scratch_ = nullptr;
};

}  // namespace dupin::detail
