#include "dupin/mls/local_scale.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mls/patch_draws.h"
#include "dupin/spatial/neighborhoods.h"
#include "dupin/stats/distributions.h"
#include "dupin/stats/kolmogorov.h"

namespace dupin {

using Eigen::Index;
using Eigen::RowVector3d;
using Eigen::VectorXd;

namespace {

constexpr Index kBlock = 64;  // vertices between two reports of progress
constexpr double kThesisDofBeta = 65.0;
constexpr double kThesisDofKappa = 5.0;

void require(bool is_legal, const std::string& field, const std::string& range) {
  if (!is_legal) throw InvalidArgument(field + ": legal range " + range);
}

void check(const PatchDrawOptions& options) {
  validate(options.patch);
  require(options.patch.radius == 0.0, "patch.radius", "0");
  require(std::isfinite(options.sigma) && options.sigma > 0.0, "sigma", "> 0 and finite");
  const int variables = options.test_all_coefficients ? 10 : 7;
  require(options.realisations >= 5 * variables, "realisations",
          ">= " + std::to_string(5 * variables) + ", five times the coefficients tested");
  require(options.experiments >= 1, "experiments", ">= 1");
  require(std::isfinite(options.significance) && options.significance > 0.0 &&
              options.significance < 1.0,
          "significance", "0 to 1, both excluded");
}

std::vector<int> checked_sizes(const std::vector<int>& given, Index num_points) {
  std::vector<int> sizes = given;
  if (sizes.empty()) {
    for (int k = 30; k <= 300; k += 10) sizes.push_back(k);
  }
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    require(sizes[i] >= 10, "sizes", ">= 10");
    require(i == 0 || sizes[i] > sizes[i - 1], "sizes", "growing");
  }
  if (num_points < sizes.front()) {
    throw AnalysisError("E_TOO_FEW_POINTS", std::to_string(num_points) +
                                                " points, the smallest neighbourhood has " +
                                                std::to_string(sizes.front()));
  }
  while (sizes.back() > num_points) sizes.pop_back();
  return sizes;
}

void check_normals(const Points& normals) {
  for (Index i = 0; i < normals.size(); ++i) {
    if (!std::isfinite(normals.data()[i])) throw InvalidArgument("normals: not finite");
  }
}

// A stream of its own for every vertex, size and experiment.
std::uint64_t seed_of(std::uint64_t seed, std::uint64_t vertex, std::uint64_t size,
                      std::uint64_t experiment) {
  std::uint64_t state = seed;
  for (const std::uint64_t part : {vertex, size, experiment}) {
    state = Rng(Rng(state).next() ^ part).next();
  }
  return state;
}

// Mean and deviation; an infinite value makes the mean infinite, and no deviation.
void summarise(const VectorXd& values, double& mean, double& deviation) {
  deviation = 0.0;
  for (Index i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      mean = std::numeric_limits<double>::infinity();
      return;
    }
  }
  mean = values.mean();
  if (values.size() > 1) {
    deviation =
        std::sqrt((values.array() - mean).square().sum() / static_cast<double>(values.size() - 1));
  }
}

double dof_of(Index rank, bool thesis_dof, double thesis_value) {
  if (rank == 0) return 0.0;
  const auto k = static_cast<double>(rank);
  return thesis_dof ? thesis_value : 0.5 * k * (k + 1.0) + k;
}

