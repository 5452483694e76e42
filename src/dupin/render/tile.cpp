#include "dupin/render/tile.h"

#include <cmath>
#include <limits>

#include "dupin/render/shading.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kFar = -1e9F;
constexpr std::int32_t kNoItem = -1;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// Ball fragment of a sample, in a list threaded through one array.
struct Fragment {
  float depth;
  float alpha;
  Vector3f color;
  std::int32_t next;
};

class Tile {
 public:
  Tile(const PreparedScene& scene, Index index)
      : scene_(scene),
        projection_(scene.projection),
        rate_(scene.options.supersampling),
        pixel_x_(static_cast<int>(index % scene.tiles_x) * PreparedScene::kTile),
        pixel_y_(static_cast<int>(index / scene.tiles_x) * PreparedScene::kTile),
        side_((PreparedScene::kTile + 2 * PreparedScene::kBorder) * rate_) {
    box_.x0 = (pixel_x_ - PreparedScene::kBorder) * rate_;
    box_.y0 = (pixel_y_ - PreparedScene::kBorder) * rate_;
    box_.x1 = box_.x0 + side_;
    box_.y1 = box_.y0 + side_;
    const std::size_t count = at(side_) * at(side_);
    depth_.assign(count, kFar);
    item_.assign(count, kNoItem);
    color_.assign(count, Eigen::Vector4f::Zero());
  }

  bool draw_solids(Index index);
  bool draw_bubbles(Index index);
  void shade();
  void darken_edges();
  void blend_bubbles();
  void write(Image& image) const;

 private:
  std::size_t slot(int x, int y) const { return at(y - box_.y0) * at(side_) + at(x - box_.x0); }
  double pixel_of(int sample) const { return (sample + 0.5) / rate_; }
  // The line of sight through a sample: origin + z * direction over the depth axis z.
  Vector3d sight_origin(int x, int y) const {
    return {(pixel_of(x) - projection_.offset.x()) / projection_.pixels,
            (projection_.offset.y() - pixel_of(y)) / projection_.pixels, 0.0};
  }
  Vector3d sight_direction(const Vector3d& origin) const {
    return {-projection_.perspective * origin.x(), -projection_.perspective * origin.y(), 1.0};
  }
  double depth_of(double z) const { return z / (1.0 - projection_.perspective * z); }
  Vector3d point_at(int x, int y, double depth) const {
    const Vector3d origin = sight_origin(x, y);
    return origin + depth / (1.0 + projection_.perspective * depth) * sight_direction(origin);
  }
  Vector3f view_at(const Vector3d& point) const {
    return (Vector3d::UnitZ() - projection_.perspective * point).normalized().cast<float>();
  }
  SampleBox clipped(double left, double top, double right, double bottom) const {
    SampleBox out;
    const auto low = [&](double pixel, int from) {
      return static_cast<int>(
          std::clamp(std::floor(pixel * rate_), 1.0 * from, 1.0 * from + side_));
    };
    out.x0 = low(left, box_.x0);
    out.y0 = low(top, box_.y0);
    out.x1 = low(right + 1.0, box_.x0);
    out.y1 = low(bottom + 1.0, box_.y0);
    return out;
  }
  void offer(int x, int y, double depth, std::int32_t item) {
    const std::size_t s = slot(x, y);
    const auto d = static_cast<float>(depth);
    if (d > depth_[s]) {
      depth_[s] = d;
      item_[s] = item;
    }
  }
  void draw_triangle(std::int32_t item);
  void draw_disc(std::int32_t item, const PreparedDisc& disc);
  void draw_segment(std::int32_t item, const PreparedSegment& segment);
  void draw_bubble(const PreparedSphere& sphere);
  void draw_contact(const PreparedSphere& sphere, int x, int y);
  Vector3f shade_triangle(const std::array<std::int32_t, 3>& corner, int x, int y) const;
  Vector3f shade_disc(const PreparedDisc& disc, int x, int y) const;
  bool is_surface(std::int32_t item) const {
    return item >= 0 &&
           item < static_cast<std::int32_t>(scene_.triangles.size() + scene_.discs.size());
  }

  const PreparedScene& scene_;
  const Projection& projection_;
  int rate_;
  int pixel_x_;
  int pixel_y_;
  int side_;
  SampleBox box_;
  std::vector<float> depth_;
  std::vector<std::int32_t> item_;
  std::vector<Eigen::Vector4f> color_;  // energy times alpha, alpha
  std::vector<Vector3f> points_;        // what each sample sees, when there are bubbles
  std::vector<std::int32_t> head_;
  std::vector<Fragment> fragments_;
};

