#include "registration_pictures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "dupin/io/png.h"
#include "dupin/render/renderer.h"

namespace dupin::cli {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;

constexpr double kDegrees = 180.0 / std::numbers::pi;

struct Box {
  RowVector3d low = RowVector3d::Zero();
  RowVector3d high = RowVector3d::Zero();

  double diagonal() const { return (high - low).norm(); }
  RowVector3d middle() const { return 0.5 * low + 0.5 * high; }
};

Box box_of(const Points& points) {
  return {points.colwise().minCoeff(), points.colwise().maxCoeff()};
}

// Of the mean of the unit normals; short where they point everywhere.
RowVector3d mean_normal(const std::vector<SceneSurface>& surfaces) {
  RowVector3d sum = RowVector3d::Zero();
  Index count = 0;
  for (const SceneSurface& surface : surfaces) {
    sum += surface.normals.colwise().sum();
    count += surface.normals.rows();
  }
  return count > 0 ? RowVector3d(sum / static_cast<double>(count)) : sum;
}

Image drawn(const RegistrationPicture& picture, int width, int height, const RunControl& run) {
  RenderOptions options;
  options.width = width;
  options.height = height;
  options.camera = picture.camera;
  const Image image = render_surface(picture.scene, options, run);
  run.throw_if_cancelled();  // a picture whose tiles are not all drawn is no picture
  return image;
}

}  // namespace

Rgb moving_color() { return {0.93, 0.56, 0.18}; }
Rgb fixed_color() { return {0.30, 0.56, 0.82}; }
Rgb agreeing_color() { return {0.0, 0.50, 0.36}; }
Rgb other_color() { return {0.80, 0.28, 0.42}; }

Rgb scan_color(std::size_t index) {
  if (index == 0) return fixed_color();
  if (index == 1) return moving_color();
  // The golden angle never comes near a hue that it has just used.
  const double hue = 2.399963 * static_cast<double>(index) + 1.2;
  const double lightness = index % 2 == 0 ? 62.0 : 72.0;
  return srgb_from_lab({lightness, 48.0 * std::cos(hue), 48.0 * std::sin(hue)});
}

ReportColor legend_of(const Rgb& color, const std::string& label) {
  return {color[0], color[1], color[2], label};
}

SceneSurface drawn_scan(const LoadedSurface& scan, const Points& normals, const Pose& pose,
                        const Rgb& color) {
  SceneSurface out;
  out.points = transformed(scan.points, pose);
  out.triangles = scan.graph.triangles;
  const Points& own = scan.graph.normals;
  out.normals = turned(own.rows() == scan.points.rows() ? own : normals, pose);
  out.color = color;
  if (scan.graph.is_mesh()) return out;
  // A scan sees about half of what its box could hold: discs of this size just overlap on it.
  out.disc_radius =
      1.1 * box_of(out.points).diagonal() / std::sqrt(static_cast<double>(out.points.rows()));
  return out;
}

std::array<Camera, 2> two_cameras(const std::vector<SceneSurface>& surfaces) {
  const RowVector3d mean = mean_normal(surfaces);
  Camera first;
  first.azimuth_deg = 30.0;
  first.elevation_deg = 20.0;
  Camera second = first;
  second.azimuth_deg = 150.0;
  if (mean.norm() > 0.15) {
    const RowVector3d toward = mean.normalized();
    const double azimuth = std::atan2(toward[0], toward[2]) * kDegrees;
    const double elevation = std::asin(std::clamp(toward[1], -1.0, 1.0)) * kDegrees;
    first.azimuth_deg = azimuth - 12.0;
    second.azimuth_deg = azimuth + 58.0;
    first.elevation_deg = std::clamp(elevation + 6.0, -85.0, 85.0);
    second.elevation_deg = std::clamp(elevation + 14.0, -85.0, 85.0);
  }
  return {first, second};
}

RegistrationPicture overlay_picture(const std::vector<SceneSurface>& surfaces, const Camera& camera,
                                    const std::string& alt, const std::string& caption) {
  RegistrationPicture picture;
  picture.scene.surfaces = surfaces;
  // Those of triangles are made towards the viewer: open surfaces are seen from behind as well.
  for (SceneSurface& surface : picture.scene.surfaces) {
    if (surface.triangles.rows() > 0) surface.normals.resize(0, 3);
  }
  picture.scene.legend.has_scale_bar = true;
  picture.camera = camera;
  picture.alt = alt;
  picture.caption = caption;
  return picture;
}

