#pragma once

#include <Eigen/Core>
#include <string>

namespace dupin {

/// Where the viewer stands. +y is up, +z points out of the front, +x to the viewer's right there.
enum class View { front, back, left, right, top, bottom, iso };

/// Direction and kind of a picture; the distance follows from what is to be seen.
struct Camera {
  double azimuth_deg = 0.0;    ///< of the viewer about +y: 0 front, 90 from +x [deg]
  double elevation_deg = 0.0;  ///< of the viewer above the x-z plane, in [-90, 90] [deg]
  /// Radius of the scene over the distance of the eye, in [0, 0.8]; 0: orthographic.
  double perspective = 0.18;
  double zoom = 1.0;  ///< > 1 crops the scene, in (0, 16]

  static Camera of(View view);
};

/// "front", "back", "left", "right", "top", "bottom", "iso"/"three-quarter", or "AZIMUTH,ELEVATION"
/// in degrees.
/// @throws InvalidArgument for anything else
Camera camera_of(const std::string& name);

/// Rows: right, up, towards the viewer, as unit vectors of the world.
Eigen::Matrix3d view_rotation(const Camera& camera);

/// A rectangle of the picture [px], y down.
struct Viewport {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// World to picture: view = rotation * (p - center) * unit, then a projective map that keeps planes
/// flat in (x, y, depth), so that depth may be interpolated linearly in the picture.
///
/// With w = 1 - perspective * view.z: pixel = offset + pixels * (view.x, -view.y) / w and
/// depth = view.z / w, which grows towards the viewer.
struct Projection {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [mu]
  double unit = 1.0;         ///< 1 / radius of the scene [1/mu]: |view| <= 1
  double perspective = 0.0;  ///< of Camera
  double pixels = 1.0;       ///< picture size of one view unit at view.z = 0 [px]
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  ///< [px]

  Eigen::Vector3d to_view(const Eigen::Vector3d& world) const;
  /// Pixel x, pixel y (y down) and depth of a point of the view frame.
  Eigen::Vector3d project(const Eigen::Vector3d& view) const;
  /// Picture length of one world length in the plane through the centre [px/mu].
  double pixels_per_unit() const { return pixels * unit; }
};

/// Projection in which `points` (#V by 3, with `radii` about them, #V or empty) just fill
/// `viewport`, centred. Exact for points; the silhouette of a sphere off the axis is elongated by
/// perspective and a margin of 2 % covers it.
/// @throws InvalidArgument if the camera is outside its stated ranges or a coordinate is not finite
/// Cost: O(V).
Projection fit_projection(const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points,
                          const Eigen::VectorXd& radii, const Camera& camera,
                          const Viewport& viewport);

}  // namespace dupin
