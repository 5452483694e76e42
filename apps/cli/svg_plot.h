#pragma once

#include <string>
#include <vector>

namespace dupin::cli {

/// One curve of a plot. Colours come from a palette that colour-blind people can tell apart.
struct PlotSeries {
  std::string label;               ///< in the legend; empty: not listed
  std::vector<double> x;           ///< finite; > 0 on a logarithmic axis
  std::vector<double> y;           ///< finite, as many as x
  std::vector<std::size_t> marks;  ///< points drawn as filled squares
  bool is_dashed = false;
  std::vector<double> band;  ///< half width of a band about the curve, >= 0, as many as x; or empty
  int color = -1;            ///< of the palette; -1: the next one
  bool is_filled = false;    ///< down to y = 0: for bars
};

/// A vertical line with a word at its top.
struct PlotGuide {
  double x = 0.0;
  std::string label;
};

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  bool has_log_x = false;
  bool has_zero_line = true;  ///< y = 0 is drawn when it is in range
  int width = 720;            ///< [px]
  int height = 400;           ///< [px]
  std::vector<PlotSeries> series;
  std::vector<PlotGuide> guides;
};

/// `plot` as one <svg> element, without any reference to the outside; text and axes take the
/// colour of the page around it. All text is escaped.
/// @throws InvalidArgument if a number is not finite, x and y differ in length, a band has another
///   length or is negative, a mark is out of range, or x <= 0 on a logarithmic axis
std::string format_svg(const Plot& plot);

/// `text` with & < > " ' as entities and control characters removed: fit for HTML and SVG.
std::string html_escaped(const std::string& text);

}  // namespace dupin::cli
