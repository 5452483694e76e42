#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/crest/edge_crossing.h"
#include "dupin/crest/tensor_stack.h"
#include "dupin/surface/surface_graph.h"

namespace dupin::detail {

/// One principal curvature as crests see it: positive where it bends the way of its kind.
struct BendField {
  Eigen::VectorXd bend;         ///< #V: k1 of ridges, -k2 of valleys [1/mu]
  Eigen::VectorXd strength;     ///< #V: |bend| - |the other|, the edge strength of 5.6 [1/mu]
  Points direction;             ///< #V by 3: unit, sign arbitrary; zero: unknown
  Eigen::VectorXd extremality;  ///< #V: slope of bend along direction, of its sign [1/mu^2]
};

/// The bend of `kind` where vertex v is smoothed to level[v], extrapolated with `ratio` as
/// principal_frame() does.
BendField bend_field(const SurfaceGraph& graph, const TensorStack& stack,
                     const Eigen::VectorXd& level, double ratio, const GradientStencil& stencil,
                     CrestKind kind);

template <class Values>
double interpolate(const Values& values, const EdgeCrossing& c) {
  return (1.0 - c.weight) * static_cast<double>(values[c.a]) +
         c.weight * static_cast<double>(values[c.b]);
}

/// -<grad e, t> on one face with directions made consistent, whether or not a line crosses it; 0
/// where they cannot be made consistent.
double face_sharpness(const SurfaceGraph& graph, const BendField& field, std::int32_t face);

/// A piece of a crest line across a triangle, between crossings of two of its edges.
struct RidgeSegment {
  std::int32_t from = 0;
  std::int32_t to = 0;
};

struct RidgeSegments {
  std::vector<EdgeCrossing> crossings;  ///< one an edge, in order of a, then b
  std::vector<RidgeSegment> segments;   ///< in order of faces
};

/// Lines of Eq. 5.43 with the sign of E-29: zero crossings of the extremality, its directions made
/// consistent within every triangle, where the bend is a maximum, positive, and the stronger of
/// the two principal curvatures. Triangles whose directions cannot be made consistent (about
/// umbilics) and those at guarded vertices have none. Cost: O(F).
RidgeSegments find_ridge_segments(const SurfaceGraph& graph, const BendField& field);

/// Chains of segments: crossings in order; a closed one repeats its first at the end. Where more
/// than two segments meet (on an edge with more than two faces) chains end.
std::vector<std::vector<std::int32_t>> link_segments(const RidgeSegments& found);

}  // namespace dupin::detail