// The statistics of all experiments for one size.
PatchValidation draw(const Points& points, Index vertex, const RowVector3d& normal,
                     std::span<const std::int32_t> index, const PatchDrawOptions& options,
                     const RunControl& run) {
  const detail::PatchDraws draws(points, points.row(vertex), normal, index, options);
  PatchValidation result;
  ScaleTest& test = result.test;
  test.neighbors = static_cast<int>(index.size());
  test.radius = draws.reference().radius;
  test.order = draws.reference().order;
  if (!draws.can_test()) return result;
  const auto count = static_cast<Index>(options.experiments);
  std::vector<detail::PatchDraws::Outcome> outcomes(static_cast<std::size_t>(count));
  parallel_for(0, count, 1, [&](Index first, Index last) {
    for (Index i = first; i < last && !run.cancelled(); ++i) {
      outcomes[static_cast<std::size_t>(i)] = draws.experiment(
          seed_of(options.seed, static_cast<std::uint64_t>(vertex),
                  static_cast<std::uint64_t>(index.size()), static_cast<std::uint64_t>(i)),
          run);
    }
  });
  result.T_beta.resize(count);
  result.T_kappa.resize(count);
  for (Index i = 0; i < count; ++i) {
    result.T_beta[i] = outcomes[static_cast<std::size_t>(i)].T_beta;
    result.T_kappa[i] = outcomes[static_cast<std::size_t>(i)].T_kappa;
  }
  test.rank_beta = outcomes.front().rank_beta;
  test.rank_kappa = outcomes.front().rank_kappa;
  summarise(result.T_beta, test.T_beta, test.T_beta_sd);
  summarise(result.T_kappa, test.T_kappa, test.T_kappa_sd);
  result.dof_beta = dof_of(test.rank_beta, options.thesis_dof, kThesisDofBeta);
  result.dof_kappa = dof_of(test.rank_kappa, options.thesis_dof, kThesisDofKappa);
  if (test.rank_beta > 0)
    test.critical_beta = chi_square_quantile(result.dof_beta, options.significance);
  if (test.rank_kappa > 0)
    test.critical_kappa = chi_square_quantile(result.dof_kappa, options.significance);
  test.passed = test.rank_beta > 0 && test.rank_kappa > 0 && test.T_beta <= test.critical_beta &&
                test.T_kappa <= test.critical_kappa;
  return result;
}

LocalScale scale_of(const Points& points, Index vertex, const RowVector3d& normal,
                    std::span<const std::int32_t> index, const std::vector<int>& sizes,
                    const LocalScaleOptions& options, const RunControl& run) {
  LocalScale result;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    result.tests.push_back(draw(points, vertex, normal,
                                index.first(static_cast<std::size_t>(sizes[i])), options.draws, run)
                               .test);
    if (run.cancelled()) {
      result = {};
      result.status = Status::cancelled;
      return result;
    }
    if (result.tests.back().passed && result.chosen < 0) result.chosen = static_cast<int>(i);
    if (result.chosen >= 0 && options.stop_at_first_pass) break;
  }
  return result;
}

// The neighbours of a point, itself first even where points coincide.
std::span<const std::int32_t> own_first(NeighborTable& table, Index row, std::int32_t vertex) {
  std::int32_t* const first = table.index.data() + row * table.index.cols();
  const std::span<std::int32_t> list(first, static_cast<std::size_t>(table.index.cols()));
  const auto place = std::find(list.begin(), list.end(), vertex);
  if (place == list.end()) {
    list.front() = vertex;
  } else {
    std::rotate(list.begin(), place, place + 1);
  }
  return list;
}

void check_vertex(const Points& points, Index vertex) {
  if (vertex < 0 || vertex >= points.rows()) {
    throw InvalidArgument("vertex is " + std::to_string(vertex) + ", legal range 0 to " +
                          std::to_string(points.rows() - 1));
  }
}

}  // namespace

PatchDrawOptions thesis_patch_draws(double sigma) {
  PatchDrawOptions options;
  options.sigma = sigma;
  options.realisations = 100;
  options.experiments = 100;
  options.patch.weight = MlsWeight::uniform;
  options.test_all_coefficients = true;
  options.standardise = false;
  options.beta_test = thesis_likelihood_ratio_options();
  options.kappa_test = thesis_likelihood_ratio_options();
  options.thesis_dof = true;
  return options;
}

