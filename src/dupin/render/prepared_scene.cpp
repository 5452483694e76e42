#include "dupin/render/prepared_scene.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/render/occlusion.h"

namespace dupin::detail {
namespace {

using Eigen::Index;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void require_rows(const Points& values, Index rows, const std::string& what, bool may_be_empty) {
  if (values.rows() != rows && !(may_be_empty && values.rows() == 0)) {
    throw InvalidArgument(what + " has " + std::to_string(values.rows()) + " rows, expected " +
                          std::to_string(rows));
  }
  for (Index i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values.data()[i])) {
      throw InvalidArgument(what + " " + std::to_string(i / 3) + " is not finite");
    }
  }
}

void require_color(const Rgb& color, const std::string& what) {
  for (int k = 0; k < 3; ++k) {
    if (!std::isfinite(color[k]) || color[k] < 0.0 || color[k] > 1.0) {
      throw InvalidArgument("the colour of " + what + " must be in [0, 1]");
    }
  }
}

void validate(const SceneSurface& surface) {
  const Index num_points = surface.points.rows();
  require_rows(surface.points, num_points, "point", false);
  require_rows(surface.normals, num_points, "normal", true);
  require_rows(surface.colors, num_points, "colour", true);
  for (Index i = 0; i < surface.colors.size(); ++i) {
    if (surface.colors.data()[i] < 0.0 || surface.colors.data()[i] > 1.0) {
      throw InvalidArgument("colour " + std::to_string(i / 3) + " is outside [0, 1]");
    }
  }
  if (surface.scalar.size() != 0 && surface.scalar.size() != num_points) {
    throw InvalidArgument("there are " + std::to_string(surface.scalar.size()) + " scalars for " +
                          std::to_string(num_points) + " points");
  }
  for (Index i = 0; i < surface.scalar.size(); ++i) {
    if (!std::isfinite(surface.scalar[i])) {
      throw InvalidArgument("scalar " + std::to_string(i) + " is not finite");
    }
  }
  for (Index i = 0; i < surface.triangles.size(); ++i) {
    const std::int32_t v = surface.triangles.data()[i];
    if (v < 0 || v >= num_points) {
      throw InvalidArgument("triangle " + std::to_string(i / 3) + " uses vertex " +
                            std::to_string(v) + " of " + std::to_string(num_points));
    }
  }
  require_color(surface.color, "a surface");
  if (!std::isfinite(surface.disc_radius) || surface.disc_radius < 0.0) {
    throw InvalidArgument("disc_radius must be finite and not negative");
  }
}

double disc_radius_of(const SceneSurface& surface, double unit) {
  if (surface.disc_radius > 0.0) return surface.disc_radius * unit;
  // A body of unit radius has an area near 3 pi: discs of this size just overlap on it.
  return 2.6 / std::sqrt(static_cast<double>(std::max<Index>(1, surface.points.rows())));
}

// Everything that the camera has to hold, with radii.
Projection fit_to(const Scene& scene, const Camera& camera, const Viewport& viewport) {
  Index count = 0;
  for (const auto& s : scene.surfaces) count += s.points.rows();
  const bool has_surface = count > 0;
  // Balls and lines lie on surfaces: they must not make the surface small.
  if (!has_surface) {
    count += static_cast<Index>(scene.spheres.size());
    for (const auto& line : scene.polylines) count += line.points.rows();
  }
  Points points(count, 3);
  Eigen::VectorXd radii = Eigen::VectorXd::Zero(count);
  Index row = 0;
  for (const auto& s : scene.surfaces) {
    points.middleRows(row, s.points.rows()) = s.points;
    row += s.points.rows();
  }
  if (!has_surface) {
    for (const auto& sphere : scene.spheres) {
      points.row(row) = sphere.center.transpose();
      radii[row++] = sphere.radius;
    }
    for (const auto& line : scene.polylines) {
      points.middleRows(row, line.points.rows()) = line.points;
      row += line.points.rows();
    }
  }
  return fit_projection(points, radii, camera, viewport);
}

