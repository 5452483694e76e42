#include "dupin/warp/exterior_points.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"

namespace dupin {
namespace {

using Eigen::Index;

constexpr double kLeastTurn = 0.3;

void require_options(const ExteriorPointOptions& options) {
  if (options.num_samples < 64 || options.num_samples > 65536)
    throw InvalidArgument("num_samples = " + std::to_string(options.num_samples) +
                          " is not in [64, 65536]");
  if (!std::isfinite(options.detail) || options.detail <= 6.0 ||
      options.detail > static_cast<double>(options.num_samples))
    throw InvalidArgument("detail = " + std::to_string(options.detail) +
                          " is not in (6, num_samples]");
  if (!std::isfinite(options.prominence) || options.prominence < 0.0)
    throw InvalidArgument("prominence is negative or not finite");
  if (!std::isfinite(options.separation) || options.separation < 0.0)
    throw InvalidArgument("separation is negative or not finite");
}

struct Peak {
  Index sample = 0;
  double prominence = 0.0;
};

// The lowest value between a peak and the next higher one in direction `step`; ties are broken by
// the sample's own index so that of two equal peaks one dominates.
double valley(const Eigen::VectorXd& height, Index peak, Index step, bool& has_higher) {
  const Index count = height.size();
  double lowest = height(peak);
  for (Index k = 1; k < count; ++k) {
    const Index i = ((peak + step * k) % count + count) % count;
    if (height(i) > height(peak) || (height(i) == height(peak) && i < peak)) {
      has_higher = true;
      return lowest;
    }
    lowest = std::min(lowest, height(i));
  }
  return lowest;
}

std::vector<Peak> peaks_of(const Eigen::VectorXd& height) {
  const Index count = height.size();
  std::vector<Peak> peaks;
  for (Index i = 0; i < count; ++i) {
    const double before = height((i + count - 1) % count);
    const double after = height((i + 1) % count);
    if (height(i) < before || height(i) < after || (height(i) == before && height(i) == after))
      continue;
    if (height(i) == before) continue;  // a plateau counts once, at its first sample
    bool has_higher = false;
    const double left = valley(height, i, -1, has_higher);
    const double right = valley(height, i, 1, has_higher);
    const double base = has_higher ? std::max(left, right) : std::min(left, right);
    peaks.push_back({i, height(i) - base});
  }
  return peaks;
}

// Standard deviation of the curvature that independent noise of 1 px per sample makes, times
// spacing^2: the second derivative of a Gaussian of sqrt(2) sigma.
double curvature_of_noise(double sigma) {
  const double width = std::numbers::sqrt2 * sigma;
  return std::sqrt(3.0 / (8.0 * std::sqrt(std::numbers::pi))) * std::pow(width, -2.5);
}

// Where the parabola through the peak and its neighbours is highest, in samples from the peak.
double peak_offset(const Eigen::VectorXd& height, Index peak) {
  const Index count = height.size();
  const double before = height((peak + count - 1) % count);
  const double after = height((peak + 1) % count);
  const double bend = before - 2.0 * height(peak) + after;
  return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

}  // namespace

double estimate_contour_noise(const Points2& samples) {
  const Index count = samples.rows();
  if (count < 16) throw InvalidArgument("fewer than 16 samples");
  // Fourth differences have the variance 70 for unit noise and vanish on cubics.
  std::vector<double> sizes;
  const auto at = [&](Index i) { return samples.row((i + count) % count); };
  for (Index i = 0; i < count; ++i) {
    const Eigen::RowVector2d chord = at(i + 2) - at(i - 2);
    const double length = chord.norm();
    if (!(length > 0.0)) continue;
    const Eigen::RowVector2d normal(-chord.y() / length, chord.x() / length);
    const Eigen::RowVector2d fourth =
        at(i - 2) - 4.0 * at(i - 1) + 6.0 * at(i) - 4.0 * at(i + 1) + at(i + 2);
    sizes.push_back(std::abs(fourth.dot(normal)) / std::sqrt(70.0));
  }
  if (sizes.empty()) return 0.0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / 0.6744897501960817;
}

ExteriorPoints find_exterior_points(const Points2& loop, const ExteriorPointOptions& options) {
  require_options(options);
  const auto count = static_cast<double>(options.num_samples);
  const double sigma = count / options.detail;
  // Arc length is measured on the curve at a quarter of the scale: noise must not stretch it.
  const ResampledLoop samples =
      resample_loop_smoothly(loop, options.num_samples, std::max(1.0, 0.25 * sigma));
  const double spacing = samples.spacing;
  const Eigen::VectorXd curvature =
      compute_contour_curvature(samples.points, spacing, sigma).curvature;

  // The kernel, two derivatives of sigma in a row, is one of sqrt(2) sigma.
  const double width = 2.0 * std::sqrt(std::numbers::pi) * sigma * spacing;
  const Eigen::VectorXd turning = width * curvature.cwiseAbs();

  ExteriorPoints result;
  result.length = loop_length(loop);
  result.sigma_px = sigma * spacing;
  result.noise_px = estimate_contour_noise(samples.points);
  const double noise_turning =
      width * curvature_of_noise(sigma) * result.noise_px / (spacing * spacing);
  result.least_prominence =
      options.prominence > 0.0 ? options.prominence : std::max(kLeastTurn, 5.0 * noise_turning);

  std::vector<Peak> peaks = peaks_of(turning);
  std::erase_if(peaks, [&](const Peak& p) { return p.prominence < result.least_prominence; });
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& a, const Peak& b) { return a.prominence > b.prominence; });
  const double separation = options.separation > 0.0 ? options.separation : result.sigma_px;
  std::vector<Peak> kept;
  for (const Peak& peak : peaks) {
    const bool is_free = std::all_of(kept.begin(), kept.end(), [&](const Peak& other) {
      const auto apart = static_cast<double>(std::abs(peak.sample - other.sample));
      return std::min(apart, count - apart) * spacing >= separation;
    });
    if (is_free) kept.push_back(peak);
  }
  for (const Peak& peak : kept) {
    const double place = static_cast<double>(peak.sample) + peak_offset(turning, peak.sample);
    const double wrapped = place < 0.0 ? place + count : place;
    const auto low = static_cast<Index>(std::floor(wrapped)) % options.num_samples;
    const double next = low + 1 < options.num_samples ? samples.arcs(low + 1) : result.length;
    const double t = wrapped - std::floor(wrapped);
    ExteriorPoint point;
    point.arc = (1.0 - t) * samples.arcs(low) + t * next;
    point.position = point_at_arc(loop, point.arc);
    point.curvature = curvature(peak.sample);
    point.prominence = peak.prominence;
    result.points.push_back(point);
  }
  // A peak a little before the first sample lies at the end of the loop.
  std::sort(result.points.begin(), result.points.end(),
            [](const ExteriorPoint& a, const ExteriorPoint& b) { return a.arc < b.arc; });
  return result;
}

}  // namespace dupin
