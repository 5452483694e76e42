#include "dupin/render/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dupin/base/decimal.h"
#include "dupin/base/error.h"

namespace dupin {
namespace {

void validate(const Camera& camera) {
  if (!std::isfinite(camera.azimuth_deg)) throw InvalidArgument("the azimuth is not finite");
  if (!std::isfinite(camera.elevation_deg) || !std::isfinite(camera.perspective) ||
      !std::isfinite(camera.zoom)) {
    throw InvalidArgument("a value of the camera is not finite");
  }
  if (!(camera.elevation_deg >= -90.0 && camera.elevation_deg <= 90.0)) {
    throw InvalidArgument("the elevation must be in [-90, 90] degrees");
  }
  if (!(camera.perspective >= 0.0 && camera.perspective <= 0.8)) {
    throw InvalidArgument("perspective must be in [0, 0.8]");
  }
  if (!(camera.zoom > 0.0 && camera.zoom <= 16.0)) {
    throw InvalidArgument("zoom must be in (0, 16]");
  }
}

}  // namespace

Camera Camera::of(View view) {
  Camera camera;
  switch (view) {
    case View::front:
      break;
    case View::back:
      camera.azimuth_deg = 180.0;
      break;
    case View::left:
      camera.azimuth_deg = -90.0;
      break;
    case View::right:
      camera.azimuth_deg = 90.0;
      break;
    case View::top:
      camera.elevation_deg = 90.0;
      break;
    case View::bottom:
      camera.elevation_deg = -90.0;
      break;
    case View::iso:
      camera.azimuth_deg = 35.0;
      camera.elevation_deg = 20.0;
      break;
  }
  return camera;
}

Camera camera_of(const std::string& name) {
  if (name == "front") return Camera::of(View::front);
  if (name == "back") return Camera::of(View::back);
  if (name == "left") return Camera::of(View::left);
  if (name == "right") return Camera::of(View::right);
  if (name == "top") return Camera::of(View::top);
  if (name == "bottom") return Camera::of(View::bottom);
  if (name == "iso" || name == "three-quarter") return Camera::of(View::iso);
  Camera camera;
  const char* at = name.data();
  const char* end = at + name.size();
  const bool is_pair = parse_decimal(at, end, camera.azimuth_deg) && at != end && *at++ == ',' &&
                       parse_decimal(at, end, camera.elevation_deg) && at == end;
  if (!is_pair) {
    throw InvalidArgument(
        "view is \"" + escaped(name, 40) +
            "\", expected front, back, left, right, top, bottom, iso or AZIMUTH,ELEVATION",
        "for example --view 35,20");
  }
  validate(camera);
  return camera;
}

Eigen::Matrix3d view_rotation(const Camera& camera) {
  const double a = std::remainder(camera.azimuth_deg, 360.0) * std::numbers::pi / 180.0;
  const double e = camera.elevation_deg * std::numbers::pi / 180.0;
  Eigen::Matrix3d rotation;
  rotation.row(0) << std::cos(a), 0.0, -std::sin(a);
  rotation.row(1) << -std::sin(a) * std::sin(e), std::cos(e), -std::cos(a) * std::sin(e);
  rotation.row(2) << std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e);
  return rotation;
}

Eigen::Vector3d Projection::to_view(const Eigen::Vector3d& world) const {
  return rotation * ((world - center) * unit);
}

Eigen::Vector3d Projection::project(const Eigen::Vector3d& view) const {
  const double w = 1.0 - perspective * view.z();
  return {offset.x() + pixels * view.x() / w, offset.y() - pixels * view.y() / w, view.z() / w};
}

Projection fit_projection(const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points,
                          const Eigen::VectorXd& radii, const Camera& camera,
                          const Viewport& viewport) {
  validate(camera);
  Projection fit;
  fit.rotation = view_rotation(camera);
  fit.perspective = camera.perspective;
  fit.offset << viewport.x + 0.5 * viewport.width, viewport.y + 0.5 * viewport.height;
  fit.pixels = 0.5 * std::min(viewport.width, viewport.height);
  if (points.rows() == 0) return fit;

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::RowVector3d low = Eigen::RowVector3d::Constant(kInfinity);
  Eigen::RowVector3d high = -low;
  const bool has_radii = radii.size() == points.rows();
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double r = has_radii ? radii[i] : 0.0;
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(points(i, k)) || !std::isfinite(r) || r < 0.0) {
        throw InvalidArgument("point " + std::to_string(i) + " of the scene is not finite");
      }
      low[k] = std::min(low[k], points(i, k) - r);
      high[k] = std::max(high[k], points(i, k) + r);
    }
  }
  // Halves first, then scaled to unit size: no square of a coordinate is ever formed in mu.
  fit.center = (0.5 * low + 0.5 * high).transpose();
  const Eigen::RowVector3d half = 0.5 * high - 0.5 * low;
  const double size = half.maxCoeff();
  double radius = 0.0;
  if (size > 0.0) {
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Eigen::Vector3d p = (points.row(i).transpose() - fit.center) / size;
      radius = std::max(radius, p.norm() + (has_radii ? radii[i] / size : 0.0));
    }
  }
  const double reach = size * radius;
  // 1 / reach overflows below 1e-308: such a scene is a point.
  fit.unit = reach > 1e-300 ? 1.0 / reach : 1.0;

  Eigen::Vector2d box_low = Eigen::Vector2d::Constant(kInfinity);
  Eigen::Vector2d box_high = -box_low;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::Vector3d v = fit.to_view(points.row(i).transpose());
    const double r = has_radii ? radii[i] * fit.unit : 0.0;
    const double w = 1.0 - fit.perspective * std::min(1.0, v.z() + r);
    const Eigen::Vector2d p(v.x() / w, -v.y() / w);
    box_low = box_low.cwiseMin(p - Eigen::Vector2d::Constant(r / w));
    box_high = box_high.cwiseMax(p + Eigen::Vector2d::Constant(r / w));
  }
  const Eigen::Vector2d extent = box_high - box_low;
  double pixels = kInfinity;
  if (extent.x() > 0.0) pixels = std::min(pixels, viewport.width / extent.x());
  if (extent.y() > 0.0) pixels = std::min(pixels, viewport.height / extent.y());
  if (!std::isfinite(pixels)) pixels = 0.5 * std::min(viewport.width, viewport.height);
  fit.pixels = pixels * 0.98 * camera.zoom;
  fit.offset -= fit.pixels * 0.5 * (box_low + box_high);
  return fit;
}

}  // namespace dupin
