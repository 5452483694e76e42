#include "dupin/warp/contour_curvature.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;

// Beyond six standard deviations a Gaussian has 2e-9 of its mass.
constexpr double kReach = 6.0;

void require_loop(const Points2& loop) {
  if (loop.rows() < 3) throw InvalidArgument("a loop has at least three corners");
  for (Index i = 0; i < loop.rows(); ++i) {
    if (!std::isfinite(loop(i, 0)) || !std::isfinite(loop(i, 1)))
      throw InvalidArgument("corner " + std::to_string(i) + " of the loop is not finite");
  }
}

void require_count(Index count) {
  if (count < 8 || count > 65536)
    throw InvalidArgument("count = " + std::to_string(count) + " is not in [8, 65536]");
}

void require_sigma(double sigma, Index count) {
  if (!std::isfinite(sigma) || sigma < 1.0 || sigma >= static_cast<double>(count) / 6.0)
    throw InvalidArgument("sigma = " + std::to_string(sigma) +
                          " is not in [1, I / 6), I = " + std::to_string(count));
}

// Lengths from the first corner to each corner, and once round.
Eigen::VectorXd arcs_of(const Points2& loop) {
  Eigen::VectorXd arcs(loop.rows() + 1);
  arcs(0) = 0.0;
  for (Index i = 0; i < loop.rows(); ++i)
    arcs(i + 1) = arcs(i) + (loop.row((i + 1) % loop.rows()) - loop.row(i)).norm();
  const double length = arcs(loop.rows());
  if (!std::isfinite(length) || length <= 0.0)
    throw InvalidArgument("the corners of the loop lie at one place or too far apart");
  return arcs;
}

// Arc lengths of `loop` where the rising `parameter` (one per corner and one for the end) is i P /
// I.
Eigen::VectorXd arcs_at_equal_steps(const Eigen::VectorXd& arcs, const Eigen::VectorXd& parameter,
                                    Index count) {
  const Index num_corners = arcs.size() - 1;
  Eigen::VectorXd result(count);
  const double step = parameter(num_corners) / static_cast<double>(count);
  Index corner = 0;
  for (Index i = 0; i < count; ++i) {
    const double wanted = step * static_cast<double>(i);
    while (corner + 1 < num_corners && parameter(corner + 1) <= wanted) ++corner;
    const double width = parameter(corner + 1) - parameter(corner);
    const double t = width > 0.0 ? std::clamp((wanted - parameter(corner)) / width, 0.0, 1.0) : 0.0;
    result(i) = (1.0 - t) * arcs(corner) + t * arcs(corner + 1);
  }
  return result;
}

// Points of `loop` at the rising arc lengths `wanted`.
Points2 points_at(const Points2& loop, const Eigen::VectorXd& arcs, const Eigen::VectorXd& wanted) {
  Points2 points(wanted.size(), 2);
  Index corner = 0;
  for (Index i = 0; i < wanted.size(); ++i) {
    while (corner + 1 < loop.rows() && arcs(corner + 1) <= wanted(i)) ++corner;
    const double width = arcs(corner + 1) - arcs(corner);
    const double t = width > 0.0 ? std::clamp((wanted(i) - arcs(corner)) / width, 0.0, 1.0) : 0.0;
    points.row(i) = (1.0 - t) * loop.row(corner) + t * loop.row((corner + 1) % loop.rows());
  }
  return points;
}

// Taps -reach .. reach of the Gaussian or of its derivative, scaled so that constants, and the
// derivative of a straight run, come out exactly.
Eigen::VectorXd kernel(double sigma, bool derivative) {
  const auto reach = static_cast<Index>(std::ceil(kReach * sigma));
  Eigen::VectorXd taps(2 * reach + 1);
  double sum = 0.0;
  for (Index k = -reach; k <= reach; ++k) {
    const auto x = static_cast<double>(k);
    const double gauss = std::exp(-0.5 * x * x / (sigma * sigma));
    taps(k + reach) = derivative ? x * gauss : gauss;
    sum += derivative ? x * x * gauss : gauss;
  }
  return taps / sum;
}

// sum over k of taps(k) rows(i + k), round the loop.
Points2 correlate(const Points2& rows, const Eigen::VectorXd& taps) {
  const Index count = rows.rows();
  const Index reach = taps.size() / 2;
  // The taps that meet the same row are added once.
  Eigen::VectorXd wrapped = Eigen::VectorXd::Zero(std::min(count, taps.size()));
  for (Index k = 0; k < taps.size(); ++k) wrapped(k % count) += taps(k);
  Points2 result = Points2::Zero(count, 2);
  for (Index i = 0; i < count; ++i) {
    Index from = (i - reach) % count;
    if (from < 0) from += count;
    for (Index k = 0; k < wrapped.size(); ++k) {
      result.row(i) += wrapped(k) * rows.row(from);
      if (++from == count) from = 0;
    }
  }
  return result;
}

