#include "dupin/mls/patch_fitter.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "dupin/math/symmetric3.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

constexpr std::array<int, 10> kPowerX = {0, 1, 0, 2, 1, 0, 3, 2, 1, 0};
constexpr std::array<int, 10> kPowerY = {0, 0, 1, 0, 1, 2, 0, 1, 2, 3};
// Where a coefficient of rising degree stands in Eq. 4.7.
constexpr std::array<int, 10> kThesisPlace = {9, 7, 8, 4, 5, 6, 0, 1, 2, 3};

constexpr int kMaxShiftSteps = 8;
// The shift moves the origin of the weights only; beyond this the patch no longer changes visibly.
constexpr double kShiftTolerance = 1e-4;

// A strip this narrow beside its length, squared, is a line: the heights of a cubic across it would
// be those of rounding.
constexpr double kNarrowest = 1e-12;

std::size_t degree_of(std::size_t coefficient) {
  return static_cast<std::size_t>(kPowerX[coefficient] + kPowerY[coefficient]);
}

int coefficients_of_degree(int degree) { return (degree + 1) * (degree + 2) / 2; }

}  // namespace

bool PatchFitter::start(MlsPatch& patch, const Points& points, const RowVector3d& r,
                        std::span<const std::int32_t> index, std::span<const double> squared) {
  patch.num_neighbors = static_cast<int>(index.size());
  patch.q = r;
  double largest = 0.0;
  for (const double value : squared) largest = std::max(largest, value);
  patch.radius = options_.radius > 0.0 ? options_.radius : std::sqrt(largest);
  if (largest == 0.0 || index.size() < 3) return false;
  unit_ = patch.radius;
  for (std::size_t d = 1; d < inverse_power_.size(); ++d) {
    inverse_power_[d] = inverse_power_[d - 1] / unit_;
  }
  gather(points, r, index, squared);
  weigh(0.0);
  return true;
}

MlsPatch PatchFitter::fit(const Points& points, const RowVector3d& r,
                          std::span<const std::int32_t> index, std::span<const double> squared,
                          const RowVector3d& facing, PatchParts parts) {
  MlsPatch patch;
  if (!start(patch, points, r, index, squared)) return patch;
  find_axes(patch, facing);
  enter_frame(patch);
  fit_heights(patch, parts);
  return patch;
}

MlsPatch PatchFitter::fit_over(const Points& points, const RowVector3d& r,
                               std::span<const std::int32_t> index, std::span<const double> squared,
                               const RowVector3d& normal, PatchParts parts) {
  MlsPatch patch;
  if (!start(patch, points, r, index, squared)) return patch;
  patch.n = normal;
  tangent_basis(normal, patch.u1, patch.u2);
  enter_frame(patch);
  fit_heights(patch, parts);
  return patch;
}

void PatchFitter::gather(const Points& points, const RowVector3d& r,
                         std::span<const std::int32_t> index, std::span<const double> squared) {
  count_ = static_cast<Index>(index.size());
  padded_ = (count_ + kPatchLanes - 1) / kPatchLanes * kPatchLanes;
  constexpr Index kArrays = 6 + 11;
  if (static_cast<Index>(memory_.size()) < kArrays * padded_) {
    memory_.resize(static_cast<std::size_t>(kArrays * (padded_ + padded_ / 2)));
  }
  double* next = memory_.data();
  for (double** array : {&dx_, &dy_, &dz_, &squared_, &along_, &weight_, &scratch_}) {
    *array = next;
    next += padded_;
  }
  const double inverse = 1.0 / unit_;
  for (Index i = 0; i < count_; ++i) {
    const double* const p =
        points.data() + 3 * static_cast<Index>(index[static_cast<std::size_t>(i)]);
    dx_[i] = (p[0] - r[0]) * inverse;
    dy_[i] = (p[1] - r[1]) * inverse;
    dz_[i] = (p[2] - r[2]) * inverse;
    squared_[i] = squared[static_cast<std::size_t>(i)] * inverse * inverse;
  }
  for (double* array : {dx_, dy_, dz_, squared_, along_, weight_}) {
    std::fill(array + count_, array + padded_, 0.0);
  }
}

// Weights about r - shift n: |p - q|^2 = |p - r|^2 + 2 t n.(p - r) + t^2.
void PatchFitter::weigh(double shift) {
  if (options_.weight == MlsWeight::uniform) {
    std::fill(weight_, weight_ + count_, 1.0);
    return;
  }
  // exp(-700) and less is nothing; a width that small leaves the point alone.
  const double scale = 1.0 / (options_.weight_width * options_.weight_width);
  double* const distance = scratch_;
  for (Index i = 0; i < padded_; ++i) {
    const double moved = squared_[i] + shift * (2.0 * along_[i] + shift);
    distance[i] = std::min(std::max(moved, 0.0), 700.0 / scale);
  }
  gaussian_weights(padded_, distance, scale, weight_);
  std::fill(weight_ + count_, weight_ + padded_, 0.0);
}

