#include "dupin/warp/triangle_raster.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

constexpr double kMaxCoordinate = 1048576.0;  // [px]: products of edges stay below 2^62

std::int64_t floor_div(std::int64_t a, std::int64_t b) {
  const std::int64_t quotient = a / b;
  return quotient - (a % b != 0 && (a < 0) != (b < 0) ? 1 : 0);
}
std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return -floor_div(-a, b); }

void validate_view(const WarpView& view) {
  const auto require_scale = [](const char* name, double value) {
    if (!(value >= 1e-6 && value <= 1e6)) {
      throw InvalidArgument(std::string("view.") + name + " is " + std::to_string(value) +
                            ", legal range 1e-6 to 1e6");
    }
  };
  require_scale("source_scale", view.source_scale);
  require_scale("target_scale", view.target_scale);
  if (!std::isfinite(view.origin.x()) || !std::isfinite(view.origin.y()))
    throw InvalidArgument("view.origin is not finite");
}

void validate_order(const std::vector<std::int32_t>& order, Index num_triangles) {
  if (order.empty()) return;
  if (static_cast<Index>(order.size()) != num_triangles) {
    throw InvalidArgument("draw_order has " + std::to_string(order.size()) + " entries for " +
                          std::to_string(num_triangles) + " triangles");
  }
  std::vector<bool> is_there(order.size(), false);
  for (const std::int32_t face : order) {
    if (face < 0 || face >= num_triangles || is_there[static_cast<std::size_t>(face)]) {
      throw InvalidArgument("draw_order is no permutation: face " + std::to_string(face));
    }
    is_there[static_cast<std::size_t>(face)] = true;
  }
}

/// Corners in pixels; throws where the grid cannot hold them.
Points2 in_pixels(const Points2& points, double scale, const Vector2d& origin, const char* what) {
  Points2 pixels(points.rows(), 2);
  for (Index i = 0; i < points.rows(); ++i) {
    for (Index axis = 0; axis < 2; ++axis) {
      const double value = points(i, axis);
      if (!std::isfinite(value) || !(std::abs(value) <= 1e12) ||
          !(std::abs((value - origin(axis)) * scale) <= kMaxCoordinate)) {
        throw InvalidArgument(std::string(what) + " " + std::to_string(i) +
                              " is not finite or beyond 2^20 px");
      }
      pixels(i, axis) = (value - origin(axis)) * scale;
    }
  }
  return pixels;
}

std::int64_t twice_area(const RasterTriangle& t) {
  return (t.x[1] - t.x[0]) * (t.y[2] - t.y[0]) - (t.y[1] - t.y[0]) * (t.x[2] - t.x[0]);
}

/// Fits the way to the source, target corners p, source corners s.
void fit_source(RasterTriangle& t, std::array<Vector2d, 3> p, const std::array<Vector2d, 3>& s) {
  const auto cross = [](const Vector2d& a, const Vector2d& b) {
    return a.x() * b.y() - a.y() * b.x();
  };
  double area = cross(p[1] - p[0], p[2] - p[0]);
  if (!(std::abs(area) >= 1.0 / (1 << 18))) {
    // Thinner than the grid: its corners on the grid have an area.
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = Vector2d(static_cast<double>(t.x[k]), static_cast<double>(t.y[k])) / kSubPixels;
    }
    area = cross(p[1] - p[0], p[2] - p[0]);
  }
  const std::array<Vector2d, 3> shift{s[0] - p[0], s[1] - p[1], s[2] - p[2]};
  const Vector2d a = p[1] - p[0];
  const Vector2d b = p[2] - p[0];
  t.anchor_x = p[0].x();
  t.anchor_y = p[0].y();
  t.shift_x = shift[0].x();
  t.shift_y = shift[0].y();
  for (Index axis = 0; axis < 2; ++axis) {
    const double along_a = shift[1](axis) - shift[0](axis);
    const double along_b = shift[2](axis) - shift[0](axis);
    t.slope[static_cast<std::size_t>(2 * axis)] = (along_a * b.y() - along_b * a.y()) / area;
    t.slope[static_cast<std::size_t>(2 * axis + 1)] = (along_b * a.x() - along_a * b.x()) / area;
  }
  t.box_left = std::min({s[0].x(), s[1].x(), s[2].x()}) - 1.0;
  t.box_right = std::max({s[0].x(), s[1].x(), s[2].x()}) + 1.0;
  t.box_top = std::min({s[0].y(), s[1].y(), s[2].y()}) - 1.0;
  t.box_bottom = std::max({s[0].y(), s[1].y(), s[2].y()}) + 1.0;
}

