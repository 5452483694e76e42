#include "dupin/registration/surface_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/registration/grid_cells.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::size_t;

void check(const Points& points, const Points& normals, const SurfaceSampleOptions& options) {
  if (normals.rows() != points.rows()) {
    throw InvalidArgument("there are " + std::to_string(points.rows()) + " points and " +
                          std::to_string(normals.rows()) + " normals");
  }
  for (const double value : {options.spacing, options.radius}) {
    if (!std::isfinite(value) || !(value > 0.0))
      throw InvalidArgument("spacing and radius must be finite and > 0");
  }
}

// The point nearest to the centre of every occupied cell, by cell.
std::vector<std::int32_t> thin(const Points& points, double spacing) {
  const detail::GridCells cells = detail::grid_cells(points, spacing);
  std::vector<std::int32_t> kept(static_cast<size_t>(cells.count), -1);
  for (size_t i = 0; i < cells.cell_of.size(); ++i) {
    std::int32_t& best = kept[static_cast<size_t>(cells.cell_of[i])];
    if (best < 0 || cells.off_center[i] < cells.off_center[static_cast<size_t>(best)])
      best = static_cast<std::int32_t>(i);
  }
  return kept;
}

struct Fitted {
  MlsPatch patch;
  bool is_border = false;
};

// Only points of the same sheet, in ascending order of index whatever the order of the search.
Fitted fit_sheet(const Points& points, const Points& normals, std::int32_t at,
                 std::span<const std::int32_t> index, const MlsOptions& options) {
  const RowVector3d own = normals.row(at);
  std::vector<std::int32_t> sheet;
  for (const std::int32_t i : index) {
    if (normals.row(i).dot(own) > 0.2) sheet.push_back(i);
  }
  std::sort(sheet.begin(), sheet.end());
  Fitted fitted;
  if (sheet.size() < 8) return fitted;
  Points near(static_cast<Index>(sheet.size()), 3);
  for (Index k = 0; k < near.rows(); ++k) near.row(k) = points.row(sheet[static_cast<size_t>(k)]);
  fitted.patch = fit_mls_patch(points.row(at), near, options, own);
  const RowVector3d offset = RowVector3d(near.colwise().mean()) - points.row(at);
  const RowVector3d along = offset - offset.dot(fitted.patch.n) * fitted.patch.n;
  // Half a disc has its mean .42 radii off, a quarter missing .2.
  fitted.is_border = along.norm() > 0.2 * options.radius;
  return fitted;
}

constexpr int kReach = 3;            // cells around a sample that know it
constexpr double kMaxCells = 120.0;  // along the longest side of the grid

void fill_grid(SurfaceSamples& samples) {
  if (samples.points.rows() == 0) return;
  // The object, and as much again around it: what lies beyond is not looked for.
  const detail::CoreBox core = detail::core_box(samples.points);
  const RowVector3d low =
      samples.points.colwise().minCoeff().cwiseMax(core.low - 0.5 * core.size());
  const RowVector3d high =
      samples.points.colwise().maxCoeff().cwiseMin(core.high + 0.5 * core.size());
  const RowVector3d size = high - low;
  const double step = std::max(samples.spacing, size.maxCoeff() / kMaxCells);
  samples.grid_step = step;
  samples.grid_origin = low.array() - (kReach + 0.5) * step;
  for (int k = 0; k < 3; ++k) {
    samples.grid_size[k] = static_cast<int>(std::floor(size[k] / step)) + 2 * kReach + 2;
  }
  const Eigen::Vector3i& n = samples.grid_size;
  const auto cells =
      static_cast<size_t>(n[0]) * static_cast<size_t>(n[1]) * static_cast<size_t>(n[2]);
  samples.grid.assign(cells, -1);
  std::vector<float> away(cells, std::numeric_limits<float>::max());
  for (Index i = 0; i < samples.points.rows(); ++i) {
    const RowVector3d at = (samples.points.row(i) - samples.grid_origin) / step;
    if ((at.array() < 0.0).any() || (at.array() >= n.transpose().cast<double>().array()).any())
      continue;
    const Eigen::Vector3i cell = at.array().floor().matrix().transpose().cast<int>();
    for (int x = std::max(0, cell[0] - kReach); x <= std::min(n[0] - 1, cell[0] + kReach); ++x) {
      for (int y = std::max(0, cell[1] - kReach); y <= std::min(n[1] - 1, cell[1] + kReach); ++y) {
        const double dx = x + 0.5 - at[0];
        const double dy = y + 0.5 - at[1];
        for (int z = std::max(0, cell[2] - kReach); z <= std::min(n[2] - 1, cell[2] + kReach);
             ++z) {
          const double dz = z + 0.5 - at[2];
          const auto squared = static_cast<float>(dx * dx + dy * dy + dz * dz);
          const auto index =
              (static_cast<size_t>(x) * static_cast<size_t>(n[1]) + static_cast<size_t>(y)) *
                  static_cast<size_t>(n[2]) +
              static_cast<size_t>(z);
          if (squared >= away[index]) continue;
          away[index] = squared;
          samples.grid[index] = static_cast<std::int32_t>(i);
        }
      }
    }
  }
}

}  // namespace