// Smallest principal axis of the weighted neighbourhood.
void PatchFitter::find_axes(MlsPatch& patch, const RowVector3d& facing) const {
  double sum = 0.0;
  RowVector3d mean = RowVector3d::Zero();
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
  for (Index i = 0; i < count_; ++i) {
    const double w = weight_[i];
    const double wx = w * dx_[i];
    const double wy = w * dy_[i];
    const double wz = w * dz_[i];
    sum += w;
    mean += RowVector3d(wx, wy, wz);
    xx += wx * dx_[i];
    xy += wx * dy_[i];
    xz += wx * dz_[i];
    yy += wy * dy_[i];
    yz += wy * dz_[i];
    zz += wz * dz_[i];
  }
  Eigen::Matrix3d scatter;
  scatter << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  if (options_.centre_on_mean) scatter -= mean.transpose() * mean / sum;
  const SymmetricEigen3 axes = eigen_symmetric(scatter);
  patch.n = axes.vectors.col(0).transpose();
  if (patch.n.dot(facing) < 0.0) patch.n = -patch.n;
  patch.u1 = axes.vectors.col(2).transpose();
  patch.u2 = patch.n.cross(patch.u1);
}

// Signed distances from the plane, the shift, and the coordinates in the frame.
void PatchFitter::enter_frame(MlsPatch& patch) {
  for (Index i = 0; i < count_; ++i) {
    along_[i] = patch.n[0] * dx_[i] + patch.n[1] * dy_[i] + patch.n[2] * dz_[i];
  }
  const double shift = find_shift();
  patch.t = shift * unit_;
  patch.q -= patch.t * patch.n;
  for (Index i = 0; i < count_; ++i) {
    const double x = patch.u1[0] * dx_[i] + patch.u1[1] * dy_[i] + patch.u1[2] * dz_[i];
    const double y = patch.u2[0] * dx_[i] + patch.u2[1] * dy_[i] + patch.u2[2] * dz_[i];
    dx_[i] = x;
    dy_[i] = y;
    dz_[i] = along_[i] + shift;
  }
}

// Stationary point of Eq. 4.2 nearest to t = 0, by Newton's method: with s = n.(p - r) + t and
// phi = exp(-|p - q|^2 / width^2), E' / 2 = sum phi s (1 - s^2 / width^2).
double PatchFitter::find_shift() {
  const bool is_uniform = options_.weight == MlsWeight::uniform;
  const double width = is_uniform ? 1.0 : options_.weight_width;
  const double inverse = is_uniform ? 0.0 : 1.0 / (width * width);
  const double most = 0.5 * std::min(width, 1.0);
  double shift = 0.0;
  for (int step = 0; step < kMaxShiftSteps; ++step) {
    double slope = 0.0;
    double curvature = 0.0;
    for (Index i = 0; i < count_; ++i) {
      const double s = along_[i] + shift;
      const double z = s * s * inverse;
      slope += weight_[i] * s * (1.0 - z);
      curvature += weight_[i] * (1.0 - 3.0 * z - 2.0 * z * (1.0 - z));
    }
    if (!(curvature > 0.0)) break;
    const double next = std::clamp(shift - slope / curvature, -most, most);
    const double change = std::abs(next - shift);
    shift = next;
    if (change == 0.0 || is_uniform) break;
    weigh(shift);
    if (change < kShiftTolerance * width) break;
  }
  return shift;
}

// Factor of the normal matrix with its diagonal scaled to 1: a pivot is the part of a column that
// the columns before it leave unexplained. Returns the order that the pivots allow.
int PatchFitter::factorise(const PatchMoments& moments, int wanted, Factor& factor,
                           Ordered& scale) const {
  const auto entry = [&](int i, int j) {
    return moments
        .weight[kPowerX[static_cast<std::size_t>(i)] + kPowerX[static_cast<std::size_t>(j)]]
               [kPowerY[static_cast<std::size_t>(i)] + kPowerY[static_cast<std::size_t>(j)]];
  };
  int complete = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(wanted); ++i) {
    const double diagonal = entry(static_cast<int>(i), static_cast<int>(i));
    if (!(diagonal > (i == 2 ? kNarrowest * entry(1, 1) : 0.0))) return complete;
    scale[i] = 1.0 / std::sqrt(diagonal);
    double pivot = 1.0;
    for (std::size_t j = 0; j < i; ++j) {
      double sum = entry(static_cast<int>(i), static_cast<int>(j)) * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) sum -= factor[i][k] * factor[j][k];
      factor[i][j] = sum * factor[j][j];
      pivot -= factor[i][j] * factor[i][j];
    }
    if (!(pivot > options_.rank_tolerance)) return complete;
    factor[i][i] = 1.0 / std::sqrt(pivot);  // the inverse: it is only ever multiplied with
    if (i == 2 || i == 5 || i == 9) complete = static_cast<int>(i) + 1;
  }
  return complete;
}

