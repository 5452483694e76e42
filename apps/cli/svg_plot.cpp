#include "svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/render/ticks.h"

namespace dupin::cli {
namespace {

// Okabe and Ito's palette without its yellow, which is lost on white.
constexpr std::array<const char*, 7> kPalette = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                                 "#E69F00", "#56B4E9", "#7F7F7F"};

struct Axis {
  double low = 0.0;
  double high = 1.0;
  bool is_log = false;
  double from = 0.0;  // [px]
  double to = 1.0;

  double place(double value) const {
    const double a = is_log ? std::log10(value) : value;
    const double l = is_log ? std::log10(low) : low;
    const double h = is_log ? std::log10(high) : high;
    return from + (to - from) * (h > l ? (a - l) / (h - l) : 0.5);
  }
};

void validate(const Plot& plot) {
  for (const PlotSeries& s : plot.series) {
    if (s.x.size() != s.y.size()) throw InvalidArgument("a curve has unlike numbers of x and y");
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!std::isfinite(s.x[i]) || !std::isfinite(s.y[i])) {
        throw InvalidArgument("point " + std::to_string(i) + " of a curve is not finite");
      }
      if (plot.has_log_x && s.x[i] <= 0.0) {
        throw InvalidArgument("a logarithmic axis needs x > 0");
      }
    }
    if (!s.band.empty() && s.band.size() != s.x.size()) {
      throw InvalidArgument("a curve and its band have unlike numbers of points");
    }
    for (const double half : s.band) {
      if (!std::isfinite(half) || half < 0.0) {
        throw InvalidArgument("a band is negative or not finite");
      }
    }
    for (const std::size_t mark : s.marks) {
      if (mark >= s.x.size()) throw InvalidArgument("a mark is outside its curve");
    }
  }
  for (const PlotGuide& guide : plot.guides) {
    if (!std::isfinite(guide.x) || (plot.has_log_x && guide.x <= 0.0)) {
      throw InvalidArgument("a guide is not on the axis");
    }
  }
}

void widen(double& low, double& high, double value, bool& is_first) {
  low = is_first ? value : std::min(low, value);
  high = is_first ? value : std::max(high, value);
  is_first = false;
}

Ticks log_ticks(double low, double high) {
  Ticks ticks;
  const double decades = std::log10(high) - std::log10(low);
  const int first = static_cast<int>(std::floor(std::log10(low)));
  const int last = static_cast<int>(std::ceil(std::log10(high)));
  const int stride = std::max(1, static_cast<int>(std::ceil(decades / 7.0)));
  for (int e = first; e <= last; e += stride) {
    for (const double lead : {1.0, 2.0, 5.0}) {
      if (lead > 1.0 && decades > 2.5) continue;
      const double value = lead * std::pow(10.0, e);
      if (value < low * (1 - 1e-9) || value > high * (1 + 1e-9)) continue;
      ticks.values.push_back(value);
      ticks.labels.push_back(format_number(value));
    }
  }
  return ticks;
}

std::string text(double x, double y, const std::string& anchor, const std::string& content,
                 const std::string& more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y,
                     anchor, more, html_escaped(content));
}