Points to_local(const Points& points, const Projection& projection) {
  return (points.rowwise() - projection.center.transpose()) * projection.unit;
}

Eigen::Vector3d unit_or_zero(const Eigen::Vector3d& vector) {
  const double size = vector.cwiseAbs().maxCoeff();
  return size > 0.0 ? Eigen::Vector3d((vector / size).normalized()) : Eigen::Vector3d::Zero();
}

void add_mesh(PreparedScene& out, const SceneSurface& surface, const ColorScale& scale,
              const RunControl& run) {
  const Projection& projection = out.projection;
  const Points local = to_local(surface.points, projection);
  Points normals = surface.normals;
  if (normals.rows() == 0) normals = vertex_normals(Mesh{local, surface.triangles});
  for (Index v = 0; v < normals.rows(); ++v) {
    normals.row(v) = unit_or_zero(normals.row(v).transpose()).transpose();
  }
  std::vector<float> sky(at(local.rows()), 1.0F);
  if (out.options.occlusion > 0.0) sky = sky_visibility(local, normals, surface.triangles, run);

  const auto first = static_cast<std::int32_t>(out.vertices.size());
  out.vertices.resize(at(first + local.rows()));
  const double samples = out.options.supersampling * kFixedPerSample;
  parallel_for(0, local.rows(), 4096, [&](Index begin, Index end) {
    for (Index v = begin; v < end; ++v) {
      PreparedVertex& vertex = out.vertices[at(first + v)];
      const Eigen::Vector3d view = projection.rotation * local.row(v).transpose();
      const Eigen::Vector3d pixel = projection.project(view);
      vertex.place = {static_cast<std::int32_t>(std::lround(pixel.x() * samples)),
                      static_cast<std::int32_t>(std::lround(pixel.y() * samples))};
      vertex.depth = static_cast<float>(pixel.z());
      vertex.inverse_w = static_cast<float>(1.0 / (1.0 - projection.perspective * view.z()));
      vertex.normal = (projection.rotation * normals.row(v).transpose()).cast<float>();
      const Rgb color =
          surface.colors.rows() > 0 ? Rgb(surface.colors.row(v).transpose()) : surface.color;
      vertex.color = linear_from_srgb(color).cast<float>();
      if (surface.scalar.size() > 0) {
        vertex.position = static_cast<float>(scale.position(surface.scalar[v]));
      }
      vertex.sky = sky[at(v)];
    }
  });
  for (Index f = 0; f < surface.triangles.rows(); ++f) {
    out.triangles.push_back({first + surface.triangles(f, 0), first + surface.triangles(f, 1),
                             first + surface.triangles(f, 2)});
  }
}

void add_cloud(PreparedScene& out, const SceneSurface& surface, const ColorScale& scale) {
  const double radius = disc_radius_of(surface, out.projection.unit);
  const Points local = to_local(surface.points, out.projection);
  for (Index v = 0; v < local.rows(); ++v) {
    PreparedDisc disc;
    disc.center = out.projection.rotation * local.row(v).transpose();
    disc.radius = radius;
    if (surface.normals.rows() > 0) {
      disc.normal = out.projection.rotation * unit_or_zero(surface.normals.row(v).transpose());
    } else {
      disc.normal.setZero();
    }
    const Eigen::Vector3d to_eye =
        Eigen::Vector3d::UnitZ() - out.projection.perspective * disc.center;
    disc.is_round = disc.normal.isZero(0.0);
    if (disc.is_round) disc.normal = to_eye.normalized();
    if (disc.normal.dot(to_eye) < 0.0) disc.normal = -disc.normal;
    Rgb color = surface.colors.rows() > 0 ? Rgb(surface.colors.row(v).transpose()) : surface.color;
    if (surface.scalar.size() > 0) color = scale.color(surface.scalar[v]);
    disc.color = linear_from_srgb(color).cast<float>();
    out.discs.push_back(disc);
  }
}