LocalScaleField find_local_scales(const Points& points, const Points& normals,
                                  const std::vector<std::int32_t>& vertices,
                                  const LocalScaleOptions& options, RunControl run) {
  check(options.draws);
  const NeighborSearch search(points);
  const std::vector<int> sizes = checked_sizes(options.sizes, points.rows());
  if (normals.rows() != 0 && normals.rows() != points.rows()) {
    throw InvalidArgument("normals: " + std::to_string(normals.rows()) + " rows for " +
                          std::to_string(points.rows()) + " points, need as many or none");
  }
  check_normals(normals);
  LocalScaleField field;
  field.vertices = vertices;
  if (vertices.empty()) {
    field.vertices.resize(static_cast<std::size_t>(points.rows()));
    std::iota(field.vertices.begin(), field.vertices.end(), 0);
  }
  for (const std::int32_t v : field.vertices) check_vertex(points, v);
  const auto count = static_cast<Index>(field.vertices.size());
  field.scales.resize(field.vertices.size());
  for (Index begin = 0; begin < count; begin += kBlock) {
    const Index end = std::min(count, begin + kBlock);
    Points queries(end - begin, 3);
    for (Index i = begin; i < end; ++i) {
      queries.row(i - begin) = points.row(field.vertices[static_cast<std::size_t>(i)]);
    }
    NeighborTable table = search.nearest(queries, sizes.back());
    parallel_for(begin, end, 1, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        const std::int32_t v = field.vertices[static_cast<std::size_t>(i)];
        const RowVector3d normal =
            normals.rows() > 0 ? RowVector3d(normals.row(v)) : RowVector3d(RowVector3d::Zero());
        field.scales[static_cast<std::size_t>(i)] =
            scale_of(points, v, normal, own_first(table, i - begin, v), sizes, options, run);
      }
    });
    if (run.cancelled()) {
      field = {};
      field.status = Status::cancelled;
      return field;
    }
    run.report(static_cast<double>(end) / static_cast<double>(count));
  }
  return field;
}

LocalScale find_local_scale(const Points& points, Index vertex, const RowVector3d& normal,
                            const LocalScaleOptions& options, RunControl run) {
  check(options.draws);
  check_normals(normal);
  const NeighborSearch search(points);
  const std::vector<int> sizes = checked_sizes(options.sizes, points.rows());
  check_vertex(points, vertex);
  NeighborTable table = search.nearest(points.row(vertex), sizes.back());
  const LocalScale result =
      scale_of(points, vertex, normal, own_first(table, 0, static_cast<std::int32_t>(vertex)),
               sizes, options, run);
  if (result.status == Status::ok) run.report(1.0);
  return result;
}

PatchValidation validate_patch_statistics(const Points& points, Index vertex,
                                          const RowVector3d& normal, int neighbors,
                                          const PatchDrawOptions& options, RunControl run) {
  check(options);
  require(options.experiments >= 5, "experiments", ">= 5 for Kolmogorov's test");
  check_normals(normal);
  const NeighborSearch search(points);
  checked_sizes({neighbors}, points.rows());
  check_vertex(points, vertex);
  NeighborTable table = search.nearest(points.row(vertex), neighbors);
  PatchValidation result = draw(
      points, vertex, normal, own_first(table, 0, static_cast<std::int32_t>(vertex)), options, run);
  if (run.cancelled()) {
    result = {};
    result.status = Status::cancelled;
    return result;
  }
  result.ks_critical = kolmogorov_critical_value(options.significance, options.experiments);
  result.ks_critical_two =
      kolmogorov_critical_value(options.significance, options.experiments, options.experiments);
  const auto distance = [](const VectorXd& values, double dof) {
    for (Index i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) return 1.0;
    }
    return kolmogorov_statistic(values,
                                [dof](double x) { return 1.0 - chi_square_survival(x, dof); });
  };
  if (result.dof_beta > 0.0) result.ks_beta = distance(result.T_beta, result.dof_beta);
  if (result.dof_kappa > 0.0) result.ks_kappa = distance(result.T_kappa, result.dof_kappa);
  run.report(1.0);
  return result;
}

PointType classify_point(double gauss, double mean, double gauss_sd, double mean_sd,
                         double tolerance) {
  require(std::isfinite(gauss) && std::isfinite(mean), "gauss, mean", "finite");
  require(std::isfinite(gauss_sd) && gauss_sd >= 0.0 && std::isfinite(mean_sd) && mean_sd >= 0.0,
          "gauss_sd, mean_sd", ">= 0 and finite");
  require(std::isfinite(tolerance) && tolerance >= 0.0, "tolerance", ">= 0 and finite");
  if (std::abs(gauss) > tolerance * gauss_sd) {
    return gauss > 0.0 ? PointType::elliptic : PointType::hyperbolic;
  }
  return std::abs(mean) > tolerance * mean_sd ? PointType::parabolic : PointType::planar;
}

const char* point_type_name(PointType type) {
  switch (type) {
    case PointType::planar:
      return "planar";
    case PointType::parabolic:
      return "parabolic";
    case PointType::elliptic:
      return "elliptic";
    case PointType::hyperbolic:
      return "hyperbolic";
  }
  return "";
}

}  // namespace dupin
