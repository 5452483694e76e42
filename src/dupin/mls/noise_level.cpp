#include "dupin/mls/noise_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mls/patch_fitter.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin {

using Eigen::Index;

namespace {

constexpr int kOrder = 10;
constexpr int kRounds = 4;
constexpr Index kMostReach = 2000;
constexpr double kReachInSigmas = 4.0;

// Positions along a curve that fills the box: 21 bits an axis, interleaved.
std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1FFFFFU;
  v = (v | v << 32U) & 0x1F00000000FFFFU;
  v = (v | v << 16U) & 0x1F0000FF0000FFU;
  v = (v | v << 8U) & 0x100F00F00F00F00FU;
  v = (v | v << 4U) & 0x10C30C30C30C30C3U;
  return (v | v << 2U) & 0x1249249249249249U;
}

std::vector<std::int32_t> choose(Index count, Index wanted, std::uint64_t seed) {
  std::vector<std::int32_t> index(static_cast<std::size_t>(count));
  std::iota(index.begin(), index.end(), 0);
  if (wanted == 0 || wanted >= count) return index;
  Rng rng(seed);
  for (Index i = 0; i < wanted; ++i) {
    const auto other = i + static_cast<Index>(rng.below(static_cast<std::uint64_t>(count - i)));
    std::swap(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(other)]);
  }
  index.resize(static_cast<std::size_t>(wanted));
  return index;
}

// Sorted along the curve, so that neighbours in the list overlap and distant ones do not.
void sort_along_curve(const Points& points, std::vector<std::int32_t>& index) {
  const Eigen::RowVector3d low = points.colwise().minCoeff();
  const double size = (points.colwise().maxCoeff() - low).maxCoeff();
  const double scale = size > 0.0 ? 2097151.0 / size : 0.0;
  std::vector<std::pair<std::uint64_t, std::int32_t>> order;
  order.reserve(index.size());
  for (const std::int32_t v : index) {
    std::uint64_t code = 0;
    for (Index axis = 0; axis < 3; ++axis) {
      const auto cell = static_cast<std::uint64_t>((points(v, axis) - low[axis]) * scale);
      code |= spread_bits(cell) << static_cast<unsigned>(axis);
    }
    order.emplace_back(code, v);
  }
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) index[i] = order[i].second;
}

// Rows without those that repeat an earlier one; in their order. `first` is the first left out.
Points distinct(const Points& points, Index& first) {
  std::vector<std::int32_t> order(static_cast<std::size_t>(points.rows()));
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](std::int32_t v) {
    return std::array<double, 3>{points(v, 0), points(v, 1), points(v, 2)};
  };
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return std::pair(key(a), a) < std::pair(key(b), b);
  });
  const auto last = std::unique(order.begin(), order.end(),
                                [&](std::int32_t a, std::int32_t b) { return key(a) == key(b); });
  if (last == order.end()) return points;
  order.erase(last, order.end());
  std::sort(order.begin(), order.end());
  first = 0;
  while (first < static_cast<Index>(order.size()) &&
         order[static_cast<std::size_t>(first)] == first)
    ++first;
  Points kept(static_cast<Index>(order.size()), 3);
  for (std::size_t i = 0; i < order.size(); ++i)
    kept.row(static_cast<Index>(i)) = points.row(order[i]);
  return kept;
}

// Spacing of points that lie on a surface: a disk of the radius of the sixteenth neighbour
// holds 16. Of noisy points the 16 nearest lie closer than along the surface, so this is a lower
// bound.
double mean_spacing(const NeighborSearch& search, const Points& queries) {
  const int k = static_cast<int>(std::min<Index>(16, search.size()));
  Eigen::VectorXd area = Eigen::VectorXd::Zero(queries.rows());
  search.visit_nearest(queries, k, [&]() -> NeighborVisitor {
    return
        [&](Index query, std::span<const std::int32_t> /*index*/, std::span<const double> squared) {
          area[query] = M_PI * *std::max_element(squared.begin(), squared.end()) / k;
        };
  });
  return std::sqrt(area.mean());
}

// The residual variances of cubics over the samples; -1 where there is none. The `neighbors` points
// that lie nearest along the plane of the `reach` points nearest in space: chosen in space alone,
// points would be near partly because their noise is small, and the noise would seem smaller.
Eigen::VectorXd residual_variances(const NeighborSearch& search, const Points& points,
                                   const Points& queries, int neighbors, int reach,
                                   const RunControl& run) {
  Eigen::VectorXd variance = Eigen::VectorXd::Constant(queries.rows(), -1.0);
  MlsOptions plane;
  plane.weight = MlsWeight::uniform;
  plane.degree = 1;
  MlsOptions cubic = plane;
  cubic.degree = 3;
  struct Workspace {
    detail::PatchFitter plane;
    detail::PatchFitter cubic;
    std::vector<std::pair<double, std::int32_t>> along;
    std::vector<std::int32_t> index;
    std::vector<double> squared;
  };
  search.visit_nearest(
      queries, reach,
      [&]() -> NeighborVisitor {
        auto work = std::make_shared<Workspace>(
            Workspace{detail::PatchFitter(plane), detail::PatchFitter(cubic), {}, {}, {}});
        return [&, work](Index query, std::span<const std::int32_t> index,
                         std::span<const double> squared) {
          const Eigen::RowVector3d r = queries.row(query);
          const MlsPatch base =
              work->plane.fit(points, r, index, squared, Eigen::RowVector3d::Zero(),
                              detail::PatchParts::coefficients);
          if (base.order < 3) return;
          work->along.clear();
          for (const std::int32_t i : index) {
            const Eigen::RowVector3d d = points.row(i) - r;
            const double height = d.dot(base.n);
            work->along.emplace_back(d.squaredNorm() - height * height, i);
          }
          const auto last = work->along.begin() + neighbors;
          std::nth_element(work->along.begin(), last - 1, work->along.end());
          std::sort(work->along.begin(), last);  // one order, whatever the search delivers
          work->index.clear();
          work->squared.clear();
          for (auto it = work->along.begin(); it != last; ++it) {
            work->index.push_back(it->second);
            work->squared.push_back((points.row(it->second) - r).squaredNorm());
          }
          const MlsPatch fit = work->cubic.fit_over(points, r, work->index, work->squared, base.n,
                                                    detail::PatchParts::variance);
          if (fit.order == kOrder && fit.dof > 0.0) variance[query] = fit.variance;
        };
      },
      run);
  return variance;
}

