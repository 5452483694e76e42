#include "dupin/registration/scan_samples.h"

#include <algorithm>
#include <cmath>

namespace dupin::detail {
namespace {

ScanSamples sample_both(const Points& moving, const Points& moving_normals, const Points& fixed,
                        const Points& fixed_normals, double scale,
                        const SurfaceSampleOptions& options, const RunControl& run) {
  ScanSamples samples;
  samples.fixed = sample_surface(fixed, fixed_normals, options, run.stage(0.0, 0.5));
  samples.moving =
      sample_surface(moving, moving_normals, {options.spacing / scale, options.radius / scale},
                     run.stage(0.5, 1.0));
  const double noise = std::hypot(scale * samples.moving.noise_sigma, samples.fixed.noise_sigma);
  samples.bounds.touching = 0.15 * options.spacing + 0.6 * noise;
  samples.bounds.apart = 3.0 * options.spacing;
  return samples;
}

}  // namespace

ScanSamples sample_coarsely(const ScanFeatures& moving, const ScanFeatures& fixed, double scale,
                            const RunControl& run) {
  const double size = std::max(fixed.diameter, scale * moving.diameter);
  SurfaceSampleOptions options;
  options.spacing =
      std::max(2.0 * std::max(fixed.mean_edge, scale * moving.mean_edge), size / 90.0);
  options.radius = 1.7 * options.spacing;
  return sample_both(moving.coarse, moving.coarse_normals, fixed.coarse, fixed.coarse_normals,
                     scale, options, run);
}

ScanSamples sample_finely(const ScanFeatures& moving, const ScanFeatures& fixed, double scale,
                          const RunControl& run) {
  const auto edge = [](const ScanFeatures& scan) {
    return scan.mean_edge * std::sqrt(static_cast<double>(scan.coarse.rows()) /
                                      static_cast<double>(scan.points.rows()));
  };
  const double size = std::max(fixed.diameter, scale * moving.diameter);
  SurfaceSampleOptions options;
  options.radius = std::max(5.0 * std::max(edge(fixed), scale * edge(moving)), size / 120.0);
  options.spacing = 0.6 * options.radius;
  return sample_both(moving.points, moving.normals, fixed.points, fixed.normals, scale, options,
                     run);
}

}  // namespace dupin::detail