void Tile::draw_triangle(std::int32_t item) {
  const auto& corner = scene_.triangles[at(item)];
  const PreparedVertex& a = scene_.vertices[at(corner[0])];
  const PreparedVertex& b = scene_.vertices[at(corner[1])];
  const PreparedVertex& c = scene_.vertices[at(corner[2])];
  if (doubled_area(a.place, b.place, c.place) == 0) return;
  const SamplePlane depth(a.place, b.place, c.place, static_cast<double>(a.depth),
                          static_cast<double>(b.depth), static_cast<double>(c.depth));
  fill_triangle(a.place, b.place, c.place, box_,
                [&](int x, int y) { offer(x, y, depth.at(x, y), item); });
}

void Tile::draw_disc(std::int32_t item, const PreparedDisc& disc) {
  // The view box of the ball about the disc, at its nearest and farthest depth.
  const double w = 1.0 - projection_.perspective * std::min(1.0, disc.center.z() + disc.radius);
  const Vector3d middle = projection_.project(disc.center);
  const double reach = 1.5 * projection_.pixels * disc.radius / w + 1.0;
  const SampleBox area =
      clipped(middle.x() - reach, middle.y() - reach, middle.x() + reach, middle.y() + reach);
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      const Vector3d origin = sight_origin(x, y);
      const Vector3d sight = sight_direction(origin);
      const double slope = disc.normal.dot(sight);
      if (!(std::abs(slope) > 1e-9)) continue;
      const double z = disc.normal.dot(disc.center - origin) / slope;
      const double away = (origin + z * sight - disc.center).squaredNorm();
      if (away <= disc.radius * disc.radius) offer(x, y, depth_of(z), item);
    }
  }
}

void Tile::draw_segment(std::int32_t item, const PreparedSegment& s) {
  const Eigen::Vector2d along = (s.b - s.a).head<2>();
  const double length_squared = along.squaredNorm();
  const SampleBox area = clipped(std::min(s.a.x() - s.radius_a, s.b.x() - s.radius_b),
                                 std::min(s.a.y() - s.radius_a, s.b.y() - s.radius_b),
                                 std::max(s.a.x() + s.radius_a, s.b.x() + s.radius_b),
                                 std::max(s.a.y() + s.radius_a, s.b.y() + s.radius_b));
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      const Eigen::Vector2d p(pixel_of(x) - s.a.x(), pixel_of(y) - s.a.y());
      const double t =
          length_squared > 0.0 ? std::clamp(p.dot(along) / length_squared, 0.0, 1.0) : 0.0;
      const double radius = s.radius_a + t * (s.radius_b - s.radius_a);
      if ((p - t * along).squaredNorm() <= radius * radius) {
        offer(x, y, s.a.z() + t * (s.b.z() - s.a.z()), item);
      }
    }
  }
}

bool Tile::draw_solids(Index index) {
  const auto num_triangles = static_cast<std::int32_t>(scene_.triangles.size());
  const auto num_discs = static_cast<std::int32_t>(scene_.discs.size());
  const std::int32_t first = scene_.solid.offset[at(index)];
  const std::int32_t last = scene_.solid.offset[at(index + 1)];
  for (std::int32_t i = first; i < last; ++i) {
    const std::int32_t item = scene_.solid.item[at(i)];
    if (item < num_triangles) {
      draw_triangle(item);
    } else if (item < num_triangles + num_discs) {
      draw_disc(item, scene_.discs[at(item - num_triangles)]);
    } else {
      draw_segment(item, scene_.segments[at(item - num_triangles - num_discs)]);
    }
  }
  return last > first;
}