void add_lines(PreparedScene& out, const ScenePolyline& line) {
  const double pixel = 1.0 / out.projection.pixels;
  const auto end_of = [&](Index i, double& radius) {
    radius = 0.5 * line.thickness_px[line.thickness_px.size() == 1 ? 0 : i];
    Eigen::Vector3d view = out.projection.to_view(line.points.row(i).transpose());
    // Lifted towards the eye like a tube that lies on the surface, or half of it would drown.
    const Eigen::Vector3d to_eye =
        (Eigen::Vector3d::UnitZ() - out.projection.perspective * view).normalized();
    view += (1.5 * radius + 0.5) * pixel * to_eye;
    return out.projection.project(view);
  };
  for (Index i = 0; i + 1 < line.points.rows(); ++i) {
    PreparedSegment segment;
    segment.a = end_of(i, segment.radius_a);
    segment.b = end_of(i + 1, segment.radius_b);
    segment.color = linear_from_srgb(line.color).cast<float>();
    out.segments.push_back(segment);
  }
}

// Pixels that a ball about `center` may cover: the corners of its box bound its picture.
Eigen::Vector4d ball_box(const Projection& projection, const Eigen::Vector3d& center,
                         double radius) {
  Eigen::Vector4d box(1e300, 1e300, -1e300, -1e300);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0,
                               (corner & 4) != 0 ? 1.0 : -1.0);
    Eigen::Vector3d p = center + radius * sign;
    // Nothing is drawn at or behind the eye.
    if (projection.perspective > 0.0) p.z() = std::min(p.z(), 0.95 / projection.perspective);
    const Eigen::Vector3d q = projection.project(p);
    box << std::min(box[0], q.x()), std::min(box[1], q.y()), std::max(box[2], q.x()),
        std::max(box[3], q.y());
  }
  return box;
}

struct TileRange {
  int x0, y0, x1, y1;  // inclusive; empty when x1 < x0
};

class Binner {
 public:
  Binner(int tiles_x, int tiles_y) : tiles_x_(tiles_x), tiles_y_(tiles_y) {}

  void add(double left, double top, double right, double bottom) {
    // A tile also needs what lies in its border.
    constexpr double kMargin = PreparedScene::kBorder + 1.0;
    ranges_.push_back({first(left - kMargin, tiles_x_), first(top - kMargin, tiles_y_),
                       last(right + kMargin, tiles_x_), last(bottom + kMargin, tiles_y_)});
  }

  TileBins bins() const {
    TileBins out;
    out.offset.assign(at(tiles_x_) * at(tiles_y_) + 1, 0);
    for_each([&](std::size_t tile, std::int32_t) { ++out.offset[tile + 1]; });
    for (std::size_t t = 1; t < out.offset.size(); ++t) out.offset[t] += out.offset[t - 1];
    out.item.resize(at(out.offset.back()));
    std::vector<std::int32_t> next(out.offset.begin(), out.offset.end() - 1);
    for_each([&](std::size_t tile, std::int32_t i) { out.item[at(next[tile]++)] = i; });
    return out;
  }

 private:
  static int first(double pixel, int tiles) {
    return static_cast<int>(std::clamp(std::floor(pixel / PreparedScene::kTile), 0.0, 1.0 * tiles));
  }
  static int last(double pixel, int tiles) {
    return static_cast<int>(
        std::clamp(std::floor(pixel / PreparedScene::kTile), -1.0, tiles - 1.0));
  }
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      const TileRange& r = ranges_[i];
      for (int y = r.y0; y <= r.y1; ++y) {
        for (int x = r.x0; x <= r.x1; ++x) {
          visit(at(y) * at(tiles_x_) + at(x), static_cast<std::int32_t>(i));
        }
      }
    }
  }

  int tiles_x_;
  int tiles_y_;
  std::vector<TileRange> ranges_;
};