Index SurfaceSamples::near(const RowVector3d& point) const {
  size_t index = 0;
  for (Index k = 0; k < 3; ++k) {
    const double at = (point[k] - grid_origin[k]) / grid_step;
    if (!(at >= 0.0) || !(at < grid_size[k])) return -1;
    index = index * static_cast<size_t>(grid_size[k]) + static_cast<size_t>(at);
  }
  return grid[index];
}

std::optional<PatchFoot> SurfaceSamples::foot(Index sample, const RowVector3d& point) const {
  const MlsPatch& patch = patches[static_cast<size_t>(sample)];
  const RowVector3d d = point - patch.q;
  const double x = d.dot(patch.u1);
  const double y = d.dot(patch.u2);
  if (x * x + y * y > 0.49 * radius * radius) return std::nullopt;
  const PatchVector& b = patch.beta;  // quadratic: the cubic coefficients are zero
  const double height = b[4] * x * x + b[5] * x * y + b[6] * y * y + b[7] * x + b[8] * y + b[9];
  const double gx = 2.0 * b[4] * x + b[5] * y + b[7];
  const double gy = b[5] * x + 2.0 * b[6] * y + b[8];
  const double length = std::sqrt(1.0 + gx * gx + gy * gy);
  PatchFoot foot;
  foot.distance = (d.dot(patch.n) - height) / length;
  foot.normal = (patch.n - gx * patch.u1 - gy * patch.u2) / length;
  return foot;
}

SurfaceSamples sample_surface(const Points& points, const Points& normals,
                              const SurfaceSampleOptions& options, RunControl run) {
  check(points, normals, options);
  SurfaceSamples samples;
  samples.spacing = options.spacing;
  samples.radius = options.radius;
  samples.num_points = points.rows();
  if (points.rows() == 0) return samples;
  const NeighborSearch all(points);
  const std::vector<std::int32_t> kept = thin(points, options.spacing);
  Points places(static_cast<Index>(kept.size()), 3);
  for (size_t i = 0; i < kept.size(); ++i) places.row(static_cast<Index>(i)) = points.row(kept[i]);
  MlsOptions patch_options;
  patch_options.radius = options.radius;
  patch_options.degree = 2;
  std::vector<Fitted> fitted(kept.size());
  all.visit_within(
      places, options.radius,
      [&]() -> NeighborVisitor {
        return [&](Index query, std::span<const std::int32_t> index, std::span<const double>) {
          const auto k = static_cast<size_t>(query);
          fitted[k] = fit_sheet(points, normals, kept[k], index, patch_options);
        };
      },
      run);
  if (run.cancelled()) {
    samples.status = Status::cancelled;
    return samples;
  }
  std::vector<size_t> usable;
  for (size_t i = 0; i < fitted.size(); ++i) {
    if (fitted[i].patch.order >= 6) usable.push_back(i);
  }
  const auto count = static_cast<Index>(usable.size());
  samples.points.resize(count, 3);
  samples.normals.resize(count, 3);
  double variance = 0.0;
  double dof = 0.0;
  for (Index i = 0; i < count; ++i) {
    Fitted& one = fitted[usable[static_cast<size_t>(i)]];
    const double gx = one.patch.beta[7];
    const double gy = one.patch.beta[8];
    samples.points.row(i) = one.patch.projected();
    samples.normals.row(i) =
        (one.patch.n - gx * one.patch.u1 - gy * one.patch.u2) / std::sqrt(1.0 + gx * gx + gy * gy);
    samples.variance.push_back(one.patch.variance);
    samples.is_border.push_back(one.is_border ? 1 : 0);
    variance += one.patch.dof * one.patch.variance;
    dof += one.patch.dof;
    samples.patches.push_back(std::move(one.patch));
  }
  samples.noise_sigma = dof > 0.0 ? std::sqrt(variance / dof) : 0.0;
  fill_grid(samples);
  return samples;
}

}  // namespace dupin
