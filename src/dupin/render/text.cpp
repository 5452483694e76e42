#include "dupin/render/text.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "dupin/render/font.h"

namespace dupin {
namespace {

using Eigen::Vector2d;

constexpr double kCapital = 0.70;  // of the em
constexpr double kUnit = kCapital / 100.0;
constexpr double kDotScale = 1.35;  // a dot of the width of a stroke looks too small

double stroke_units(const TextStyle& style) { return style.is_bold ? 15.5 : 10.5; }

std::vector<char32_t> decode(const std::string& text) {
  std::vector<char32_t> out;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const int more = lead < 0x80 ? 0 : lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC0 ? 1 : -1;
    char32_t value = more == 0 ? lead : lead & (0x3FU >> std::max(0, more));
    bool is_valid = more >= 0;
    for (int k = 1; k <= more && is_valid; ++k) {
      const std::size_t at = i + static_cast<std::size_t>(k);
      is_valid = at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U;
      if (is_valid) value = (value << 6U) | (static_cast<unsigned char>(text[at]) & 0x3FU);
    }
    out.push_back(is_valid ? value : U'\ufffd');
    i += is_valid ? static_cast<std::size_t>(more) + 1 : 1;
  }
  return out;
}

struct Stroke {
  Vector2d from;
  Vector2d to;
  double radius;
};

double distance_to(const Vector2d& point, const Stroke& stroke) {
  const Vector2d along = stroke.to - stroke.from;
  const Vector2d to_point = point - stroke.from;
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp(to_point.dot(along) / length, 0.0, 1.0) : 0.0;
  return (to_point - t * along).norm() - stroke.radius;
}

void blend(Image& image, int x, int y, const Rgb& color, double coverage) {
  std::uint8_t* out =
      &image.rgba[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                       static_cast<std::size_t>(x))];
  const double below = out[3] / 255.0 * (1.0 - coverage);
  const double alpha = coverage + below;
  if (!(alpha > 0.0)) return;
  for (int k = 0; k < 3; ++k) {
    const double value = (coverage * 255.0 * color[k] + below * out[k]) / alpha;
    out[k] = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  }
  out[3] = static_cast<std::uint8_t>(std::lround(255.0 * std::min(1.0, alpha)));
}

// Coverage is the distance to the nearest stroke, so that strokes of one glyph join without seams.
void draw_strokes(Image& image, const std::vector<Stroke>& strokes, const Rgb& color) {
  if (strokes.empty()) return;
  Vector2d low = strokes.front().from;
  Vector2d high = low;
  for (const Stroke& s : strokes) {
    low = low.cwiseMin(s.from.cwiseMin(s.to) - Vector2d::Constant(s.radius + 1.0));
    high = high.cwiseMax(s.from.cwiseMax(s.to) + Vector2d::Constant(s.radius + 1.0));
  }
  const auto pixel = [](double v, int limit) {
    return static_cast<int>(std::clamp(std::floor(v), 0.0, 1.0 * limit));
  };
  const int x1 = pixel(high.x() + 1.0, image.width);
  const int y1 = pixel(high.y() + 1.0, image.height);
  for (int y = pixel(low.y(), image.height); y < y1; ++y) {
    for (int x = pixel(low.x(), image.width); x < x1; ++x) {
      const Vector2d center(x + 0.5, y + 0.5);
      double nearest = 1.0;
      for (const Stroke& s : strokes) nearest = std::min(nearest, distance_to(center, s));
      const double coverage = std::clamp(0.5 - nearest, 0.0, 1.0);
      if (coverage > 0.0) blend(image, x, y, color, coverage);
    }
  }
}

}  // namespace

TextExtent measure_text(const std::string& utf8, const TextStyle& style) {
  const double scale = style.size_px * kUnit;
  const double half = 0.5 * stroke_units(style);
  TextExtent extent;
  bool has_ink = false;
  double pen = 0.0;
  for (const char32_t character : decode(utf8)) {
    const detail::Glyph& glyph = detail::glyph_of(character);
    for (const auto& stroke : glyph.strokes) {
      const double radius = glyph.weight * (stroke.size() == 1 ? kDotScale * half : half);
      for (const Vector2d& p : stroke) {
        const TextExtent ink{pen + p.x() - radius, -p.y() - radius, pen + p.x() + radius,
                             -p.y() + radius, 0.0};
        extent.left = has_ink ? std::min(extent.left, ink.left) : ink.left;
        extent.top = has_ink ? std::min(extent.top, ink.top) : ink.top;
        extent.right = has_ink ? std::max(extent.right, ink.right) : ink.right;
        extent.bottom = has_ink ? std::max(extent.bottom, ink.bottom) : ink.bottom;
        has_ink = true;
      }
    }
    pen += glyph.advance;
  }
  return {extent.left * scale, extent.top * scale, extent.right * scale, extent.bottom * scale,
          pen * scale};
}

void draw_text(Image& image, const std::string& utf8, double x, double y, TextAlign align,
               const TextStyle& style) {
  const double scale = style.size_px * kUnit;
  const double radius = 0.5 * stroke_units(style) * scale;
  const TextExtent extent = measure_text(utf8, style);
  double pen = x;
  if (align == TextAlign::left) pen -= extent.left;
  if (align == TextAlign::center) pen -= 0.5 * (extent.left + extent.right);
  if (align == TextAlign::right) pen -= extent.right;
  for (const char32_t character : decode(utf8)) {
    const detail::Glyph& glyph = detail::glyph_of(character);
    std::vector<Stroke> strokes;
    const auto place = [&](const Vector2d& p) {
      return Vector2d(pen + p.x() * scale, y - p.y() * scale);
    };
    for (const auto& line : glyph.strokes) {
      if (line.size() == 1) {
        strokes.push_back({place(line[0]), place(line[0]), kDotScale * glyph.weight * radius});
      }
      for (std::size_t i = 0; i + 1 < line.size(); ++i) {
        strokes.push_back({place(line[i]), place(line[i + 1]), glyph.weight * radius});
      }
    }
    draw_strokes(image, strokes, style.color);
    pen += glyph.advance * scale;
  }
}

void draw_stroke(Image& image, const Vector2d& from, const Vector2d& to, double width_px,
                 const Rgb& color) {
  draw_strokes(image, {{from, to, 0.5 * width_px}}, color);
}

}  // namespace dupin