void bin_items(PreparedScene& out) {
  Binner solid(out.tiles_x, out.tiles_y);
  const double to_pixel = 1.0 / (kFixedPerSample * out.options.supersampling);
  for (const auto& t : out.triangles) {
    const FixedPoint a = out.vertices[at(t[0])].place;
    const FixedPoint b = out.vertices[at(t[1])].place;
    const FixedPoint c = out.vertices[at(t[2])].place;
    solid.add(std::min({a.x, b.x, c.x}) * to_pixel, std::min({a.y, b.y, c.y}) * to_pixel,
              std::max({a.x, b.x, c.x}) * to_pixel, std::max({a.y, b.y, c.y}) * to_pixel);
  }
  for (const auto& disc : out.discs) {
    const Eigen::Vector4d box = ball_box(out.projection, disc.center, disc.radius);
    solid.add(box[0], box[1], box[2], box[3]);
  }
  for (const auto& s : out.segments) {
    solid.add(std::min(s.a.x() - s.radius_a, s.b.x() - s.radius_b),
              std::min(s.a.y() - s.radius_a, s.b.y() - s.radius_b),
              std::max(s.a.x() + s.radius_a, s.b.x() + s.radius_b),
              std::max(s.a.y() + s.radius_a, s.b.y() + s.radius_b));
  }
  out.solid = solid.bins();
  Binner bubble(out.tiles_x, out.tiles_y);
  for (const auto& sphere : out.spheres) {
    const Eigen::Vector4d box = ball_box(out.projection, sphere.center, sphere.radius);
    bubble.add(box[0], box[1], box[2], box[3]);
  }
  out.bubble = bubble.bins();
}

}  // namespace

void validate(const Scene& scene) {
  for (const auto& surface : scene.surfaces) validate(surface);
  for (const auto& sphere : scene.spheres) {
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(sphere.center[k]))
        throw InvalidArgument("a sphere's centre is not finite");
    }
    if (!std::isfinite(sphere.radius) || sphere.radius <= 0.0) {
      throw InvalidArgument("a sphere's radius must be finite and positive");
    }
    if (!std::isfinite(sphere.opacity) || sphere.opacity <= 0.0 || sphere.opacity > 1.0) {
      throw InvalidArgument("a sphere's opacity must be in (0, 1]");
    }
    require_color(sphere.color, "a sphere");
  }
  for (const auto& line : scene.polylines) {
    require_rows(line.points, line.points.rows(), "line point", false);
    if (line.thickness_px.size() != 1 && line.thickness_px.size() != line.points.rows()) {
      throw InvalidArgument("a line needs one thickness, or one a point");
    }
    for (Index i = 0; i < line.thickness_px.size(); ++i) {
      const double t = line.thickness_px[i];
      if (!std::isfinite(t) || t <= 0.0 || t > 1000.0) {
        throw InvalidArgument("a line's thickness must be in (0, 1000] px");
      }
    }
    require_color(line.color, "a line");
  }
  if (!std::isfinite(scene.scale.range.low) || !std::isfinite(scene.scale.range.high)) {
    throw InvalidArgument("the range of the colour scale is not finite");
  }
}

PreparedScene prepare_scene(const Scene& scene, const RenderOptions& options,
                            const Viewport& viewport, const RunControl& run) {
  PreparedScene out;
  out.options = options;
  out.projection = fit_to(scene, options.camera, viewport);
  out.tiles_x = (options.width + PreparedScene::kTile - 1) / PreparedScene::kTile;
  out.tiles_y = (options.height + PreparedScene::kTile - 1) / PreparedScene::kTile;
  constexpr int kMapColors = 1024;
  for (int i = 0; i <= kMapColors; ++i) {
    const double t = i / static_cast<double>(kMapColors);
    out.map_colors.push_back(linear_from_srgb(map_color(scene.scale.map, t)).cast<float>());
  }
  for (const auto& surface : scene.surfaces) {
    if (surface.triangles.rows() > 0) {
      add_mesh(out, surface, scene.scale, run);
    } else {
      add_cloud(out, surface, scene.scale);
    }
  }
  for (const auto& line : scene.polylines) add_lines(out, line);
  for (const auto& sphere : scene.spheres) {
    out.spheres.push_back({out.projection.to_view(sphere.center),
                           linear_from_srgb(sphere.color).cast<float>(),
                           sphere.radius * out.projection.unit, sphere.opacity});
  }
  bin_items(out);
  return out;
}

}  // namespace dupin::detail