std::string axes(const Plot& plot, const Axis& x, const Axis& y) {
  const Ticks x_ticks = plot.has_log_x ? log_ticks(x.low, x.high) : make_ticks(x.low, x.high, 7);
  const Ticks y_ticks = make_ticks(y.low, y.high, 5);
  std::string out = "<g stroke=\"currentColor\" stroke-opacity=\"0.13\">\n";
  for (const double value : y_ticks.values) {
    out += fmt::format("<path d=\"M{:.1f} {:.1f}H{:.1f}\"/>\n", x.from, y.place(value), x.to);
  }
  out += "</g>\n<g stroke=\"currentColor\" stroke-opacity=\"0.6\" fill=\"none\">\n";
  out += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>\n", x.from, y.to, y.from, x.to);
  for (const double value : x_ticks.values) {
    out += fmt::format("<path d=\"M{:.1f} {:.1f}v5\"/>\n", x.place(value), y.from);
  }
  out += "</g>\n<g fill=\"currentColor\" font-size=\"12.5\">\n";
  for (std::size_t i = 0; i < x_ticks.values.size(); ++i) {
    out += text(x.place(x_ticks.values[i]), y.from + 20, "middle", x_ticks.labels[i]);
  }
  for (std::size_t i = 0; i < y_ticks.values.size(); ++i) {
    out += text(x.from - 8, y.place(y_ticks.values[i]) + 4.3, "end", y_ticks.labels[i]);
  }
  const auto with_factor = [](const std::string& label, const std::string& factor) {
    return factor.empty() ? label : label + " [" + factor + "]";
  };
  out +=
      text(0.5 * (x.from + x.to), y.from + 42, "middle", with_factor(plot.x_label, x_ticks.factor));
  const double middle = 0.5 * (y.from + y.to);
  out += text(16, middle, "middle", with_factor(plot.y_label, y_ticks.factor),
              fmt::format(" transform=\"rotate(-90 16 {:.1f})\"", middle));
  return out + "</g>\n";
}

const char* color_of(const Plot& plot, std::size_t s) {
  const int named = plot.series[s].color;
  return kPalette[(named < 0 ? s : static_cast<std::size_t>(named)) % kPalette.size()];
}

// Under the curves, so that none is dimmed by another's band.
std::string bands(const Plot& plot, const Axis& x, const Axis& y) {
  std::string out;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const PlotSeries& series = plot.series[s];
    if (series.band.empty()) continue;
    std::string points;
    const std::size_t count = series.x.size();
    for (std::size_t i = 0; i < 2 * count; ++i) {
      const std::size_t at = i < count ? i : 2 * count - 1 - i;
      const double half = i < count ? series.band[at] : -series.band[at];
      points += fmt::format("{}{:.2f} {:.2f}", i == 0 ? "M" : "L", x.place(series.x[at]),
                            y.place(series.y[at] + half));
    }
    out += fmt::format("<path d=\"{}Z\" fill=\"{}\" fill-opacity=\"0.18\"/>\n", points,
                       color_of(plot, s));
  }
  return out;
}

// Down to zero, or to the end of the axis that is nearest to it.
std::string fills(const Plot& plot, const Axis& x, const Axis& y) {
  std::string out;
  const double floor = y.place(std::clamp(0.0, y.low, y.high));
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const PlotSeries& series = plot.series[s];
    if (!series.is_filled || series.x.empty()) continue;
    std::string points = fmt::format("M{:.2f} {:.2f}", x.place(series.x.front()), floor);
    for (std::size_t i = 0; i < series.x.size(); ++i)
      points += fmt::format("L{:.2f} {:.2f}", x.place(series.x[i]), y.place(series.y[i]));
    out += fmt::format("<path d=\"{}V{:.2f}Z\" fill=\"{}\" fill-opacity=\"0.3\"/>\n", points, floor,
                       color_of(plot, s));
  }
  return out;
}

std::string curves(const Plot& plot, const Axis& x, const Axis& y) {
  std::string out;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const PlotSeries& series = plot.series[s];
    const char* color = color_of(plot, s);
    std::string points;
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      points += fmt::format("{}{:.2f} {:.2f}", i == 0 ? "M" : "L", x.place(series.x[i]),
                            y.place(series.y[i]));
    }
    if (!points.empty()) {
      out += fmt::format(
          "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" "
          "stroke-linejoin=\"round\"{}/>\n",
          points, color, series.is_dashed ? " stroke-dasharray=\"6 4\"" : "");
    }
    for (const std::size_t mark : series.marks) {
      out += fmt::format("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"9\" height=\"9\" fill=\"{}\"/>\n",
                         x.place(series.x[mark]) - 4.5, y.place(series.y[mark]) - 4.5, color);
    }
  }
  return out;
}