Vector3f Tile::shade_triangle(const std::array<std::int32_t, 3>& corner, int x, int y) const {
  const PreparedVertex& a = scene_.vertices[at(corner[0])];
  const PreparedVertex& b = scene_.vertices[at(corner[1])];
  const PreparedVertex& c = scene_.vertices[at(corner[2])];
  // Areas in the picture over w are the barycentric coordinates on the surface.
  const FixedPoint p{x * 256 + 128, y * 256 + 128};
  const auto area = static_cast<float>(doubled_area(a.place, b.place, c.place));
  float wb = static_cast<float>(doubled_area(a.place, p, c.place)) / area;
  float wc = static_cast<float>(doubled_area(a.place, b.place, p)) / area;
  float wa = (1.0F - wb - wc) * a.inverse_w;
  wb *= b.inverse_w;
  wc *= c.inverse_w;
  const float scale = 1.0F / (wa + wb + wc);
  wa *= scale;
  wb *= scale;
  wc *= scale;
  Vector3f normal = wa * a.normal + wb * b.normal + wc * c.normal;
  const float size = normal.norm();
  const Vector3f view = view_at(point_at(x, y, static_cast<double>(depth_[slot(x, y)])));
  normal = size > 1e-6F ? Vector3f(normal / size) : view;
  float sky = wa * a.sky + wb * b.sky + wc * c.sky;
  const auto strength = static_cast<float>(scene_.options.occlusion);
  if (normal.dot(view) < 0.0F && area > 0.0F) {
    // Front faces turn from +x to -y in a picture whose y points down, so this is the inside.
    normal = -normal;
    sky = 0.6F;
  }
  sky = 1.0F - strength * (1.0F - sky);
  if (a.position < 0.0F)
    return shaded(normal, view, wa * a.color + wb * b.color + wc * c.color, sky);
  const auto top = static_cast<float>(scene_.map_colors.size() - 1);
  const float place =
      std::clamp(wa * a.position + wb * b.position + wc * c.position, 0.0F, 1.0F) * top;
  const std::size_t low = std::min(static_cast<std::size_t>(place), scene_.map_colors.size() - 2);
  const float mix = place - static_cast<float>(low);
  return shaded(normal, view,
                (1.0F - mix) * scene_.map_colors[low] + mix * scene_.map_colors[low + 1], sky);
}

Vector3f Tile::shade_disc(const PreparedDisc& disc, int x, int y) const {
  const Vector3d point = point_at(x, y, static_cast<double>(depth_[slot(x, y)]));
  Vector3d normal = disc.normal;
  if (disc.is_round) {
    const Vector3d side = (point - disc.center) / disc.radius;
    normal = (side + std::sqrt(std::max(0.0, 1.0 - side.squaredNorm())) * normal).normalized();
  }
  return shaded(normal.cast<float>(), view_at(point), disc.color, 1.0F);
}

void Tile::shade() {
  const auto num_triangles = static_cast<std::int32_t>(scene_.triangles.size());
  const auto num_discs = static_cast<std::int32_t>(scene_.discs.size());
  // Only the ring that the filter reads; the outer pixel serves the edges.
  for (int y = box_.y0 + rate_; y < box_.y1 - rate_; ++y) {
    for (int x = box_.x0 + rate_; x < box_.x1 - rate_; ++x) {
      const std::size_t s = slot(x, y);
      const std::int32_t item = item_[s];
      if (item == kNoItem) continue;
      Vector3f color;
      if (item < num_triangles) {
        color = shade_triangle(scene_.triangles[at(item)], x, y);
      } else if (item < num_triangles + num_discs) {
        color = shade_disc(scene_.discs[at(item - num_triangles)], x, y);
      } else {
        color = scene_.segments[at(item - num_triangles - num_discs)].color;
      }
      color_[s] = {color.x(), color.y(), color.z(), 1.0F};
    }
  }
}

void Tile::darken_edges() {
  const auto strength = static_cast<float>(scene_.options.edges);
  if (!(strength > 0.0F)) return;
  // A step in depth of several pixel widths between neighbouring pixels is a silhouette; a slope
  // is not, because the steps to both sides cancel.
  const float to_pixels = static_cast<float>(projection_.pixels);
  for (int y = box_.y0 + rate_; y < box_.y1 - rate_; ++y) {
    for (int x = box_.x0 + rate_; x < box_.x1 - rate_; ++x) {
      const std::size_t s = slot(x, y);
      if (!is_surface(item_[s])) continue;
      const float here = depth_[s];
      const auto drop = [&](int i, int j) { return here - std::max(-2.0F, depth_[slot(i, j)]); };
      const float step = std::max(drop(x - rate_, y) + drop(x + rate_, y),
                                  drop(x, y - rate_) + drop(x, y + rate_)) *
                         to_pixels;
      const float edge = std::clamp((step - 5.0F) / 15.0F, 0.0F, 1.0F);
      color_[s].head<3>() *= 1.0F - strength * edge * edge * (3.0F - 2.0F * edge);
    }
  }
}

