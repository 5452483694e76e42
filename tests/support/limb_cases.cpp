#include "tests/support/limb_cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dupin/warp/planar_graph.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/shape_from_image.h"
#include "dupin/warp/triangulate_outline.h"

namespace dupin::test {
namespace {

using Eigen::Index;
using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// A stroke with round ends whose radius goes from one end to the other.
struct Stroke {
  Vector2d from, to;
  double radius_from = 0.0, radius_to = 0.0;
};

Raster draw(int width, int height, const std::vector<Stroke>& strokes) {
  Raster raster = make_raster(width, height, 8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Vector2d p(x + 0.5, y + 0.5);
      double alpha = 0.0;
      for (const Stroke& stroke : strokes) {
        const Vector2d way = stroke.to - stroke.from;
        const double length = way.squaredNorm();
        const double t =
            length > 0.0 ? std::clamp((p - stroke.from).dot(way) / length, 0.0, 1.0) : 0.0;
        const double radius = (1.0 - t) * stroke.radius_from + t * stroke.radius_to;
        alpha = std::max(alpha, 0.5 + radius - (p - stroke.from - t * way).norm());
      }
      std::uint8_t* pixel =
          raster.rgba8.data() + 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                     static_cast<std::size_t>(x));
      const int stripe = (x / 8 + y / 8) % 2;
      pixel[0] = static_cast<std::uint8_t>(stripe == 0 ? 40 : 200);
      pixel[1] = static_cast<std::uint8_t>(120 + y % 100);
      pixel[2] = 160;
      pixel[3] = static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(alpha, 0.0, 1.0)));
    }
  }
  return raster;
}

// A limb along a stroke: the cut lies across it at the joint, the pins at a third and near the end.
LimbCase limb_along(const std::string& name, const Vector2d& joint, const Vector2d& end,
                    double half_width, const std::vector<Vector2d>& body, double angle_deg) {
  LimbCase limb;
  limb.name = name;
  limb.joint = joint;
  const Vector2d along = (end - joint).normalized();
  const Vector2d across(-along.y(), along.x());
  limb.cut_from = joint - (half_width + 2.0) * across;
  limb.cut_to = joint + (half_width + 2.0) * across;
  limb.limb = {joint + 0.35 * (end - joint), joint + 0.95 * (end - joint)};
  limb.body = body;
  limb.angle_deg = angle_deg;
  return limb;
}

bool do_cross(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  return (cross(b - a, c - a) > 0.0) != (cross(b - a, d - a) > 0.0) &&
         (cross(d - c, a - c) > 0.0) != (cross(d - c, b - c) > 0.0);
}

Vector2d centre(const PlanarMesh& mesh, Index f) {
  return (mesh.points.row(mesh.triangles(f, 0)) + mesh.points.row(mesh.triangles(f, 1)) +
          mesh.points.row(mesh.triangles(f, 2)))
             .transpose() /
         3.0;
}

// Triangles that are reached from the end of the limb without a way over the cut.
std::vector<std::uint8_t> limb_triangles(const PlanarMesh& mesh, const LimbCase& limb) {
  const PlanarGraph graph = make_planar_graph(mesh);
  std::vector<std::uint8_t> is_limb(static_cast<std::size_t>(mesh.triangles.rows()), 0);
  std::vector<std::int32_t> open = {closest_mesh_point(mesh, limb.limb.back()).triangle};
  is_limb[static_cast<std::size_t>(open[0])] = 1;
  while (!open.empty()) {
    const std::int32_t f = open.back();
    open.pop_back();
    for (Index k = 0; k < 3; ++k) {
      const std::int32_t next = graph.across(f, k);
      if (next < 0 || is_limb[static_cast<std::size_t>(next)] != 0 ||
          do_cross(centre(mesh, f), centre(mesh, next), limb.cut_from, limb.cut_to))
        continue;
      is_limb[static_cast<std::size_t>(next)] = 1;
      open.push_back(next);
    }
  }
  return is_limb;
}

