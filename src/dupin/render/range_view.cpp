#include "dupin/render/range_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr int kBandRows = 16;

void check(const RangeCamera& camera, const RangeViewOptions& options) {
  for (const int side : {camera.rows, camera.cols}) {
    if (side < 1 || side > 32768) throw InvalidArgument("rows and cols must be in [1, 32768]");
  }
  if (!std::isfinite(camera.pixel) || !(camera.pixel > 0.0)) {
    throw InvalidArgument("pixel must be finite and > 0");
  }
  for (int k = 0; k < 3; ++k) {
    if (!std::isfinite(camera.position[k]) || !std::isfinite(camera.rotation.row(k).sum())) {
      throw InvalidArgument("the camera's rotation and position must be finite");
    }
  }
  const double deviation =
      (camera.rotation * camera.rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (deviation > 1e-6) throw InvalidArgument("the camera's rotation must be orthonormal");
  if (!std::isfinite(options.noise_sigma) || !(options.noise_sigma >= 0.0)) {
    throw InvalidArgument("noise_sigma must be finite and >= 0");
  }
  if (!(options.max_incidence_deg > 0.0 && options.max_incidence_deg <= 90.0)) {
    throw InvalidArgument("max_incidence_deg must be in (0, 90]");
  }
}

struct Ray {
  Vector3d origin;
  Vector3d direction;  // z = -1
};

// The ray through the middle of a pixel, in the frame of the camera.
Ray ray_of(const RangeCamera& camera, Index row, Index col) {
  const double x = (static_cast<double>(col) + 0.5 - 0.5 * camera.cols) * camera.pixel;
  const double y = (0.5 * camera.rows - static_cast<double>(row) - 0.5) * camera.pixel;
  if (camera.is_orthographic) return {{x, y, 0.0}, {0.0, 0.0, -1.0}};
  return {Vector3d::Zero(), {x, y, -1.0}};
}

// Rows and columns of the pixels whose rays may meet a triangle, one more on each side.
struct PixelBox {
  int first_row = 0;
  int end_row = 0;
  int first_col = 0;
  int end_col = 0;
};

PixelBox box_of(const RangeCamera& camera, const Vector3d& a, const Vector3d& b,
                const Vector3d& c) {
  PixelBox box{0, camera.rows, 0, camera.cols};
  const double nearest = std::max({a.z(), b.z(), c.z()});
  const double farthest = std::min({a.z(), b.z(), c.z()});
  if (farthest >= 0.0) return {0, 0, 0, 0};
  // A triangle that reaches behind the eye has no bounded image.
  if (!camera.is_orthographic && nearest >= 0.0) return box;
  double low_x = std::numeric_limits<double>::infinity();
  double low_y = low_x;
  double high_x = -low_x;
  double high_y = -low_x;
  for (const Vector3d* p : {&a, &b, &c}) {
    const double scale = camera.pixel * (camera.is_orthographic ? 1.0 : -p->z());
    const double x = p->x() / scale + 0.5 * camera.cols;
    const double y = 0.5 * camera.rows - p->y() / scale;
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
  }
  const auto clamped = [](double value, int size) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(size)));
  };
  box.first_col = clamped(std::floor(low_x) - 1.0, camera.cols);
  box.end_col = clamped(std::ceil(high_x) + 1.0, camera.cols);
  box.first_row = clamped(std::floor(low_y) - 1.0, camera.rows);
  box.end_row = clamped(std::ceil(high_y) + 1.0, camera.rows);
  return box;
}

