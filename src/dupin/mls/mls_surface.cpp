#include "dupin/mls/mls_surface.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "dupin/base/error.h"
#include "dupin/mls/patch_fitter.h"
#include "dupin/mls/propagation.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin {

using Eigen::Index;
using Eigen::RowVector3d;

namespace {

void check_input(const Points& points, const Points& facing, Index num_queries) {
  if (facing.rows() != 0 && facing.rows() != num_queries) {
    throw InvalidArgument("normals: " + std::to_string(facing.rows()) + " rows for " +
                          std::to_string(num_queries) + " points, need as many or none");
  }
  for (Index i = 0; i < facing.size(); ++i) {
    if (!std::isfinite(facing.data()[i])) throw InvalidArgument("normals: not finite");
  }
  if (points.rows() < 3) {
    throw AnalysisError("E_TOO_FEW_POINTS",
                        std::to_string(points.rows()) + " points, a plane needs 3");
  }
}

// Calls use(query, patch) for the patch of every query.
template <class Use>
void fit_patches(const NeighborSearch& search, const Points& points, const Points& queries,
                 const Points& facing, const MlsOptions& options, detail::PatchParts parts,
                 const RunControl& run, const Use& use) {
  const auto make_visitor = [&]() -> NeighborVisitor {
    auto fitter = std::make_shared<detail::PatchFitter>(options);
    return [&, fitter](Index query, std::span<const std::int32_t> index,
                       std::span<const double> squared) {
      const RowVector3d side =
          facing.rows() > 0 ? RowVector3d(facing.row(query)) : RowVector3d(RowVector3d::Zero());
      use(query, fitter->fit(points, queries.row(query), index, squared, side, parts));
    };
  };
  if (options.radius > 0.0) {
    search.visit_within(queries, options.radius, make_visitor, run);
  } else {
    const int k = static_cast<int>(std::min<Index>(options.neighbors, points.rows()));
    search.visit_nearest(queries, k, make_visitor, run);
  }
}

RowVector3d to_world(const MlsPatch& patch, const RowVector3d& local) {
  return local[0] * patch.u1 + local[1] * patch.u2 + local[2] * patch.n;
}

void store_deviations(Index v, const MlsPatch& patch, double noise_sigma, MlsCurvature& result) {
  const double variance = noise_sigma > 0.0 ? noise_sigma * noise_sigma : patch.variance;
  result.dof[v] = patch.dof;
  result.sigma[v] = std::sqrt(patch.variance);
  const PatchMatrix covariance = variance * patch.unit_covariance;
  const Eigen::Matrix2d curvature = curvature_covariance(patch.beta, covariance);
  result.gauss_sd[v] = std::sqrt(std::max(0.0, curvature(0, 0)));
  result.mean_sd[v] = std::sqrt(std::max(0.0, curvature(1, 1)));
  result.normal_sd_rad[v] =
      std::sqrt(std::max(0.0, patch_normal_covariance(patch.beta, covariance).trace()));
}

}  // namespace

