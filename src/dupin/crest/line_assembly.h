#pragma once

#include <vector>

#include "dupin/crest/crest_lines.h"

namespace dupin::detail {

/// Points in order; a closed chain repeats its first at the end.
using Chain = std::vector<CrestPoint>;

/// Standard deviation of an entry of the curvature tensor that white noise of `sigma` along the
/// normals leaves on a plane after diffusion for `tau`, by the heat kernel: sqrt(0.4135 / tau^3)
/// sigma / e^2 (docs/methods/crest_lines.md) [1/mu].
double plane_noise(double tau, double sigma, double mean_edge);

/// Ratio of tau over which lines are extrapolated: from where they are drawn to their scale, not at
/// all on one level alone, which shows the surface as smoothed.
inline double draw_ratio(const CrestOptions& options) {
  return options.level > 0 ? 1.0 : 1.0 / options.drawn_share;
}

/// Hysteresis on the strength, joining of ends across gaps, least length and sharpness of
/// CrestOptions. Adds the lines of one kind to `lines`.
void assemble_lines(const std::vector<Chain>& chains, CrestKind kind, double mean_edge,
                    const CrestOptions& options, std::vector<CrestLine>& lines);

}  // namespace dupin::detail
