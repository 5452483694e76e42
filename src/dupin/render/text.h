#pragma once

#include <string>

#include "dupin/image/image.h"
#include "dupin/render/color_map.h"

namespace dupin {

/// How text looks. The face is the library's own: even strokes with round ends, ASCII, the signs
/// − – × · ± ° ≤ ≥ ≈ → ∞ µ, the Greek letters α β δ ε θ κ λ μ π σ τ φ ω Δ Σ, raised and lowered
/// digits. Any other character is drawn as an empty box.
struct TextStyle {
  double size_px = 24.0;  ///< of the em; capitals are 0.70 of it [px]
  bool is_bold = false;
  Rgb color{0.13, 0.14, 0.16};
};

enum class TextAlign { left, center, right };

/// Ink of a text whose baseline starts at (0, 0), y down, and the way to the next text. [px]
struct TextExtent {
  double left = 0.0;
  double top = 0.0;
  double right = 0.0;
  double bottom = 0.0;
  double advance = 0.0;
};

/// Cost: O(strokes). `utf8` with invalid bytes: each is one unknown character.
TextExtent measure_text(const std::string& utf8, const TextStyle& style);

/// Draws `utf8` with its baseline at y and x at the side that `align` names; antialiased by the
/// distance to the strokes, clipped to the image.
void draw_text(Image& image, const std::string& utf8, double x, double y, TextAlign align,
               const TextStyle& style);

/// Draws a straight stroke with round ends. [px]
void draw_stroke(Image& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                 double width_px, const Rgb& color);

}  // namespace dupin
