#pragma once

// Pairs of partial scans with known truth, shared by the tests of registration and its bench.

#include <Eigen/Core>
#include <cstdint>

#include "dupin/mesh/mesh.h"
#include "dupin/registration/pose.h"

namespace dupin::test {

/// Options of make_scan_pair().
struct ScanPairOptions {
  /// Area that both parts share over the area of one part, in (0, 1].
  double overlap = 0.5;
  double noise_percent = 0.0;    ///< isotropic, of the mean edge of the whole surface, >= 0
  bool has_face_centers = true;  ///< `fixed` samples the surface at its face centres
  /// `moving` is given in a unit of its own: its scale is log-uniform in [1 / scale_range,
  /// scale_range]. 1: the same unit.
  double scale_range = 1.0;
  std::uint64_t seed = 0;  ///< direction of the cut, pose and noise
};

/// Two parts of one surface. `fixed` stays where the surface is.
struct ScanPair {
  Mesh moving;
  Mesh fixed;
  Pose truth;             ///< from `moving` to `fixed`
  double overlap = 0.0;   ///< as measured on the faces of the two parts
  double diameter = 0.0;  ///< diagonal of the box of the whole surface, in the unit of `fixed`
  double edge = 0.0;      ///< mean edge of the whole surface, in the unit of `fixed`
};

/// Cuts `surface` by two parallel planes of random direction into two parts of equal area that
/// share the stated fraction of it, to within one face. `moving` keeps the vertices of its part;
/// `fixed` has a point at each face centre of its own and the dual faces about each inner vertex,
/// so that no point of one is a point of the other. Deterministic in the seed.
ScanPair make_scan_pair(const Mesh& surface, const ScanPairOptions& options);

/// The faces whose centre has an area quantile in [from, to] along `direction`, without the
/// vertices that none of them uses.
Mesh slice(const Mesh& surface, const Eigen::Vector3d& direction, double from, double to);

/// A point at each face centre; the triangles of a fan about every inner vertex whose faces close a
/// ring. Oriented like `mesh`.
Mesh dual_mesh(const Mesh& mesh);

/// x -> -x, with faces turned over so that they still look outward.
Mesh mirrored(const Mesh& mesh);

/// Uniform rotation, a translation of up to one `diameter` along each axis and a scale that is
/// log-uniform in [1 / scale_range, scale_range].
Pose random_pose(double diameter, double scale_range, std::uint64_t seed);

/// How far `found` is from `truth`: the angle between the rotations [deg], the distance between the
/// two images of the mean of `points` [mu of the target], and the ratio of scales minus one.
struct PoseError {
  double rotation_deg = 0.0;
  double translation = 0.0;
  double scale = 0.0;
};
PoseError pose_error(const Pose& found, const Pose& truth, const Points& points);

}  // namespace dupin::test
