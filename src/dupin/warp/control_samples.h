#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/warper.h"

// What pins and the lines between them are to moving least squares, for coarse and fine stages.
namespace dupin::detail {

/// "pin NAME", or its number.
std::string label(const Pin& pin, Eigen::Index m);

/// @throws InvalidArgument naming the pin and its field
void require_pins(const std::vector<Pin>& pins);

/// @throws InvalidArgument for a line between pins that are not there
void require_lines(const std::vector<ControlLine>& lines, std::size_t num_pins);

/// Where pins start and end on a shape.
struct PlacedPins {
  Points2 sources;                ///< #M by 2 [px]; of pins on the shape, their place there
  Points2 targets;                ///< #M by 2 [px]; moved with the source of an anchored pin
  std::vector<MeshPoint> places;  ///< #M; triangle -1 outside the shape
};

/// Anchors as they are, other pins where they lie.
/// @throws InvalidArgument for an anchor on no triangle. Cost: O(F) a pin.
PlacedPins place_pins(const PlanarMesh& mesh, const std::vector<Pin>& pins);

/// Places nearer than this are one: 1e-12 of the diagonal of the shape [px]. Cost: O(V).
double one_place_distance(const PlanarMesh& mesh);

/// Pins first, then places on the lines between them, at most 256.
struct ControlSamples {
  std::vector<ControlSample> where;
  std::vector<double> weight;
};

/// @param spacing of the places on lines, > 0 [px]
ControlSamples sample_controls(const std::vector<Pin>& pins, const Points2& sources,
                               const std::vector<ControlLine>& lines, double spacing);

/// #V by #samples: distances from the samples [px]. From outside the shape it goes straight to the
/// closest place on it, and infinitely far to parts that cannot be reached.
/// @throws Error E_INTERRUPTED. Cost: a geodesic search a sample.
Eigen::MatrixXd control_distances(const PlanarMesh& mesh, const PlanarGraph& graph,
                                  const Points2& sources, const std::vector<MeshPoint>& places,
                                  const ControlSamples& samples, WarpMetric metric,
                                  const RunControl& run);

/// What no sample reaches.
struct UnreachedParts {
  std::vector<std::uint8_t> is_still;          ///< by component
  std::vector<std::int32_t> still_components;  ///< those of them that have a triangle
};

/// @throws AnalysisError E_COMPONENT_UNANCHORED, if that is not allowed
UnreachedParts find_unreached(const PlanarMesh& mesh, const PlanarGraph& graph,
                              const Eigen::MatrixXd& distance, bool is_unanchored_allowed);

}  // namespace dupin::detail