void Tile::draw_contact(const PreparedSphere& sphere, int x, int y) {
  // Where the ball meets the surface, a line one pixel wide: it says what the ball covers even
  // when balls overlap.
  const std::size_t s = slot(x, y);
  if (!is_surface(item_[s]) || sphere.opacity >= 1.0) return;
  const Vector3f center = sphere.center.cast<float>();
  const auto off_at = [&](int i, int j) {
    return static_cast<double>((points_[slot(i, j)] - center).norm()) - sphere.radius;
  };
  const double off = off_at(x, y);
  const double sample = 1.0 / (projection_.pixels * rate_);
  if (std::abs(off) > 4.0 * rate_ * sample) return;
  // Over the slope of the distance in the picture, so that the line is as wide where the surface
  // runs along the ball; steps in depth are no slopes.
  const int next_x = x + 1 < box_.x1 ? x + 1 : x - 1;
  const int next_y = y + 1 < box_.y1 ? y + 1 : y - 1;
  const double slope = std::hypot(std::min(2.0 * sample, std::abs(off_at(next_x, y) - off)),
                                  std::min(2.0 * sample, std::abs(off_at(x, next_y) - off)));
  if (std::abs(off) > 1.0 * rate_ * slope) return;
  const float alpha = 0.85F;
  color_[s].head<3>() = (1.0F - alpha) * color_[s].head<3>() + alpha * 0.7F * sphere.color;
}

void Tile::draw_bubble(const PreparedSphere& sphere) {
  const double q = projection_.perspective;
  const double nearest = std::min(sphere.center.z() + sphere.radius, q > 0.0 ? 0.95 / q : 1e9);
  const double farthest = sphere.center.z() - sphere.radius;
  Eigen::Vector4d bound(1e300, 1e300, -1e300, -1e300);
  for (const double z : {nearest, farthest}) {
    const Vector3d p = projection_.project({sphere.center.x(), sphere.center.y(), z});
    const double reach = projection_.pixels * sphere.radius / (1.0 - q * z);
    bound << std::min(bound[0], p.x() - reach), std::min(bound[1], p.y() - reach),
        std::max(bound[2], p.x() + reach), std::max(bound[3], p.y() + reach);
  }
  const SampleBox area = clipped(bound[0], bound[1], bound[2], bound[3]);
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      draw_contact(sphere, x, y);
      const Vector3d origin = sight_origin(x, y);
      const Vector3d sight = sight_direction(origin);
      const Vector3d to_origin = origin - sphere.center;
      const double a = sight.squaredNorm();
      const double b = sight.dot(to_origin);
      const double c = to_origin.squaredNorm() - sphere.radius * sphere.radius;
      const double discriminant = b * b - a * c;
      if (discriminant < 0.0) continue;
      const double z = (std::sqrt(discriminant) - b) / a;
      if (q * z >= 0.95) continue;
      const auto depth = static_cast<float>(depth_of(z));
      const std::size_t s = slot(x, y);
      if (depth <= depth_[s]) continue;
      const Vector3d point = origin + z * sight;
      const Vector3f normal = ((point - sphere.center) / sphere.radius).cast<float>();
      const Vector3f view = view_at(point);
      fragments_.push_back({depth,
                            bubble_alpha(static_cast<float>(sphere.opacity), normal.dot(view)),
                            shaded_bubble(normal, view, sphere.color), head_[s]});
      head_[s] = static_cast<std::int32_t>(fragments_.size()) - 1;
    }
  }
}

bool Tile::draw_bubbles(Index index) {
  const std::int32_t first = scene_.bubble.offset[at(index)];
  const std::int32_t last = scene_.bubble.offset[at(index + 1)];
  if (first == last) return false;
  head_.assign(depth_.size(), -1);
  points_.resize(depth_.size());
  for (int y = box_.y0; y < box_.y1; ++y) {
    for (int x = box_.x0; x < box_.x1; ++x) {
      const std::size_t s = slot(x, y);
      const float depth = std::max(-2.0F, depth_[s]);
      points_[s] = point_at(x, y, static_cast<double>(depth)).cast<float>();
    }
  }
  for (std::int32_t i = first; i < last; ++i) {
    draw_bubble(scene_.spheres[at(scene_.bubble.item[at(i)])]);
  }
  return true;
}