void PatchFitter::fit_heights(MlsPatch& patch, PatchParts parts) {
  PatchMoments moments;
  const bool want_squared =
      parts != PatchParts::coefficients && options_.weight != MlsWeight::uniform;
  sum_moments(padded_, dx_, dy_, dz_, weight_, want_squared, scratch_, moments);
  int wanted = coefficients_of_degree(options_.degree);
  while (wanted > 3 && count_ < wanted) wanted = wanted == 10 ? 6 : 3;
  Factor factor;
  Ordered scale;
  patch.order = factorise(moments, wanted, factor, scale);
  const auto order = static_cast<std::size_t>(patch.order);
  Ordered solution{};
  for (std::size_t i = 0; i < order; ++i) {
    double sum = moments.height[kPowerX[i]][kPowerY[i]] * scale[i];
    for (std::size_t k = 0; k < i; ++k) sum -= factor[i][k] * solution[k];
    solution[i] = sum * factor[i][i];
  }
  for (std::size_t i = order; i-- > 0;) {
    double sum = solution[i];
    for (std::size_t k = i + 1; k < order; ++k) sum -= factor[k][i] * solution[k];
    solution[i] = sum * factor[i][i];
  }
  for (std::size_t i = 0; i < order; ++i) {
    solution[i] *= scale[i];
    patch.beta[kThesisPlace[i]] = solution[i] * unit_ * inverse_power_[degree_of(i)];
  }
  if (parts != PatchParts::coefficients && order > 0) {
    measure(moments, solution, factor, scale, parts, patch);
  }
}

// sum w (h - g(x, y))^2, from the residuals themselves: the difference of sums would lose noise
// that is small beside the heights.
double PatchFitter::residual(const Ordered& s) const {
  double sum = 0.0;
  for (Index i = 0; i < count_; ++i) {
    const double x = dx_[i];
    const double y = dy_[i];
    const double g = s[0] + x * (s[1] + x * (s[3] + x * s[6])) +
                     y * (s[2] + x * (s[4] + x * s[7]) + y * (s[5] + x * s[8] + y * s[9]));
    const double xi = dz_[i] - g;
    sum += weight_[i] * xi * xi;
  }
  return sum;
}

// Rows of a matrix at once: x <- L^-1 x, x <- L^-T x. Entries beyond the order are 0 and stay 0.
void PatchFitter::solve_lower(const Factor& factor, std::size_t order, Factor& x) {
  for (std::size_t i = 0; i < order; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      for (std::size_t j = 0; j < 10; ++j) x[i][j] -= factor[i][k] * x[k][j];
    }
    for (std::size_t j = 0; j < 10; ++j) x[i][j] *= factor[i][i];
  }
}

void PatchFitter::solve_upper(const Factor& factor, std::size_t order, Factor& x) {
  for (std::size_t i = order; i-- > 0;) {
    for (std::size_t k = i + 1; k < order; ++k) {
      for (std::size_t j = 0; j < 10; ++j) x[i][j] -= factor[k][i] * x[k][j];
    }
    for (std::size_t j = 0; j < 10; ++j) x[i][j] *= factor[i][i];
  }
}

void PatchFitter::transpose(Factor& x) {
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t j = 0; j < i; ++j) std::swap(x[i][j], x[j][i]);
  }
}

// With S2 = A^T W^2 A the covariance is L^-T (L^-1 S2 L^-T) L^-1 in scaled coefficients, and the
// degrees of freedom lack the trace of its middle part (E-6).
void PatchFitter::measure(const PatchMoments& moments, const Ordered& solution,
                          const Factor& factor, const Ordered& scale, PatchParts parts,
                          MlsPatch& patch) {
  const auto order = static_cast<std::size_t>(patch.order);
  Factor middle{};
  double trace = static_cast<double>(order);
  double total = static_cast<double>(count_);
  if (options_.weight == MlsWeight::uniform) {
    for (std::size_t i = 0; i < order; ++i) middle[i][i] = 1.0;
  } else {
    total = moments.weight[0][0];
    for (std::size_t i = 0; i < order; ++i) {
      for (std::size_t j = 0; j < order; ++j) {
        middle[i][j] =
            moments.squared[kPowerX[i] + kPowerX[j]][kPowerY[i] + kPowerY[j]] * scale[i] * scale[j];
      }
    }
    solve_lower(factor, order, middle);
    transpose(middle);
    solve_lower(factor, order, middle);
    trace = 0.0;
    for (std::size_t i = 0; i < order; ++i) trace += middle[i][i];
  }
  // As many points as coefficients leave nothing but rounding.
  patch.dof = count_ > patch.order ? std::max(0.0, total - trace) : 0.0;
  if (patch.dof > 1e-6 * total) {
    patch.variance = residual(solution) / patch.dof * unit_ * unit_;
  } else {
    patch.dof = 0.0;
  }
  if (parts != PatchParts::covariance) return;
  solve_upper(factor, order, middle);
  transpose(middle);
  solve_upper(factor, order, middle);
  for (std::size_t i = 0; i < order; ++i) {
    for (std::size_t j = 0; j < order; ++j) {
      const double units = inverse_power_[degree_of(i)] * inverse_power_[degree_of(j)];
      // Symmetric but for rounding, which grows with the condition.
      patch.unit_covariance(kThesisPlace[i], kThesisPlace[j]) =
          0.5 * (middle[i][j] + middle[j][i]) * scale[i] * scale[j] * units;
    }
  }
}

}  // namespace dupin::detail