std::string legend(const Plot& plot, double x, double y) {
  std::string out = "<g fill=\"currentColor\" font-size=\"12.5\">\n";
  int row = 0;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    if (plot.series[s].label.empty()) continue;
    const double at = y + 19.0 * row++;
    out += fmt::format(
        "<path d=\"M{:.1f} {:.1f}h20\" stroke=\"{}\" stroke-width=\"2.5\" fill=\"none\"{}/>\n", x,
        at, color_of(plot, s), plot.series[s].is_dashed ? " stroke-dasharray=\"6 4\"" : "");
    out += text(x + 27, at + 4.3, "start", plot.series[s].label);
  }
  return out + "</g>\n";
}

}  // namespace

std::string html_escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n') out += c;
    }
  }
  return out;
}

std::string format_svg(const Plot& plot) {
  validate(plot);
  Axis x;
  Axis y;
  x.is_log = plot.has_log_x;
  bool is_first_x = true;
  bool is_first_y = true;
  std::size_t longest = 0;
  for (const PlotSeries& s : plot.series) {
    for (const double value : s.x) widen(x.low, x.high, value, is_first_x);
    for (std::size_t i = 0; i < s.y.size(); ++i) {
      const double half = s.band.empty() ? 0.0 : s.band[i];
      widen(y.low, y.high, s.y[i] - half, is_first_y);
      widen(y.low, y.high, s.y[i] + half, is_first_y);
    }
    longest = std::max(longest, s.label.size());
  }
  for (const PlotGuide& guide : plot.guides) widen(x.low, x.high, guide.x, is_first_x);
  if (is_first_x && plot.has_log_x) x = {1.0, 10.0, true};
  const double pad = 0.05 * (y.high - y.low);
  y.low -= pad;
  y.high += pad;
  if (!(y.high > y.low)) {
    // One value: the axis needs some width around it.
    const double half = y.low == 0.0 ? 1.0 : 0.5 * std::abs(y.low);
    y.low -= half;
    y.high += half;
  }
  const double top = plot.title.empty() ? 24.0 : 46.0;
  const double legend_width = longest == 0 ? 16.0 : 46.0 + 7.2 * static_cast<double>(longest);
  x.from = 74.0;
  x.to = std::max(x.from + 60.0, plot.width - legend_width);
  y.from = plot.height - 56.0;
  y.to = top;

  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" role=\"img\" aria-label=\"{2}\" font-family=\"system-ui, sans-serif\">\n",
      plot.width, plot.height, html_escaped(plot.title.empty() ? plot.y_label : plot.title));
  if (!plot.title.empty()) {
    out += text(x.from, 24, "start", plot.title,
                " fill=\"currentColor\" font-size=\"15\" font-weight=\"600\"");
  }
  out += axes(plot, x, y);
  if (plot.has_zero_line && y.low < 0.0 && y.high > 0.0) {
    out += fmt::format(
        "<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"currentColor\" stroke-opacity=\"0.5\"/>\n",
        x.from, y.place(0.0), x.to);
  }
  for (const PlotGuide& guide : plot.guides) {
    out += fmt::format(
        "<path d=\"M{:.1f} {:.1f}V{:.1f}\" stroke=\"currentColor\" stroke-opacity=\"0.45\" "
        "stroke-dasharray=\"3 4\"/>\n",
        x.place(guide.x), y.from, y.to);
    out += text(x.place(guide.x), y.to - 6, "middle", guide.label,
                " fill=\"currentColor\" font-size=\"11.5\"");
  }
  out += bands(plot, x, y);
  out += fills(plot, x, y);
  out += curves(plot, x, y);
  out += legend(plot, x.to + 14, y.to + 10);
  return out + "</svg>\n";
}

}  // namespace dupin::cli