void Tile::blend_bubbles() {
  std::vector<const Fragment*> stack;
  for (std::size_t s = 0; s < head_.size(); ++s) {
    if (head_[s] < 0) continue;
    stack.clear();
    for (std::int32_t f = head_[s]; f >= 0; f = fragments_[at(f)].next) {
      stack.push_back(&fragments_[at(f)]);
    }
    // Lists hold the last ball first; a stable sort keeps equal depths in one order.
    std::stable_sort(stack.begin(), stack.end(),
                     [](const Fragment* a, const Fragment* b) { return a->depth < b->depth; });
    for (const Fragment* f : stack) {
      color_[s] *= 1.0F - f->alpha;
      color_[s].head<3>() += f->alpha * f->color;
      color_[s].w() += f->alpha;
    }
  }
}

// Weights of the samples within one pixel of a pixel's centre: a Gaussian of deviation 0.42 px,
// wide enough to keep edges free of steps, narrow enough to keep them sharp.
std::vector<float> filter_weights(int rate) {
  std::vector<float> weights;
  double sum = 0.0;
  for (int i = -rate; i < 2 * rate; ++i) {
    const double away = (i + 0.5) / rate - 0.5;
    const double weight = std::abs(away) < 1.0 ? std::exp(-0.5 * away * away / (0.42 * 0.42)) : 0.0;
    weights.push_back(static_cast<float>(weight));
    sum += weight;
  }
  for (float& weight : weights) weight /= static_cast<float>(sum);
  return weights;
}

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
}

// Energies as sRGB bytes, in steps fine enough that the dark end rounds like the formula.
constexpr int kSrgbSteps = 16384;

std::vector<std::uint8_t> make_srgb_table() {
  std::vector<std::uint8_t> table;
  for (int i = 0; i <= kSrgbSteps; ++i) {
    table.push_back(to_byte(static_cast<float>(srgb_from_linear(i / (1.0 * kSrgbSteps)))));
  }
  return table;
}

std::uint8_t to_srgb_byte(float energy) {
  static const std::vector<std::uint8_t> table = make_srgb_table();
  const float place = std::clamp(energy, 0.0F, 1.0F) * static_cast<float>(kSrgbSteps);
  return table[static_cast<std::size_t>(place + 0.5F)];
}

void Tile::write(Image& image) const {
  const int width = std::min(PreparedScene::kTile, image.width - pixel_x_);
  const int height = std::min(PreparedScene::kTile, image.height - pixel_y_);
  const std::vector<float> weights = filter_weights(rate_);
  const int taps = 3 * rate_;
  // Rows first, then columns: the filter is a product.
  std::vector<Eigen::Vector4f> rows(at(width) * at(side_), Eigen::Vector4f::Zero());
  for (int y = rate_; y < side_ - rate_; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t first = at(y) * at(side_) + at((x + PreparedScene::kBorder - 1) * rate_);
      Eigen::Vector4f sum = Eigen::Vector4f::Zero();
      for (int k = 0; k < taps; ++k) sum += weights[at(k)] * color_[first + at(k)];
      rows[at(y) * at(width) + at(x)] = sum;
    }
  }
  const bool is_white = scene_.options.background == Background::white;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Eigen::Vector4f sum = Eigen::Vector4f::Zero();
      const int first = (y + PreparedScene::kBorder - 1) * rate_;
      for (int k = 0; k < taps; ++k) {
        sum += weights[at(k)] * rows[at(first + k) * at(width) + at(x)];
      }
      std::uint8_t* out = &image.rgba[4 * (at(pixel_y_ + y) * at(image.width) + at(pixel_x_ + x))];
      if (is_white) {
        sum.array() += 1.0F - sum.w();
      } else if (sum.w() > 0.0F) {
        sum.head<3>() /= sum.w();
      }
      out[0] = to_srgb_byte(sum.x());
      out[1] = to_srgb_byte(sum.y());
      out[2] = to_srgb_byte(sum.z());
      out[3] = is_white ? std::uint8_t{255} : to_byte(sum.w());
    }
  }
}

}  // namespace

void draw_tile(const PreparedScene& scene, Index index, Image& image) {
  const auto is_empty = [index](const TileBins& bins) {
    return bins.offset[at(index)] == bins.offset[at(index + 1)];
  };
  if (is_empty(scene.solid) && is_empty(scene.bubble)) return;
  Tile tile(scene, index);
  if (tile.draw_solids(index)) {
    tile.shade();
    tile.darken_edges();
  }
  if (tile.draw_bubbles(index)) tile.blend_bubbles();
  tile.write(image);
}

}  // namespace dupin::detail