RegistrationPicture overlay_or_row(std::vector<SceneSurface> surfaces, const Camera& camera,
                                   const std::string& alt, const std::string& caption) {
  Box all;
  double largest = 0.0;
  double smallest = 0.0;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const Box box = box_of(surfaces[i].points);
    if (i == 0) {
      all = box;
      largest = smallest = box.diagonal();
    }
    all.low = all.low.cwiseMin(box.low);
    all.high = all.high.cwiseMax(box.high);
    largest = std::max(largest, box.diagonal());
    smallest = std::min(smallest, box.diagonal());
  }
  if (all.diagonal() <= 3.0 * largest && smallest >= 0.1 * largest)
    return overlay_picture(surfaces, camera, alt, caption);
  const RowVector3d right = view_rotation(camera).row(0);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const Box box = box_of(surfaces[i].points);
    const double scale = box.diagonal() > 0.0 ? 1.0 / box.diagonal() : 1.0;
    surfaces[i].points = scale * (surfaces[i].points.rowwise() - box.middle());
    surfaces[i].points.rowwise() += 1.05 * static_cast<double>(i) * right;
    surfaces[i].disc_radius *= scale;
  }
  RegistrationPicture picture = overlay_picture(
      surfaces, camera, alt,
      caption +
          " They lie too far apart, or differ too much in size, for one picture: drawn side "
          "by side, all of one size.");
  picture.scene.legend.has_scale_bar = false;
  return picture;
}

RegistrationPicture matches_picture(SceneSurface moving, SceneSurface fixed,
                                    const std::vector<DrawnMatches>& matches, const Camera& camera,
                                    const std::string& alt, const std::string& caption) {
  Camera parallel = camera;
  parallel.perspective = 0.0;
  const Eigen::Matrix3d view = view_rotation(parallel);
  const RowVector3d right = view.row(0);
  const RowVector3d toward = view.row(2);
  const Eigen::VectorXd across_moving = moving.points * right.transpose();
  const Eigen::VectorXd across_fixed = fixed.points * right.transpose();
  const double widest = std::max(across_moving.maxCoeff() - across_moving.minCoeff(),
                                 across_fixed.maxCoeff() - across_fixed.minCoeff());
  // The gap between the scans, whatever the pose.
  const RowVector3d apart =
      (across_fixed.minCoeff() - across_moving.maxCoeff() - 0.35 * widest) * right;
  moving.points.rowwise() += apart;
  const double depth = box_of(moving.points).diagonal() + box_of(fixed.points).diagonal() +
                       (box_of(moving.points).middle() - box_of(fixed.points).middle()).norm();
  RegistrationPicture picture = overlay_picture({moving, fixed}, parallel, alt, caption);
  const double radius = 0.007 * widest;
  for (std::size_t s = 0; s < matches.size(); ++s) {
    const DrawnMatches& set = matches[s];
    // In a parallel picture what is nearer covers, and stays at its place.
    const RowVector3d lift =
        depth * (2.0 - static_cast<double>(s) / static_cast<double>(matches.size())) * toward;
    for (Index k = 0; k < set.from.rows(); ++k) {
      ScenePolyline line;
      line.points.resize(2, 3);
      line.points.row(0) = set.from.row(k) + apart + lift;
      line.points.row(1) = set.to.row(k) + lift;
      line.color = set.color;
      line.thickness_px = Eigen::VectorXd::Constant(1, set.width_px);
      for (Index end = 0; end < 2; ++end) {
        SceneSphere dot;
        dot.center = line.points.row(end).transpose();
        dot.radius = radius;
        dot.color = set.color;
        dot.opacity = 1.0;
        picture.scene.spheres.push_back(dot);
      }
      picture.scene.polylines.push_back(std::move(line));
    }
  }
  return picture;
}

ReportPicture embedded(const RegistrationPicture& picture, int width, int height,
                       const RunControl& run) {
  return {data_uri(format_png(drawn(picture, width, height, run))), picture.alt, picture.caption,
          width, height};
}

ReportPicture drawn_beside(const RegistrationPicture& picture, const std::string& directory,
                           const std::string& file, int width, int height, const RunControl& run) {
  write_png((std::filesystem::path(directory) / file).string(), drawn(picture, width, height, run));
  return {file, picture.alt, picture.caption, width, height};
}

}  // namespace dupin::cli
