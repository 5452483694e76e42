#include "dupin/render/legend.h"

#include <algorithm>
#include <cmath>

#include "dupin/render/text.h"

namespace dupin::detail {
namespace {

using Eigen::Vector2d;

const Rgb kInk(0.13, 0.14, 0.16);
const Rgb kSoftInk(0.36, 0.37, 0.40);

TextStyle title_style(double em) { return {1.25 * em, true, kInk}; }
TextStyle label_style(double em) { return {0.88 * em, false, kInk}; }
TextStyle caption_style(double em) { return {0.80 * em, false, kSoftInk}; }

// Text no wider than `width`: shrunk down to 60 %, then cut.
void draw_fitting(Image& image, std::string text, double x, double y, TextAlign align,
                  TextStyle style, double width) {
  const auto wide = [&] {
    const TextExtent extent = measure_text(text, style);
    return extent.right - extent.left;
  };
  const double natural = wide();
  if (natural > width) style.size_px *= std::max(0.6, width / natural);
  if (wide() > width) {
    const std::string full = text;
    for (std::size_t keep = full.size(); keep > 0 && wide() > width; --keep) {
      // Never inside a UTF-8 sequence.
      if ((static_cast<unsigned char>(full[keep - 1]) & 0xC0U) == 0x80U) continue;
      text = full.substr(0, keep - 1) + "...";
    }
  }
  draw_text(image, text, x, y, align, style);
}

void fill_box(Image& image, int x0, int x1, int y0, int y1, const Rgb& color) {
  for (int y = std::max(0, y0); y < std::min(y1, image.height); ++y) {
    for (int x = std::max(0, x0); x < std::min(x1, image.width); ++x) {
      const std::size_t at =
          4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
               static_cast<std::size_t>(x));
      for (std::size_t k = 0; k < 3; ++k) {
        image.rgba[at + k] =
            static_cast<std::uint8_t>(std::lround(255.0 * color[static_cast<Eigen::Index>(k)]));
      }
      image.rgba[at + 3] = 255;
    }
  }
}

// A box in the colour of "no value" under the bar, its label under the box.
void draw_no_value(const Scene& scene, const LegendLayout& layout, Image& image) {
  const Viewport& bar = layout.bar;
  const int x0 = static_cast<int>(std::lround(bar.x));
  const int side = static_cast<int>(std::lround(bar.width));
  const int y0 = static_cast<int>(std::lround(bar.y + bar.height + 1.1 * layout.em));
  fill_box(image, x0, x0 + side, y0, y0 + side, kNoValueColor);
  const TextStyle style = label_style(layout.em);
  const double right_edge = image.width - 0.8 * layout.em;
  const TextExtent extent = measure_text(scene.legend.no_value_label, style);
  const double x = std::min(1.0 * x0, right_edge - (extent.right - extent.left));
  draw_fitting(image, scene.legend.no_value_label, std::max(0.8 * layout.em, x),
               y0 + side + 1.1 * layout.em, TextAlign::left, style, right_edge - 0.8 * layout.em);
}

void draw_color_bar(const Scene& scene, const LegendLayout& layout, Image& image) {
  const Viewport& bar = layout.bar;
  const int x0 = static_cast<int>(std::lround(bar.x));
  const int x1 = static_cast<int>(std::lround(bar.x + bar.width));
  const int y0 = static_cast<int>(std::lround(bar.y));
  const int y1 = static_cast<int>(std::lround(bar.y + bar.height));
  for (int y = std::max(0, y0); y < std::min(y1, image.height); ++y) {
    const Rgb color = map_color(scene.scale.map, (y1 - y - 0.5) / (y1 - y0));
    fill_box(image, x0, x1, y, y + 1, color);
  }
  const double line = std::max(1.0, layout.em / 20.0);
  const Vector2d corner[4] = {
      {1.0 * x0, 1.0 * y0}, {1.0 * x1, 1.0 * y0}, {1.0 * x1, 1.0 * y1}, {1.0 * x0, 1.0 * y1}};
  for (int k = 0; k < 4; ++k) {
    draw_stroke(image, corner[k], corner[(k + 1) % 4], line, kInk);
  }
  const TextStyle style = label_style(layout.em);
  for (std::size_t i = 0; i < layout.ticks.values.size(); ++i) {
    const double y = y1 - scene.scale.position(layout.ticks.values[i]) * (y1 - y0);
    draw_stroke(image, {1.0 * x1, y}, {x1 + 0.3 * layout.em, y}, line, kInk);
    draw_text(image, layout.ticks.labels[i], x1 + 0.6 * layout.em, y + 0.35 * style.size_px,
              TextAlign::left, style);
  }
  // Label over the bar, moved left as far as the edge of the picture asks for.
  const double right_edge = image.width - 0.8 * layout.em;
  std::string head = scene.legend.scale_label;
  if (!layout.ticks.factor.empty())
    head += (head.empty() ? "" : " ") + ("[" + layout.ticks.factor + "]");
  const TextExtent extent = measure_text(head, style);
  const double x = std::min(1.0 * x0, right_edge - (extent.right - extent.left));
  draw_fitting(image, head, std::max(0.8 * layout.em, x), y0 - 0.75 * layout.em, TextAlign::left,
               style, right_edge - 0.8 * layout.em);
}

void draw_scale_bar(const Scene& scene, const LegendLayout& layout, const Projection& projection,
                    Image& image) {
  const double per_unit = projection.pixels_per_unit();
  const double longest = 0.16 * image.width / per_unit;
  if (!std::isfinite(longest) || !(longest > 1e-290)) return;
  const double length = round_down_125(longest);
  const double x0 = 1.2 * layout.em;
  const double x1 = x0 + length * per_unit;
  const double y = layout.picture.y + layout.picture.height - 0.5 * layout.em;
  const double line = std::max(1.5, layout.em / 11.0);
  draw_stroke(image, {x0, y}, {x1, y}, line, kInk);
  for (const double x : {x0, x1}) {
    draw_stroke(image, {x, y - 0.28 * layout.em}, {x, y + 0.28 * layout.em}, line, kInk);
  }
  std::string text = format_number(length);
  if (!scene.legend.unit.empty()) text += " " + scene.legend.unit;
  draw_text(image, text, 0.5 * (x0 + x1), y - 0.55 * layout.em, TextAlign::center,
            label_style(layout.em));
}

}  // namespace