void sort_into_bands(TriangleBands& bands, int height) {
  const int num_bands = (height + kBandRows - 1) / kBandRows;
  bands.begin.assign(static_cast<std::size_t>(num_bands) + 1, 0);
  const auto for_each_band = [&](const auto& take) {
    for (std::size_t i = 0; i < bands.triangles.size(); ++i) {
      const RasterTriangle& t = bands.triangles[i];
      if (t.first_row > t.last_row) continue;
      for (int b = t.first_row / kBandRows; b <= t.last_row / kBandRows; ++b) {
        take(static_cast<std::size_t>(b), static_cast<std::int32_t>(i));
      }
    }
  };
  for_each_band([&](std::size_t b, std::int32_t) { ++bands.begin[b + 1]; });
  for (std::size_t b = 1; b < bands.begin.size(); ++b) bands.begin[b] += bands.begin[b - 1];
  bands.member.resize(static_cast<std::size_t>(bands.begin.back()));
  std::vector<std::int32_t> next(bands.begin.begin(), bands.begin.end() - 1);
  for_each_band([&](std::size_t b, std::int32_t i) {
    bands.member[static_cast<std::size_t>(next[b]++)] = i;
  });
}

}  // namespace

TriangleBands make_bands(const PlanarMesh& mesh, const Points2& target,
                         const std::vector<std::int32_t>& draw_order, const WarpView& view,
                         int width, int height) {
  validate(mesh);
  validate_view(view);
  validate_order(draw_order, mesh.triangles.rows());
  if (target.rows() != mesh.points.rows()) {
    throw InvalidArgument("target has " + std::to_string(target.rows()) + " points, the mesh " +
                          std::to_string(mesh.points.rows()));
  }
  if (width < 1 || width > 32768 || height < 1 || height > 32768) {
    throw InvalidArgument("view: " + std::to_string(width) + " x " + std::to_string(height) +
                          " pixels, both sides must be in [1, 32768]");
  }
  const Points2 from = in_pixels(mesh.points, view.source_scale, Vector2d::Zero(), "mesh vertex");
  const Points2 to = in_pixels(target, view.target_scale, view.origin, "target point");
  TriangleBands bands;
  bands.triangles.reserve(static_cast<std::size_t>(mesh.triangles.rows()));
  for (Index i = 0; i < mesh.triangles.rows(); ++i) {
    const Index face = draw_order.empty() ? i : draw_order[static_cast<std::size_t>(i)];
    std::array<Vector2d, 3> p;
    std::array<Vector2d, 3> s;
    RasterTriangle t;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t vertex = mesh.triangles(face, static_cast<Index>(k));
      p[k] = to.row(vertex).transpose();
      s[k] = from.row(vertex).transpose();
      t.x[k] = std::llround(p[k].x() * kSubPixels);
      t.y[k] = std::llround(p[k].y() * kSubPixels);
    }
    const std::int64_t area = twice_area(t);
    if (area < 0) ++bands.num_flipped;
    if (area == 0) ++bands.num_degenerate;
    if (area == 0 || (area < 0 && !view.draw_flipped)) continue;
    fit_source(t, p, s);
    if (area < 0) {
      std::swap(t.x[1], t.x[2]);
      std::swap(t.y[1], t.y[2]);
    }
    const std::int64_t half = kSubPixels / 2;
    const std::int64_t top = std::min({t.y[0], t.y[1], t.y[2]});
    const std::int64_t bottom = std::max({t.y[0], t.y[1], t.y[2]});
    t.first_row =
        static_cast<std::int32_t>(std::max<std::int64_t>(0, ceil_div(top - half, kSubPixels)));
    t.last_row = static_cast<std::int32_t>(
        std::min<std::int64_t>(height - 1, floor_div(bottom - half, kSubPixels)));
    bands.triangles.push_back(t);
  }
  sort_into_bands(bands, height);
  return bands;
}

PixelSpan span_of(const RasterTriangle& t, std::int32_t y, std::int32_t width) {
  std::int64_t first = 0;
  std::int64_t last = width - 1;
  const std::int64_t py = kSubPixels * y + kSubPixels / 2;
  const std::int64_t px = kSubPixels / 2;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    const std::int64_t dx = t.x[next] - t.x[k];
    const std::int64_t dy = t.y[next] - t.y[k];
    // Positive on the inner side; falls by 256 dy from pixel to pixel.
    const std::int64_t side = dx * (py - t.y[k]) - dy * (px - t.x[k]);
    const bool is_inclusive = dy < 0 || (dy == 0 && dx > 0);
    const std::int64_t least = is_inclusive ? 0 : 1;
    if (dy < 0) {
      first = std::max(first, ceil_div(least - side, -dy * kSubPixels));
    } else if (dy > 0) {
      last = std::min(last, floor_div(side - least, dy * kSubPixels));
    } else if (side < least) {
      return {};
    }
  }
  if (first > last) return {};
  return {static_cast<std::int32_t>(first), static_cast<std::int32_t>(last) + 1};
}

}  // namespace dupin::detail