double share_of(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto at = std::min(values.size() - 1,
                           static_cast<std::size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

// Calls visit(place, place on `moved`) for the pixel centres of triangle f.
template <typename Visit>
void for_pixels(const PlanarMesh& mesh, const Points2& moved, Index f, const Visit& visit) {
  Vector2d p[3];
  Vector2d q[3];
  for (Index k = 0; k < 3; ++k) {
    p[k] = mesh.points.row(mesh.triangles(f, k)).transpose();
    q[k] = moved.row(mesh.triangles(f, k)).transpose();
  }
  const double area = cross(p[1] - p[0], p[2] - p[0]);
  if (!(area > 0.0)) return;
  const auto [low_x, high_x] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
  const auto [low_y, high_y] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
  for (double y = std::ceil(low_y - 0.5) + 0.5; y <= high_y; y += 1.0) {
    for (double x = std::ceil(low_x - 0.5) + 0.5; x <= high_x; x += 1.0) {
      const Vector2d at(x, y);
      const double a = cross(p[1] - at, p[2] - at) / area;
      const double b = cross(p[2] - at, p[0] - at) / area;
      const double c = 1.0 - a - b;
      if (a >= 0.0 && b >= 0.0 && c >= 0.0) visit(at, Vector2d(a * q[0] + b * q[1] + c * q[2]));
    }
  }
}

}  // namespace

std::vector<LimbPicture> drawn_figures() {
  std::vector<LimbPicture> figures(3);
  {
    LimbPicture& figure = figures[0];
    figure.name = "arms out";
    figure.raster = draw(420, 620,
                         {{{210, 75}, {210, 75}, 55, 55},
                          {{210, 120}, {210, 160}, 26, 40},
                          {{210, 190}, {210, 320}, 70, 62},
                          {{155, 175}, {45, 280}, 25, 19},
                          {{265, 175}, {375, 280}, 25, 19},
                          {{180, 350}, {165, 585}, 36, 24},
                          {{242, 350}, {257, 585}, 36, 24}});
    const Vector2d chest(210, 210);
    const Vector2d belly(210, 320);
    const Vector2d head(210, 75);
    const Vector2d right_foot(257, 580);
    const Vector2d left_hand(50, 275);
    const Vector2d right_hand(370, 275);
    figure.limbs = {
        limb_along("arm raised", {110, 218}, {45, 280}, 24, {chest, belly, head, right_hand}, 40),
        limb_along("arm lowered", {110, 218}, {45, 280}, 24, {chest, belly, head, right_hand}, -30),
        limb_along("forearm", {320, 227.5}, {375, 280}, 24, {{275, 185}, chest, belly, left_hand},
                   -35),
        limb_along("leg", {174, 440}, {165, 585}, 35,
                   {chest, belly, {160, 300}, {255, 330}, right_foot}, 15),
        limb_along("shin", {170, 500}, {165, 585}, 31, {{176, 440}, belly, chest, right_foot}, 25)};
  }
  {
    LimbPicture& figure = figures[1];
    figure.name = "stride";
    figure.raster = draw(460, 560,
                         {{{245, 70}, {245, 70}, 48, 48},
                          {{240, 110}, {235, 150}, 24, 34},
                          {{235, 170}, {225, 300}, 52, 46},
                          {{200, 165}, {110, 205}, 22, 18},
                          {{110, 205}, {80, 290}, 18, 15},
                          {{268, 170}, {350, 215}, 22, 18},
                          {{350, 215}, {420, 170}, 18, 15},
                          {{212, 320}, {150, 420}, 34, 25},
                          {{150, 420}, {75, 500}, 25, 18},
                          {{242, 320}, {310, 405}, 34, 25},
                          {{310, 405}, {320, 525}, 25, 18}});
    const Vector2d chest(232, 190);
    const Vector2d belly(225, 300);
    const Vector2d head(245, 70);
    figure.limbs = {
        limb_along("forearm raised", {108, 212}, {80, 290}, 22, {{150, 187}, chest, belly, head},
                   40),
        limb_along("forearm lowered", {356, 211}, {420, 170}, 22, {{305, 190}, chest, belly, head},
                   30),
        limb_along("shin", {142, 429}, {75, 500}, 30, {{185, 365}, belly, chest, {310, 405}}, -30),
        limb_along("lower leg", {311, 417}, {320, 525}, 30, {{275, 362}, belly, chest, {150, 420}},
                   20)};
  }
  {
    LimbPicture& figure = figures[2];
    figure.name = "toy";
    figure.raster = draw(500, 420,
                         {{{150, 190}, {340, 190}, 62, 70},
                          {{115, 105}, {115, 105}, 58, 58},
                          {{150, 150}, {120, 120}, 45, 45},
                          {{125, 235}, {115, 390}, 24, 20},
                          {{190, 235}, {200, 390}, 24, 20},
                          {{310, 240}, {300, 390}, 26, 20},
                          {{375, 235}, {392, 390}, 26, 20},
                          {{395, 165}, {480, 80}, 18, 12}});
    figure.limbs = {
        limb_along("fore leg", {121, 272}, {115, 390}, 24,
                   {{115, 105}, {150, 190}, {340, 190}, {200, 385}, {392, 385}}, 30),
        limb_along("hind leg", {383, 275}, {392, 390}, 26,
                   {{115, 105}, {150, 190}, {340, 190}, {300, 385}}, -35),
        limb_along("tail", {410, 150}, {480, 80}, 20, {{115, 105}, {150, 190}, {340, 190}}, 40)};
  }
  return figures;
}

std::vector<LimbPicture> cut_out_limbs() {
  const auto limb = [](const std::string& file, const Vector2d& joint, const Vector2d& cut_from,
                       const Vector2d& cut_to, const std::vector<Vector2d>& pins,
                       const std::vector<Vector2d>& body, double angle_deg) {
    LimbCase result;
    result.name = file;
    result.joint = joint;
    result.cut_from = cut_from;
    result.cut_to = cut_to;
    result.limb = pins;
    result.body = body;
    result.angle_deg = angle_deg;
    return LimbPicture{file, {}, {result}};
  };
  return {
      limb("jeans", {0.355, 0.4}, {0.2, 0.4}, {0.49, 0.4}, {{0.33, 0.55}, {0.29, 0.85}},
           {{0.35, 0.1}, {0.65, 0.1}, {0.62, 0.3}, {0.7, 0.85}}, 15),
      limb("coat", {0.158, 0.58}, {0.067, 0.53}, {0.248, 0.631}, {{0.144, 0.631}, {0.123, 0.708}},
           {{0.5, 0.4}, {0.3, 0.88}, {0.7, 0.88}, {0.82, 0.55}}, 25),
      limb("lab_coat", {0.176, 0.605}, {0.1016, 0.55}, {0.254, 0.656},
           {{0.18, 0.69}, {0.09, 0.645}}, {{0.5, 0.45}, {0.3, 0.88}, {0.65, 0.88}, {0.78, 0.55}},
           25),
      limb("woman_fashion_01_gerald__01", {0.43, 0.74}, {0.15, 0.74}, {0.72, 0.74},
           {{0.47, 0.82}, {0.53, 0.94}}, {{0.45, 0.1}, {0.45, 0.3}, {0.3, 0.6}, {0.62, 0.6}}, -20),
      limb("socks", {0.39, 0.52}, {0.22, 0.42}, {0.58, 0.63}, {{0.38, 0.68}, {0.16, 0.72}},
           {{0.4, 0.1}, {0.3, 0.3}, {0.48, 0.3}, {0.48, 0.45}}, 20),
      limb("swimsuit", {0.273, 0.17}, {0.22, 0.17}, {0.33, 0.17}, {{0.273, 0.14}, {0.273, 0.085}},
           {{0.35, 0.3}, {0.65, 0.3}, {0.5, 0.5}, {0.5, 0.8}, {0.72, 0.1}}, -25),
      limb("running_shirt", {0.33, 0.2}, {0.24, 0.2}, {0.42, 0.2}, {{0.33, 0.16}, {0.33, 0.09}},
           {{0.35, 0.6}, {0.65, 0.6}, {0.5, 0.8}, {0.67, 0.1}}, 20),
      limb("tshirt", {0.25, 0.40}, {0.25, 0.26}, {0.25, 0.54}, {{0.18, 0.53}, {0.11, 0.42}},
           {{0.5, 0.45}, {0.33, 0.6}, {0.33, 0.85}, {0.67, 0.85}, {0.78, 0.42}}, 20)};
}

LimbPicture with_picture(LimbPicture in_shares, Raster raster) {
  const Eigen::Array2d size(raster.width, raster.height);
  const auto scale = [&](Vector2d& place) { place = (place.array() * size).matrix(); };
  for (LimbCase& limb : in_shares.limbs) {
    for (Vector2d* place : {&limb.joint, &limb.cut_from, &limb.cut_to}) scale(*place);
    for (Vector2d& place : limb.limb) scale(place);
    for (Vector2d& place : limb.body) scale(place);
  }
  in_shares.raster = std::move(raster);
  return in_shares;
}

PlanarMesh mesh_of_picture(const Raster& raster, double rows) {
  const ImageShape shape = shape_from_image(raster);
  const Points2& outer = shape.outline.loops.at(0);
  OutlineOptions outline;
  outline.spacing_px = (outer.col(1).maxCoeff() - outer.col(1).minCoeff()) / rows;
  MeshingOptions meshing;
  meshing.spacing_px = outline.spacing_px;
  return triangulate_outline(prepare_outline(shape.outline, outline).outline, {}, meshing).mesh;
}

LimbErrors measure_limb(const PlanarMesh& mesh, const LimbCase& limb,
                        const DeformOptions& options) {
  const double angle = limb.angle_deg * std::numbers::pi / 180.0;
  Eigen::Matrix2d turn;
  turn << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  const auto turned = [&](const Vector2d& p) -> Vector2d {
    return limb.joint + turn * (p - limb.joint);
  };
  std::vector<Pin> pins;
  const auto add = [&](const Vector2d& source, const Vector2d& target) {
    Pin pin;
    pin.source = source;
    pin.target = target;
    pins.push_back(pin);
  };
  for (const Vector2d& p : limb.limb) add(p, turned(p));
  add(limb.joint, limb.joint);
  for (const Vector2d& p : limb.body) add(p, p);
  const Deformation result = deform(mesh, pins, options);

  const std::vector<std::uint8_t> is_limb = limb_triangles(mesh, limb);
  const Vector2d cut = limb.cut_to - limb.cut_from;
  const double height = mesh.points.col(1).maxCoeff() - mesh.points.col(1).minCoeff();
  std::vector<double> on_limb;
  std::vector<double> on_body;
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const bool is_on_limb = is_limb[static_cast<std::size_t>(f)] != 0;
    for_pixels(mesh, result.points, f, [&](const Vector2d& p, const Vector2d& q) {
      if (!is_on_limb)
        on_body.push_back((q - p).norm() / height);
      else if (std::abs(cross(cut, p - limb.cut_from)) >= 0.25 * cut.squaredNorm())
        on_limb.push_back((q - turned(p)).norm() / height);
    });
  }
  LimbErrors errors;
  errors.limb_median = share_of(on_limb, 0.5);
  errors.limb_most = share_of(on_limb, 0.9);
  errors.body_median = share_of(on_body, 0.5);
  errors.body_most = share_of(on_body, 0.9);
  errors.num_limb = static_cast<Index>(on_limb.size());
  errors.num_body = static_cast<Index>(on_body.size());
  errors.flipped = static_cast<Index>(result.quality.flipped.size());
  return errors;
}

DeformOptions thesis_options() {
  DeformOptions options;
  options.warp.metric = WarpMetric::edges;
  options.warp.edge_weights = EdgeWeights::uniform;
  options.warp.beta = 2.0;
  options.warp.rotation = RotationMode::thesis;
  options.is_polished = false;
  return options;
}

DeformOptions image_space_options() {
  DeformOptions options;
  options.warp.metric = WarpMetric::euclidean;
  options.warp.iterations = 0;
  options.is_polished = false;
  return options;
}

}  // namespace dupin::test