MlsCurvature estimate_curvature_mls(const Points& points, const Points& normals,
                                    const MlsCurvatureOptions& options, RunControl run) {
  validate(options.patch);
  if (!std::isfinite(options.noise_sigma) || options.noise_sigma < 0.0) {
    throw InvalidArgument("noise_sigma is " + std::to_string(options.noise_sigma) +
                          ", legal range >= 0 and finite");
  }
  const NeighborSearch search(points);
  check_input(points, normals, points.rows());
  const Index count = points.rows();
  MlsCurvature result;
  CurvatureField& field = result.field;
  for (Eigen::VectorXd* values : {&field.k1, &field.k2, &result.radius}) {
    *values = Eigen::VectorXd::Zero(count);
  }
  if (options.want_deviations) {
    for (Eigen::VectorXd* values :
         {&result.dof, &result.sigma, &result.mean_sd, &result.gauss_sd, &result.normal_sd_rad}) {
      *values = Eigen::VectorXd::Zero(count);
    }
  }
  for (Points* rows : {&field.d1, &field.d2, &field.normals}) *rows = Points::Zero(count, 3);
  result.projected = points;
  result.order = Eigen::VectorXi::Zero(count);
  field.is_estimated.assign(static_cast<std::size_t>(count), 0);
  const auto parts =
      options.want_deviations ? detail::PatchParts::covariance : detail::PatchParts::coefficients;
  fit_patches(search, points, points, normals, options.patch, parts, run,
              [&](Index v, const MlsPatch& patch) {
                result.radius[v] = patch.radius;
                result.order[v] = patch.order;
                if (patch.order == 0) return;
                const PatchCurvature curvature = patch_curvature(patch.beta);
                field.d1.row(v) = to_world(patch, curvature.d1);
                field.d2.row(v) = to_world(patch, curvature.d2);
                field.normals.row(v) = to_world(patch, curvature.normal);
                result.projected.row(v) = patch.projected();
                if (patch.order < 6) return;
                field.k1[v] = curvature.k1;
                field.k2[v] = curvature.k2;
                field.is_estimated[static_cast<std::size_t>(v)] = 1;
                if (options.want_deviations) {
                  store_deviations(v, patch, options.noise_sigma, result);
                }
              });
  if (run.cancelled()) {
    result = {};
    result.status = Status::cancelled;
    result.field.status = Status::cancelled;
    return result;
  }
  field.num_skipped =
      count - std::count(field.is_estimated.begin(), field.is_estimated.end(), std::uint8_t{1});
  return result;
}

MlsProjection project_mls(const Points& queries, const Points& points, const Points& facing,
                          const MlsProjectionOptions& options, RunControl run) {
  validate(options.patch);
  if (options.max_iterations < 1) {
    throw InvalidArgument("max_iterations is " + std::to_string(options.max_iterations) +
                          ", legal range >= 1");
  }
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance)) {
    throw InvalidArgument("tolerance is " + std::to_string(options.tolerance) +
                          ", legal range >= 0 and finite");
  }
  const NeighborSearch search(points);
  check_input(points, facing, queries.rows());
  MlsProjection result;
  result.points = queries;
  result.normals = Points::Zero(queries.rows(), 3);
  result.step = Eigen::VectorXd::Zero(queries.rows());
  result.order = Eigen::VectorXi::Zero(queries.rows());
  // Only what still moves is projected again; the list stays in the order of the queries.
  std::vector<Index> moving(static_cast<std::size_t>(queries.rows()));
  for (Index i = 0; i < queries.rows(); ++i) moving[static_cast<std::size_t>(i)] = i;
  for (int iteration = 0; iteration < options.max_iterations && !moving.empty(); ++iteration) {
    const auto count = static_cast<Index>(moving.size());
    Points current(count, 3);
    Points side(facing.rows() > 0 ? count : 0, 3);
    for (Index i = 0; i < count; ++i) {
      const Index query = moving[static_cast<std::size_t>(i)];
      current.row(i) = result.points.row(query);
      if (facing.rows() > 0) side.row(i) = facing.row(query);
    }
    std::vector<std::uint8_t> is_settled(static_cast<std::size_t>(count), 1);
    fit_patches(search, points, current, side, options.patch, detail::PatchParts::coefficients,
                run.stage(static_cast<double>(iteration) / options.max_iterations,
                          static_cast<double>(iteration + 1) / options.max_iterations),
                [&](Index i, const MlsPatch& patch) {
                  const Index query = moving[static_cast<std::size_t>(i)];
                  result.order[query] = patch.order;
                  if (patch.order == 0) return;
                  const RowVector3d next = patch.projected();
                  result.step[query] = (next - current.row(i)).norm();
                  result.points.row(query) = next;
                  result.normals.row(query) = to_world(patch, patch_curvature(patch.beta).normal);
                  is_settled[static_cast<std::size_t>(i)] =
                      result.step[query] <= options.tolerance * patch.radius;
                });
    if (run.cancelled()) {
      result = {};
      result.status = Status::cancelled;
      return result;
    }
    std::vector<Index> left;
    for (Index i = 0; i < count; ++i) {
      if (is_settled[static_cast<std::size_t>(i)] == 0) {
        left.push_back(moving[static_cast<std::size_t>(i)]);
      }
    }
    moving = std::move(left);
  }
  if (!moving.empty() && options.max_iterations > 1) result.status = Status::not_converged;
  return result;
}

}  // namespace dupin