// Every row unit; a row without direction takes that of the row before it.
Index normalise(Points2& rows, double least) {
  Index first = -1;
  Index num_cusps = 0;
  for (Index i = 0; i < rows.rows(); ++i) {
    const double norm = rows.row(i).norm();
    if (norm > least) {
      rows.row(i) /= norm;
      if (first < 0) first = i;
    } else {
      ++num_cusps;
      rows.row(i).setZero();
    }
  }
  if (num_cusps == 0 || first < 0) return num_cusps;
  for (Index k = 1; k < rows.rows(); ++k) {
    const Index i = (first + k) % rows.rows();
    if (rows(i, 0) == 0.0 && rows(i, 1) == 0.0)
      rows.row(i) = rows.row((i + rows.rows() - 1) % rows.rows()).eval();
  }
  return num_cusps;
}

}  // namespace

double loop_length(const Points2& loop) {
  require_loop(loop);
  return arcs_of(loop)(loop.rows());
}

ResampledLoop resample_loop(const Points2& loop, Index count) {
  return resample_loop_smoothly(loop, count, 0.0);
}

ResampledLoop resample_loop_smoothly(const Points2& loop, Index count, double sigma) {
  require_loop(loop);
  require_count(count);
  if (sigma != 0.0) require_sigma(sigma, count);
  const Eigen::VectorXd arcs = arcs_of(loop);
  ResampledLoop result;
  result.arcs = arcs_at_equal_steps(arcs, arcs, count);
  result.points = points_at(loop, arcs, result.arcs);
  result.length = arcs(loop.rows());
  if (sigma > 0.0) {
    const Eigen::VectorXd smooth_arcs = arcs_of(smooth_contour(result.points, sigma));
    // Where the smoothed curve rests, the raw one must not be skipped.
    const double share = 1e-3 * smooth_arcs(count) / static_cast<double>(count);
    Eigen::VectorXd parameter(count + 1);
    Eigen::VectorXd raw_arcs(count + 1);
    for (Index i = 0; i <= count; ++i) {
      parameter(i) = smooth_arcs(i) + share * static_cast<double>(i);
      raw_arcs(i) = i < count ? result.arcs(i) : result.length;
    }
    result.arcs = arcs_at_equal_steps(raw_arcs, parameter, count);
    result.points = points_at(loop, arcs, result.arcs);
    result.length = smooth_arcs(count);
  }
  result.spacing = result.length / static_cast<double>(count);
  return result;
}

Points2 smooth_contour(const Points2& samples, double sigma) {
  require_loop(samples);
  require_count(samples.rows());
  require_sigma(sigma, samples.rows());
  return correlate(samples, kernel(sigma, false));
}

ContourCurvature compute_contour_curvature(const Points2& samples, double spacing, double sigma) {
  require_loop(samples);
  require_count(samples.rows());
  require_sigma(sigma, samples.rows());
  if (!std::isfinite(spacing) || spacing <= 0.0)
    throw InvalidArgument("spacing = " + std::to_string(spacing) + " is not positive");
  const Eigen::VectorXd taps = kernel(sigma, true);
  ContourCurvature result;
  // Offsets from the middle, so that a loop far from the origin loses no digits.
  const Eigen::RowVector2d middle = samples.colwise().mean();
  result.tangents = correlate((samples.rowwise() - middle) / spacing, taps);
  result.num_cusps = normalise(result.tangents, 1e-9);
  const Points2 normals = correlate(result.tangents, taps);
  result.curvature.resize(samples.rows());
  for (Index i = 0; i < samples.rows(); ++i) {
    const double turn =
        result.tangents(i, 0) * normals(i, 1) - result.tangents(i, 1) * normals(i, 0);
    const double size = normals.row(i).norm() / spacing;
    result.curvature(i) = turn < 0.0 ? -size : size;
  }
  return result;
}

Eigen::RowVector2d point_at_arc(const Points2& loop, double arc) {
  require_loop(loop);
  if (!std::isfinite(arc)) throw InvalidArgument("the arc length is not finite");
  const Eigen::VectorXd arcs = arcs_of(loop);
  const double length = arcs(loop.rows());
  const double wanted = arc - length * std::floor(arc / length);
  const auto* after = std::upper_bound(arcs.data(), arcs.data() + loop.rows(), wanted);
  const Index corner = std::max<Index>(0, (after - arcs.data()) - 1);
  const double width = arcs(corner + 1) - arcs(corner);
  const double t = width > 0.0 ? std::clamp((wanted - arcs(corner)) / width, 0.0, 1.0) : 0.0;
  return (1.0 - t) * loop.row(corner) + t * loop.row((corner + 1) % loop.rows());
}

}  // namespace dupin