// How far along `ray` it meets the triangle, in units of its direction; infinity: not at all. The
// three products are those of the edges alone, and change sign exactly with the direction of an
// edge, so that neighbours do not leave a gap between them.
double distance_along(const Ray& ray, Vector3d a, Vector3d b, Vector3d c) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  a -= ray.origin;
  b -= ray.origin;
  c -= ray.origin;
  const double u = ray.direction.dot(b.cross(c));
  const double v = ray.direction.dot(c.cross(a));
  const double w = ray.direction.dot(a.cross(b));
  if (!((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0))) return kNone;
  const Vector3d normal = (b - a).cross(c - a);
  const double slope = normal.dot(ray.direction);
  if (slope == 0.0) return kNone;
  const double t = normal.dot(a) / slope;
  return t > 0.0 ? t : kNone;
}

struct Prepared {
  Points points;  // in the frame of the camera
  std::vector<PixelBox> boxes;
  std::vector<std::vector<std::int32_t>> faces_of_band;
};

Vector3d corner(const Prepared& scene, const Mesh& mesh, Index face, int c) {
  return scene.points.row(mesh.triangles(face, c)).transpose();
}

Prepared prepare(const Mesh& mesh, const RangeCamera& camera) {
  Prepared scene;
  scene.points =
      (mesh.points.rowwise() - camera.position.transpose()) * camera.rotation.transpose();
  scene.boxes.resize(static_cast<std::size_t>(mesh.triangles.rows()));
  const int num_bands = (camera.rows + kBandRows - 1) / kBandRows;
  scene.faces_of_band.resize(static_cast<std::size_t>(num_bands));
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    PixelBox& box = scene.boxes[static_cast<std::size_t>(f)];
    box = box_of(camera, corner(scene, mesh, f, 0), corner(scene, mesh, f, 1),
                 corner(scene, mesh, f, 2));
    if (box.first_row >= box.end_row || box.first_col >= box.end_col) continue;
    for (int band = box.first_row / kBandRows; band <= (box.end_row - 1) / kBandRows; ++band) {
      scene.faces_of_band[static_cast<std::size_t>(band)].push_back(static_cast<std::int32_t>(f));
    }
  }
  return scene;
}

// Distances and faces of the rows of one band. Faces come in rising order and only a nearer one
// replaces another.
void scan_band(const Prepared& scene, const Mesh& mesh, const RangeCamera& camera, Index band,
               std::vector<double>& distance, std::vector<std::int32_t>& face) {
  const int first = static_cast<int>(band) * kBandRows;
  const int end = std::min(camera.rows, first + kBandRows);
  for (const std::int32_t f : scene.faces_of_band[static_cast<std::size_t>(band)]) {
    const PixelBox& box = scene.boxes[static_cast<std::size_t>(f)];
    const Vector3d a = corner(scene, mesh, f, 0);
    const Vector3d b = corner(scene, mesh, f, 1);
    const Vector3d c = corner(scene, mesh, f, 2);
    for (int row = std::max(first, box.first_row); row < std::min(end, box.end_row); ++row) {
      for (int col = box.first_col; col < box.end_col; ++col) {
        const double t = distance_along(ray_of(camera, row, col), a, b, c);
        const auto at = static_cast<std::size_t>(Index{row} * camera.cols + col);
        if (t < distance[at]) {
          distance[at] = t;
          face[at] = f;
        }
      }
    }
  }
}

double incidence_cosine(const Prepared& scene, const Mesh& mesh, Index face,
                        const Vector3d& direction) {
  const Vector3d a = corner(scene, mesh, face, 0);
  const Vector3d normal =
      (corner(scene, mesh, face, 1) - a).cross(corner(scene, mesh, face, 2) - a);
  return std::abs(normal.normalized().dot(direction.normalized()));
}

Mesh triangle_mesh(const PolygonMesh& polygons) {
  Mesh mesh{polygons.points, Triangles(polygons.num_faces(), 3)};
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const auto face = polygons.face(f);
    mesh.triangles.row(f) << face[0], face[1], face[2];
  }
  return mesh;
}

}  // namespace

