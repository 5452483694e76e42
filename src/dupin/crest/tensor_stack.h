#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/scalespace/filter_bank.h"
#include "dupin/scalespace/level_schedule.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/curvature.h"
#include "dupin/surface/surface_graph.h"

namespace dupin::detail {

/// Largest curvature that counts, times the mean edge: more is no surface at this sampling.
constexpr double kLargestBend = 1e6;

/// Gradient at the vertices of a function linear over the faces, the mean of the faces around by
/// area: grad f (v) = sum over the ring of weight(k) (f(j) - f(v)).
struct GradientStencil {
  Points weight;  ///< aligned with ring.neighbor [1/mu]; zero where no face has an area
};

/// Cost: O(F valence).
GradientStencil gradient_stencil(const Points& points, const Triangles& triangles,
                                 const Adjacency& ring);

/// Unit normals from area vectors averaged `times` times over the ring before they are made unit:
/// area vectors of a region add up to what its rim says, so that the average of many is nearly free
/// of noise; that of unit vectors is not. #V by 3, zero where the area is.
Points averaged_normals(const Points& points, const Triangles& triangles, const Adjacency& ring,
                        int times);

/// The symmetric part of the gradient of the unit normals, smoothed `normal_smoothing` times: the
/// curvature tensor in world coordinates, S > 0 on a sphere with outward normals. #V by 6 [1/mu].
/// Linear in the normals, so that the stack averages their noise away.
TensorField normal_gradient(const Points& normals, const Adjacency& ring,
                            const GradientStencil& stencil);

/// Curvature tensor and normals smoothed over the levels (thesis 5.6).
struct TensorStack {
  Eigen::VectorXd tau;  ///< L scales, those of the averaged normals included [squared mean edges]
  std::vector<LevelMatrixF> column;  ///< nine of L by V: xx xy xz yy yz zz, normal x y z

  Eigen::Index num_levels() const { return tau.size(); }
  Eigen::Index num_vertices() const { return column.empty() ? 0 : column[0].cols(); }
};

/// Options of make_tensor_stack().
struct TensorStackOptions {
  LevelSchedule schedule = {};
  Filter filter = Filter::implicit;
  int normal_smoothing = 2;
};

/// The stack of `graph` with its vertices at `points`. Absent when cancelled.
/// Cost: nine scale spaces in single precision.
std::optional<TensorStack> make_tensor_stack(const SurfaceGraph& graph, const Points& points,
                                             const TensorStackOptions& options,
                                             const GradientStencil& stencil, const RunControl& run);

/// Principal curvatures and directions at one vertex, k1 >= k2.
struct PrincipalFrame {
  double k1 = 0.0;
  double k2 = 0.0;
  Eigen::RowVector3d d1 = Eigen::RowVector3d::Zero();
  Eigen::RowVector3d d2 = Eigen::RowVector3d::Zero();
};

/// At a level that may lie between two. Zero where no normal is known.
///
/// With `ratio` r > 1 the tensor is extrapolated along tau to no smoothing,
/// T(tau) + (T(tau) - T(r tau)) / (r - 1): what smoothing does to first order is taken back, and a
/// crest stays where it is on the surface. For r = 1.25 the slope of the curvature has the noise
/// that it has without at 0.62 of the tau (see resolved_tau()). Towards the coarsest
/// level, where there is no r tau, less is taken back.
PrincipalFrame principal_frame(const TensorStack& stack, Eigen::Index vertex, double level,
                               double ratio = 1.0);

/// The tau at which a tensor that is not extrapolated has slopes of the same noise: as fine as
/// lines that are extrapolated with `ratio` can be told from noise.
double resolved_tau(double tau, double ratio);

/// Of all vertices at a whole level, #V [1/mu].
struct LevelCurvature {
  Eigen::VectorXf strength;  ///< ||k1| - |k2||, the edge strength of 5.6
  Eigen::VectorXf largest;   ///< max(|k1|, |k2|)
};
LevelCurvature level_curvature(const TensorStack& stack, Eigen::Index level);

}  // namespace dupin::detail
