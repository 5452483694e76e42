#pragma once

#include "dupin/base/run_control.h"
#include "dupin/registration/assessment.h"
#include "dupin/registration/scan_features.h"
#include "dupin/registration/surface_samples.h"

namespace dupin::detail {

/// Samples of two scans, of one size in the unit of the fixed one.
struct ScanSamples {
  SurfaceSamples moving;
  SurfaceSamples fixed;
  AssessmentBounds bounds;
};

/// Of the coarse points, no more than some thousand: for the search. `scale` takes the unit of
/// `moving` to that of `fixed`.
ScanSamples sample_coarsely(const ScanFeatures& moving, const ScanFeatures& fixed, double scale,
                            const RunControl& run);

/// Of all points, as small as their spacing allows: for the result.
ScanSamples sample_finely(const ScanFeatures& moving, const ScanFeatures& fixed, double scale,
                          const RunControl& run);

}  // namespace dupin::detail