LegendLayout lay_out(const Scene& scene, int width, int height) {
  LegendLayout layout;
  layout.em = std::max(9.0, 0.026 * std::min(width, height));
  const double em = layout.em;
  const double margin = 0.025 * std::min(width, height);
  double top = margin;
  double bottom = height - margin;
  double right = width - margin;
  if (!scene.legend.title.empty()) top += 1.9 * em;
  if (!scene.legend.caption.empty()) bottom -= 1.6 * em;
  if (scene.legend.has_color_bar) {
    layout.ticks = make_ticks(std::min(scene.scale.range.low, scene.scale.range.high),
                              std::max(scene.scale.range.low, scene.scale.range.high), 5);
    double widest = 0.0;
    for (const std::string& label : layout.ticks.labels) {
      widest = std::max(widest, measure_text(label, label_style(em)).right);
    }
    layout.bar.width = 0.85 * em;
    const double taken = layout.bar.width + 0.6 * em + widest;
    layout.bar.x = width - 0.9 * em - taken;
    layout.bar.height = 0.56 * (bottom - top);
    layout.bar.y = 0.5 * (top + bottom) - 0.5 * layout.bar.height + 0.4 * em;
    right = layout.bar.x - 0.8 * em;
  }
  if (right - margin < 8.0) right = margin + 8.0;
  if (bottom - top < 8.0) bottom = top + 8.0;
  layout.picture = {margin, top, right - margin, bottom - top};
  return layout;
}

void draw_legend(const Scene& scene, const LegendLayout& layout, const Projection& projection,
                 Image& image) {
  const double em = layout.em;
  const double width = image.width - 2.0 * 1.2 * em;
  if (!scene.legend.title.empty()) {
    draw_fitting(image, scene.legend.title, 1.2 * em, 1.9 * em, TextAlign::left, title_style(em),
                 width);
  }
  if (!scene.legend.caption.empty()) {
    draw_fitting(image, scene.legend.caption, 1.2 * em, image.height - 0.9 * em, TextAlign::left,
                 caption_style(em), width);
  }
  if (scene.legend.has_color_bar) {
    draw_color_bar(scene, layout, image);
    if (!scene.legend.no_value_label.empty()) draw_no_value(scene, layout, image);
  }
  if (scene.legend.has_scale_bar) draw_scale_bar(scene, layout, projection, image);
}

}  // namespace dupin::detail
