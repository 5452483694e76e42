#pragma once

#include <Eigen/Core>
#include <vector>

namespace dupin::detail {

/// A glyph as strokes in font units: capitals are 100 high, small letters 72, y up, baseline 0.
struct Glyph {
  using Stroke = std::vector<Eigen::Vector2d>;  ///< a polyline; one point: a dot
  std::vector<Stroke> strokes;
  double advance = 0.0;
  double weight = 1.0;  ///< of the strokes
};

/// The glyph of a Unicode character; a box when the face does not have it.
const Glyph& glyph_of(char32_t character);

}  // namespace dupin::detail
