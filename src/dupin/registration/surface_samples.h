#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mls/mls_patch.h"

namespace dupin {

/// Where a point lies against a patch.
struct PatchFoot {
  double distance = 0.0;                                   ///< signed, along the normal [mu]
  Eigen::RowVector3d normal = Eigen::RowVector3d::Zero();  ///< of the patch there, unit
};

/// A surface as smooth patches at evenly spread places: what the fine stage of registration
/// measures distances to. Noise of single points is averaged away, and a patch follows the
/// curvature where a plane would not.
struct SurfaceSamples {
  Status status = Status::ok;
  Points points;                        ///< #S by 3, on the patches [mu]
  Points normals;                       ///< #S by 3 unit
  std::vector<MlsPatch> patches;        ///< #S
  std::vector<double> variance;         ///< #S: mean square residual of the points [mu^2]
  std::vector<std::uint8_t> is_border;  ///< #S: its neighbourhood lies to one side of it
  double spacing = 0.0;                 ///< edge of the cells, one sample each [mu]
  double radius = 0.0;                  ///< of the patches [mu]
  double noise_sigma = 0.0;             ///< root mean square residual of the points [mu]
  Eigen::Index num_points = 0;          ///< of the surface
  /// Sample nearest to the centre of each cell of a coarse grid, -1 where none is near.
  std::vector<std::int32_t> grid;
  Eigen::Vector3i grid_size = Eigen::Vector3i::Zero();
  Eigen::RowVector3d grid_origin = Eigen::RowVector3d::Zero();  ///< corner of the first cell [mu]
  double grid_step = 0.0;                                       ///< edge of its cells [mu]

  /// A sample near `point`: that nearest to the centre of its cell; -1 if there is none within
  /// three cells. Cost: O(1).
  Eigen::Index near(const Eigen::RowVector3d& point) const;

  /// `point` against patch `sample`; nothing where it lies beyond what the patch was fitted to.
  std::optional<PatchFoot> foot(Eigen::Index sample, const Eigen::RowVector3d& point) const;
};

/// Options of sample_surface().
struct SurfaceSampleOptions {
  double spacing = 0.0;  ///< > 0 [mu]
  double radius = 0.0;   ///< of the patches, > 0 [mu]
};

/// One sample in every cell of a grid, at the point nearest to its centre, where the neighbourhood
/// determines a quadratic patch. `normals` (#V by 3) say which side is outward.
/// @throws InvalidArgument if sizes differ, a value is not finite or an option is out of range
/// Cost: O(V log V + S neighbours).
SurfaceSamples sample_surface(const Points& points, const Points& normals,
                              const SurfaceSampleOptions& options, RunControl run = {});

}  // namespace dupin