RangeCamera fit_range_camera(const Points& points, const Camera& view, int rows, int cols) {
  if (rows < 4 || cols < 4) throw InvalidArgument("rows and cols must be at least 4");
  if (points.rows() == 0) throw InvalidArgument("there is no point to look at");
  const Viewport viewport{1.0, 1.0, cols - 2.0, rows - 2.0};
  const Projection fit = fit_projection(points, {}, view, viewport);
  if (!((points.rowwise() - points.row(0)).cwiseAbs().maxCoeff() > 0.0)) {
    throw InvalidArgument("all points to look at are one");
  }
  const double radius = 1.0 / fit.unit;
  RangeCamera camera;
  camera.rotation = fit.rotation;
  camera.rows = rows;
  camera.cols = cols;
  camera.is_orthographic = !(view.perspective > 0.0);
  const double distance = camera.is_orthographic ? 2.0 * radius : radius / view.perspective;
  camera.position = fit.center + distance * fit.rotation.row(2).transpose();
  // A length in the plane through the centre, over the pixels that it takes there.
  camera.pixel = 1.0 / fit.pixels_per_unit();
  if (!camera.is_orthographic) camera.pixel /= distance;
  // The projection centres the image of the points by an offset; here the camera is moved aside,
  // or its frame widened, so that the axis stays in the middle.
  const double shift_x = std::abs(fit.offset.x() - 0.5 * cols);
  const double shift_y = std::abs(fit.offset.y() - 0.5 * rows);
  const double widen =
      std::max((0.5 * cols + shift_x) / (0.5 * cols), (0.5 * rows + shift_y) / (0.5 * rows));
  camera.pixel *= widen;
  return camera;
}

RangeView scan_range_view(const Mesh& mesh, const RangeCamera& camera,
                          const RangeViewOptions& options, RunControl run) {
  check(camera, options);
  validate(mesh);
  RangeView view;
  const auto cancelled = [&] {
    if (run.cancelled()) {
      view = {};
      view.status = Status::cancelled;
    }
    return run.cancelled();
  };
  const Prepared scene = prepare(mesh, camera);
  const auto num_pixels =
      static_cast<std::size_t>(camera.rows) * static_cast<std::size_t>(camera.cols);
  std::vector<double> distance(num_pixels, std::numeric_limits<double>::infinity());
  view.face.assign(num_pixels, -1);
  parallel_for(0, static_cast<Index>(scene.faces_of_band.size()), 1, [&](Index first, Index last) {
    for (Index band = first; band < last && !run.cancelled(); ++band) {
      scan_band(scene, mesh, camera, band, distance, view.face);
    }
  });
  if (cancelled()) return view;

  view.grid.rows = camera.rows;
  view.grid.cols = camera.cols;
  view.grid.points = Points::Zero(static_cast<Index>(num_pixels), 3);
  view.grid.is_valid.assign(num_pixels, 0);
  const double least_cosine = options.max_incidence_deg < 90.0
                                  ? std::cos(options.max_incidence_deg * std::numbers::pi / 180.0)
                                  : 0.0;
  Rng rng(options.seed);
  for (Index row = 0; row < camera.rows; ++row) {
    for (Index col = 0; col < camera.cols; ++col) {
      const Index i = row * camera.cols + col;
      const auto at = static_cast<std::size_t>(i);
      if (view.face[at] < 0) continue;
      const Ray ray = ray_of(camera, row, col);
      if (least_cosine > 0.0 &&
          incidence_cosine(scene, mesh, view.face[at], ray.direction) < least_cosine) {
        continue;
      }
      double along = distance[at];
      if (options.noise_sigma > 0.0) {
        along += options.noise_sigma / ray.direction.norm() * rng.normal();
      }
      view.grid.points.row(i) = (ray.origin + along * ray.direction).transpose();
      view.grid.is_valid[at] = 1;
    }
  }
  if (cancelled()) return view;
  view.mesh = triangle_mesh(triangulate_range_grid(view.grid, options.grid));
  run.report(1.0);
  return view;
}

}  // namespace dupin