// Mean of the estimated variances and its standard error from groups of neighbours along the curve.
// On few points the groups overlap as well: then the degrees of freedom that so many points leave
// after cubics over k of them bound the error from below.
NoiseLevel pool(const Eigen::VectorXd& variance, Index num_points, int k) {
  constexpr Index kMostGroups = 40;
  NoiseLevel result;
  std::vector<double> kept;
  for (const double value : variance) {
    if (value >= 0.0) kept.push_back(value);
  }
  result.num_samples = static_cast<Index>(kept.size());
  if (kept.empty()) return result;
  const double mean =
      std::accumulate(kept.begin(), kept.end(), 0.0) / static_cast<double>(kept.size());
  result.sigma = std::sqrt(mean);
  const auto used = static_cast<double>(std::min(num_points, result.num_samples * k));
  const double dof = used * (1.0 - static_cast<double>(kOrder) / k);
  result.sigma_standard_error = result.sigma / std::sqrt(2.0 * dof);
  const Index groups = std::min(kMostGroups, result.num_samples);
  if (groups < 2 || mean == 0.0) return result;
  double sum = 0.0;
  for (Index g = 0; g < groups; ++g) {
    const auto first = static_cast<std::size_t>(g * result.num_samples / groups);
    const auto last = static_cast<std::size_t>((g + 1) * result.num_samples / groups);
    double group = 0.0;
    for (std::size_t i = first; i < last; ++i) group += kept[i];
    const double deviation = group / static_cast<double>(last - first) - mean;
    sum += deviation * deviation;
  }
  const auto number = static_cast<double>(groups);
  result.sigma_standard_error = std::max(
      result.sigma_standard_error, 0.5 * std::sqrt(sum / (number - 1.0) / number) / result.sigma);
  return result;
}

}  // namespace

NoiseLevel estimate_noise(const Points& given, const NoiseLevelOptions& options, RunControl run) {
  if (options.neighbors <= kOrder) {
    throw InvalidArgument("neighbors is " + std::to_string(options.neighbors) +
                          ", legal range > 10: a cubic has 10 coefficients");
  }
  if (options.num_samples < 0) {
    throw InvalidArgument("num_samples is " + std::to_string(options.num_samples) +
                          ", legal range >= 0");
  }
  for (Index i = 0; i < given.size(); ++i) {
    if (!std::isfinite(given.data()[i])) throw InvalidArgument("points: not finite");
  }
  Index first_repeated = -1;
  const Points points = distinct(given, first_repeated);
  if (points.rows() <= kOrder) {
    throw AnalysisError("E_TOO_FEW_POINTS", std::to_string(points.rows()) +
                                                " points, an estimate of the noise needs 11");
  }
  const NeighborSearch search(points);
  std::vector<std::int32_t> sample = choose(points.rows(), options.num_samples, options.seed);
  sort_along_curve(points, sample);
  const auto count = static_cast<Index>(sample.size());
  Points queries(count, 3);
  for (Index i = 0; i < count; ++i)
    queries.row(i) = points.row(sample[static_cast<std::size_t>(i)]);
  const double spacing = mean_spacing(search, queries);
  const int most = static_cast<int>(std::min<Index>(points.rows(), kMostReach));
  const int k = std::min(options.neighbors, most);
  // The ball has to hold what lies `k` points wide and four deviations high; the deviation comes
  // from the round before.
  int reach = k;
  NoiseLevel result;
  for (int round = 0; round < kRounds; ++round) {
    result = pool(residual_variances(search, points, queries, k, reach,
                                     run.stage(static_cast<double>(round) / kRounds,
                                               static_cast<double>(round + 1) / kRounds)),
                  points.rows(), k);
    if (run.cancelled()) {
      result = {};
      result.status = Status::cancelled;
      return result;
    }
    const double height = kReachInSigmas * result.sigma / spacing;
    const double needed = k + M_PI * height * height;
    const int next = static_cast<int>(std::min(needed, static_cast<double>(most)));
    if (next <= reach) break;
    reach = next;
  }
  if (result.num_samples == 0) {
    throw AnalysisError("E_DEGENERATE",
                        "no neighbourhood of " + std::to_string(k) + " points determines a cubic");
  }
  result.num_repeated = given.rows() - points.rows();
  result.first_repeated = first_repeated;
  return result;
}

}  // namespace dupin
