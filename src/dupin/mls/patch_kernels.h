#pragma once

#include <Eigen/Core>

namespace dupin::detail {

/// The arrays of a neighbourhood have whole blocks of so many entries; those beyond the last
/// neighbour have weight 0.
inline constexpr Eigen::Index kPatchLanes = 4;

/// Highest degree of a moment: the product of two cubic columns.
inline constexpr int kMomentDegree = 6;
inline constexpr int kHeightDegree = 3;

/// Sums over the neighbours: weight[a][b] = sum w x^a y^b, and with w h and w^2.
struct PatchMoments {
  double weight[kMomentDegree + 1][kMomentDegree + 1] = {};
  double height[kHeightDegree + 1][kHeightDegree + 1] = {};
  double squared[kMomentDegree + 1][kMomentDegree + 1] = {};  ///< only if asked for
};

/// `scratch` holds 11 `count` doubles. Same bits for every instruction set.
void sum_moments(Eigen::Index count, const double* x, const double* y, const double* h,
                 const double* w, bool want_squared, double* scratch, PatchMoments& moments);

/// out_i = exp(-z_i) with z_i = squared_i * scale in [0, 700]; relative error below 1e-15.
void gaussian_weights(Eigen::Index count, const double* squared, double scale, double* out);

}  // namespace dupin::detail
