#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/range_grid.h"
#include "dupin/render/camera.h"

namespace dupin {

/// A range camera. In its frame x points right, y up and z towards the viewer; it looks along -z
/// from the origin: camera = rotation * (world - position).
struct RangeCamera {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< rows: right, up, to the viewer
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< [mu, world]
  int rows = 240;                                          ///< in [1, 32768]
  int cols = 320;                                          ///< in [1, 32768]
  /// Side of a pixel, > 0: at distance one along the axis (a tangent) in perspective, [mu] if
  /// orthographic.
  double pixel = 0.002;
  bool is_orthographic = false;
};

/// Options of scan_range_view().
struct RangeViewOptions {
  double noise_sigma = 0.0;  ///< standard deviation along each ray [mu], >= 0
  std::uint64_t seed = 0;    ///< of the noise
  /// Pixels whose ray meets the surface at a larger angle to its normal are invalid, in (0, 90].
  double max_incidence_deg = 90.0;
  RangeGridOptions grid = {};  ///< where the triangles stop
};

/// What a range camera sees, in its own frame.
struct RangeView {
  Status status = Status::ok;      ///< cancelled: everything else is empty
  RangeGrid grid;                  ///< one point a pixel [mu]; row 0 at the top
  std::vector<std::int32_t> face;  ///< rows * cols: triangle that the ray meets first, or -1
  Mesh mesh;                       ///< of the valid pixels, see triangulate_range_grid(); its
                                   ///< triangles look at the camera
};

/// Camera of `rows` by `cols` pixels in the direction `view` from which all of `points` (#V by 3)
/// is just seen, with a small margin. view.perspective is the radius of the points over the
/// distance of the camera; 0 gives an orthographic camera two radii away. view.zoom > 1 crops.
/// @throws InvalidArgument if there is no point or all are one, `view` is out of range, rows or
///   cols are below 4
RangeCamera fit_range_camera(const Points& points, const Camera& view, int rows, int cols);

/// Range picture of `mesh`: the first point of it on the ray through the middle of each pixel.
/// Intersections are computed for ray and triangle in double precision, not interpolated; a ray
/// through a shared edge meets one of its triangles at least. Both sides of a triangle are seen;
/// only what lies in front of the camera (z < 0) is. The same bits for any number of threads.
/// @throws InvalidArgument if the mesh is not valid or a number out of range
/// Cost: O(V + F + pixels + sum of the areas of the triangles in the picture).
RangeView scan_range_view(const Mesh& mesh, const RangeCamera& camera,
                          const RangeViewOptions& options = {}, RunControl run = {});

}  // namespace dupin
