#pragma once

#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/surface/surface_graph.h"

namespace dupin {

/// Options of estimate_crest_uncertainty().
struct CrestNoiseOptions {
  double sigma = 0.0;     ///< of every coordinate, > 0 [mu]
  int num_replicas = 12;  ///< 4 to 1000
  std::uint64_t seed = 0;
};

/// How sure a crest line is.
struct CrestUncertainty {
  std::vector<double> point_sd;  ///< of CrestPoint::strength, aligned with the points [-]
  double strength_sd = 0.0;      ///< of CrestLine::strength, a mean: smaller than those [-]
  double sharpness_sd = 0.0;     ///< root mean square over the points, of CrestPoint::sharpness [-]
  double position_sd = 0.0;      ///< root mean square over the points, across the line [mu]
  /// The smaller of strength over the root mean square of point_sd and sharpness over sharpness_sd:
  /// noise alone has ridges of a strength and a sharpness, one or two deviations of a point high.
  double snr = 0.0;
};

/// One for every line of the set, or none when cancelled.
struct CrestUncertainties {
  Status status = Status::ok;
  std::vector<CrestUncertainty> lines;
};

/// Error bars of `set`, found on `graph` with `options`, for independent noise of every coordinate:
/// replicas of the surface, moved by a quarter of the noise (to first order), are smoothed like it
/// and looked at where the lines are, at the levels they were drawn. Standard deviations of a point
/// carry the sampling error of R replicas, 1 / sqrt(2 R); those of lines less, as points differ.
///
/// Same input, same bits for any number of threads.
/// @throws InvalidArgument if an option is out of range or the set does not fit the graph
/// Cost: R + 1 times that of find_crest_lines().
CrestUncertainties estimate_crest_uncertainty(const SurfaceGraph& graph, const CrestSet& set,
                                              const CrestOptions& options,
                                              const CrestNoiseOptions& noise, RunControl run = {});

}  // namespace dupin
