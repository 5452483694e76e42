#include "dupin/warp/shape_from_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/distance_field.h"
#include "dupin/warp/pixel_runs.h"

namespace dupin {
namespace {

using detail::BorderStep;
using detail::PixelPart;
using detail::PixelRun;
using detail::PixelRuns;
using Eigen::Index;

// Corners stay this far from the pixel centres, so that loops never meet there [px].
constexpr double kClearance = 1.0 / 64.0;
constexpr double kGrid = 65536.0;  // coordinates are multiples of 1 / kGrid
constexpr double kMaxExpansion = 256.0;

/// Alpha as a function of the pixel; nothing is inside beyond the picture.
template <class T>
class AlphaField {
 public:
  AlphaField(const std::vector<T>& rgba, int width, int height, double threshold)
      : alpha_(rgba.data() + 3), width_(width), height_(height), threshold_(threshold) {
    // The smallest alpha that is inside. Dividing makes 8 and 16 bits agree to the last bit.
    std::int64_t least = static_cast<std::int64_t>(threshold * kMax);
    while (least > 0 && static_cast<double>(least - 1) / kMax > threshold) --least;
    while (static_cast<double>(least) / kMax <= threshold) ++least;
    least_ = static_cast<T>(least);
  }
  int width() const { return width_; }
  int height() const { return height_; }
  bool holds(std::int32_t x, std::int32_t y) const {
    return x >= 0 && x < width_ && y >= 0 && y < height_;
  }
  bool is_inside(std::int32_t x, std::int32_t y) const { return holds(x, y) && at(x, y) >= least_; }
  /// > 0 inside.
  double level(std::int32_t x, std::int32_t y) const {
    return (holds(x, y) ? static_cast<double>(at(x, y)) / kMax : 0.0) - threshold_;
  }
  double origin_x() const { return 0.0; }
  double origin_y() const { return 0.0; }
  void add_runs(std::int32_t y, std::vector<PixelRun>& runs) const {
    const T* const row =
        alpha_ + 4 * static_cast<std::size_t>(width_) * static_cast<std::size_t>(y);
    std::int32_t x = 0;
    while (x < width_) {
      while (x < width_ && row[4 * x] < least_) ++x;
      const std::int32_t begin = x;
      while (x < width_ && row[4 * x] >= least_) ++x;
      if (x > begin) runs.push_back({begin, x, 0});
    }
  }
  bool is_opaque() const {
    const auto count = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    for (std::size_t i = 0; i < count; ++i) {
      if (alpha_[4 * i] != std::numeric_limits<T>::max()) return false;
    }
    return true;
  }

 private:
  static constexpr double kMax = std::numeric_limits<T>::max();
  T at(std::int32_t x, std::int32_t y) const {
    return alpha_[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                       static_cast<std::size_t>(x))];
  }
  const T* alpha_;
  int width_;
  int height_;
  double threshold_;
  T least_ = 0;
};

/// The distance that is left to the expanded outline.
class ExpandedField {
 public:
  explicit ExpandedField(const detail::DistanceField& field) : field_(field) {}
  int width() const { return field_.width; }
  int height() const { return field_.height; }
  bool is_inside(std::int32_t x, std::int32_t y) const {
    return x >= 0 && x < field_.width && y >= 0 && y < field_.height && at(x, y) > 0.0F;
  }
  double level(std::int32_t x, std::int32_t y) const { return static_cast<double>(at(x, y)); }
  double origin_x() const { return field_.origin_x; }
  double origin_y() const { return field_.origin_y; }
  void add_runs(std::int32_t y, std::vector<PixelRun>& runs) const {
    std::int32_t x = 0;
    while (x < field_.width) {
      while (x < field_.width && !(at(x, y) > 0.0F)) ++x;
      const std::int32_t begin = x;
      while (x < field_.width && at(x, y) > 0.0F) ++x;
      if (x > begin) runs.push_back({begin, x, 0});
    }
  }

 private:
  float at(std::int32_t x, std::int32_t y) const {
    return field_.value[static_cast<std::size_t>(y) * static_cast<std::size_t>(field_.width) +
                        static_cast<std::size_t>(x)];
  }
  const detail::DistanceField& field_;
};

template <class Field>
PixelRuns find_runs(const Field& field, const RunControl& run) {
  PixelRuns runs;
  runs.width = field.width();
  runs.height = field.height();
  runs.row_begin.reserve(static_cast<std::size_t>(runs.height) + 1);
  runs.row_begin.push_back(0);
  for (std::int32_t y = 0; y < runs.height && !run.cancelled(); ++y) {
    field.add_runs(y, runs.runs);
    runs.row_begin.push_back(static_cast<std::int32_t>(runs.runs.size()));
  }
  if (!run.cancelled()) detail::join_runs(runs);
  return runs;
}

/// Follows the borders of chosen parts.
template <class Field>
class Tracer {
 public:
  Tracer(const Field& field, const PixelRuns& runs, const ShapeOptions& options)
      : field_(field), runs_(runs), options_(options), is_visited_(runs.runs.size(), false) {}

  /// Adds the loops of `parts` (indices into runs.parts) to `shape`, in that order.
  void trace(const std::vector<std::int32_t>& parts, ImageShape& shape, const RunControl& run);

 private:
  struct Hole {
    std::int32_t component;
    Points2 loop;
  };
  /// Fills corners_ and returns the number of pixels inside the loop, negative for a hole.
  std::int64_t follow(std::int32_t run_index, std::int32_t y);
  void add_corner(const BorderStep& step, bool is_turn);
  void note_contact(const BorderStep& step, const BorderStep& next);
  Points2 loop() const {
    return Eigen::Map<const Points2>(corners_.data(), static_cast<Index>(corners_.size() / 2), 2);
  }

  const Field& field_;
  const PixelRuns& runs_;
  const ShapeOptions& options_;
  std::vector<bool> is_visited_;  // the left end of each run
  std::vector<double> corners_;   // x, y of the loop being followed
  std::vector<std::int64_t> contacts_;
};

template <class Field>
void Tracer<Field>::add_corner(const BorderStep& step, bool is_turn) {
  if (options_.contour == ContourKind::pixel_edges) {
    if (!is_turn) return;
    corners_.push_back(field_.origin_x() + step.x + (step.side >= 2 ? 1 : 0));
    corners_.push_back(field_.origin_y() + step.y + (step.side == 0 || step.side == 3 ? 1 : 0));
    return;
  }
  const int outward_x = detail::kOutwardX[step.side];
  const int outward_y = detail::kOutwardY[step.side];
  const double inside = field_.level(step.x, step.y);
  const double outside = field_.level(step.x + outward_x, step.y + outward_y);
  // inside > 0 >= outside
  const double crossing = std::clamp(inside / (inside - outside), kClearance, 1.0 - kClearance);
  const double rounded = std::round(crossing * kGrid) / kGrid;
  corners_.push_back(field_.origin_x() + step.x + 0.5 + rounded * outward_x);
  corners_.push_back(field_.origin_y() + step.y + 0.5 + rounded * outward_y);
}

template <class Field>
void Tracer<Field>::note_contact(const BorderStep& step, const BorderStep& next) {
  if (next.side != (step.side + 1) % 4) return;
  const std::int32_t x = step.x + detail::kOutwardX[step.side] + detail::kOutwardX[next.side];
  const std::int32_t y = step.y + detail::kOutwardY[step.side] + detail::kOutwardY[next.side];
  if (!field_.is_inside(x, y)) return;
  contacts_.push_back(std::int64_t{std::max(step.y, y)} * runs_.width + std::max(step.x, x));
}

template <class Field>
std::int64_t Tracer<Field>::follow(std::int32_t run_index, std::int32_t y) {
  const BorderStep first{runs_.runs[static_cast<std::size_t>(run_index)].begin, y, 0};
  const auto is_inside = [&](std::int32_t px, std::int32_t py) { return field_.is_inside(px, py); };
  corners_.clear();
  std::int64_t num_pixels = 0;
  BorderStep step = first;
  do {
    if (step.side == 0) {
      num_pixels -= step.x;
      is_visited_[static_cast<std::size_t>(detail::run_at(runs_, step.x, step.y))] = true;
    } else if (step.side == 2) {
      num_pixels += step.x + 1;
    }
    const BorderStep next = detail::next_step(step, is_inside);
    note_contact(step, next);
    add_corner(next, next.side != step.side);
    step = next;
  } while (step.x != first.x || step.y != first.y || step.side != first.side);
  return num_pixels;
}

template <class Field>
void Tracer<Field>::trace(const std::vector<std::int32_t>& parts, ImageShape& shape,
                          const RunControl& run) {
  std::vector<std::int32_t> component(runs_.parts.size(), -1);
  std::vector<Points2> outer(parts.size());
  std::vector<Hole> holes;
  std::int64_t num_closed = 0;
  std::string first_closed;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    component[static_cast<std::size_t>(parts[i])] = static_cast<std::int32_t>(i);
    shape.part_areas.push_back(
        static_cast<double>(runs_.parts[static_cast<std::size_t>(parts[i])].num_pixels));
  }
  for (std::int32_t y = 0; y < runs_.height && !run.cancelled(); ++y) {
    const std::int32_t end = runs_.row_begin[static_cast<std::size_t>(y) + 1];
    for (std::int32_t r = runs_.row_begin[static_cast<std::size_t>(y)]; r < end; ++r) {
      const PixelRun& pixels = runs_.runs[static_cast<std::size_t>(r)];
      const std::int32_t number = component[static_cast<std::size_t>(pixels.part)];
      if (number < 0 || is_visited_[static_cast<std::size_t>(r)]) continue;
      const std::int64_t enclosed = follow(r, y);
      if (enclosed > 0) {
        outer[static_cast<std::size_t>(number)] = loop();
      } else if (options_.keep_holes &&
                 static_cast<double>(-enclosed) >= options_.minimum_hole_area) {
        holes.push_back({number, loop()});
      } else {
        if (num_closed++ == 0) {
          first_closed = "pixel (" + std::to_string(pixels.begin) + ", " + std::to_string(y) + ")";
        }
        shape.part_areas[static_cast<std::size_t>(number)] += static_cast<double>(-enclosed);
      }
    }
  }
  if (run.cancelled()) return;
  std::stable_sort(holes.begin(), holes.end(),
                   [](const Hole& a, const Hole& b) { return a.component < b.component; });
  shape.num_holes = static_cast<std::int64_t>(holes.size());
  std::size_t hole = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto number = static_cast<std::int32_t>(i);
    shape.outline.loops.push_back(std::move(outer[i]));
    shape.outline.component.push_back(number);
    for (; hole < holes.size() && holes[hole].component == number; ++hole) {
      shape.outline.loops.push_back(std::move(holes[hole].loop));
      shape.outline.component.push_back(number);
    }
  }
  if (num_closed > 0 && options_.keep_holes) {
    shape.warnings.add("W_HOLE_CLOSED", "beside " + first_closed,
                       "holes below the minimum area were closed", num_closed);
  }
  std::sort(contacts_.begin(), contacts_.end());
  contacts_.erase(std::unique(contacts_.begin(), contacts_.end()), contacts_.end());
  if (!contacts_.empty()) {
    shape.warnings.add("W_NONMANIFOLD_VERTEX",
                       "corner (" + std::to_string(contacts_[0] % runs_.width) + ", " +
                           std::to_string(contacts_[0] / runs_.width) + ")",
                       "pixels that meet only at a corner were kept apart",
                       static_cast<std::int64_t>(contacts_.size()));
  }
}

std::string in_range(const char* what, double value, const char* range) {
  return std::string("shape.") + what + " is " + std::to_string(value) + ", legal range " + range;
}

void validate(const ShapeOptions& options) {
  if (!(options.alpha_threshold >= 0.0 && options.alpha_threshold < 1.0))
    throw InvalidArgument(in_range("alpha_threshold", options.alpha_threshold, "0 to below 1"));
  if (!(options.expansion_px >= 0.0 && options.expansion_px <= kMaxExpansion))
    throw InvalidArgument(in_range("expansion_px", options.expansion_px, "0 to 256"));
  if (!(options.minimum_area >= 1.0))
    throw InvalidArgument(in_range("minimum_area", options.minimum_area, "1 and more"));
  if (!(options.minimum_hole_area >= 1.0))
    throw InvalidArgument(in_range("minimum_hole_area", options.minimum_hole_area, "1 and more"));
}

/// Parts of the minimum area by falling size; only the first if so wanted. Says what it leaves out.
std::vector<std::int32_t> choose_parts(const PixelRuns& runs, const ShapeOptions& options,
                                       ImageShape& shape) {
  std::vector<std::int32_t> chosen;
  std::int64_t largest = 0;
  std::int64_t num_specks = 0;
  for (std::size_t i = 0; i < runs.parts.size(); ++i) {
    const std::int64_t size = runs.parts[i].num_pixels;
    largest = std::max(largest, size);
    if (static_cast<double>(size) >= options.minimum_area) {
      chosen.push_back(static_cast<std::int32_t>(i));
    } else {
      ++num_specks;
      shape.left_out_area += static_cast<double>(size);
    }
  }
  if (runs.parts.empty()) {
    throw AnalysisError("E_EMPTY_SHAPE",
                        "no pixel has alpha above " + std::to_string(options.alpha_threshold));
  }
  if (chosen.empty()) {
    throw AnalysisError("E_SHAPE_TOO_SMALL",
                        "the largest part has " + std::to_string(largest) + " px, at least " +
                            std::to_string(static_cast<std::int64_t>(
                                std::ceil(std::min(options.minimum_area, 1e18)))) +
                            " are needed");
  }
  shape.num_parts = static_cast<std::int64_t>(chosen.size());
  std::stable_sort(chosen.begin(), chosen.end(), [&](std::int32_t a, std::int32_t b) {
    return runs.parts[static_cast<std::size_t>(a)].num_pixels >
           runs.parts[static_cast<std::size_t>(b)].num_pixels;
  });
  if (chosen.size() > 1) {
    const bool keeps_one = options.parts == ShapeParts::largest;
    shape.warnings.add("W_COMPONENTS", "part 0",
                       keeps_one ? "separate parts; the largest is kept" : "separate parts",
                       shape.num_parts);
    for (std::size_t i = 1; keeps_one && i < chosen.size(); ++i) {
      shape.left_out_area +=
          static_cast<double>(runs.parts[static_cast<std::size_t>(chosen[i])].num_pixels);
    }
    if (keeps_one) chosen.resize(1);
  }
  shape.num_left_out = static_cast<std::int64_t>(runs.parts.size() - chosen.size());
  if (num_specks > 0) {
    shape.warnings.add("W_SPECK", "a part", "parts below the minimum area were left out",
                       num_specks);
  }
  const auto num_thin = std::count_if(chosen.begin(), chosen.end(), [&](std::int32_t part) {
    return runs.parts[static_cast<std::size_t>(part)].is_thin;
  });
  if (num_thin > 0) {
    shape.warnings.add("W_THIN_SHAPE", "a part", "nowhere two pixels wide", num_thin);
  }
  return chosen;
}

std::vector<std::int32_t> by_falling_size(const PixelRuns& runs) {
  std::vector<std::int32_t> order(runs.parts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::int32_t>(i);
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return runs.parts[static_cast<std::size_t>(a)].num_pixels >
           runs.parts[static_cast<std::size_t>(b)].num_pixels;
  });
  return order;
}

template <class Field>
void find_outline(const Field& field, const ShapeOptions& options, const RunControl& run,
                  ImageShape& shape) {
  const PixelRuns runs = find_runs(field, run);
  run.report(0.3);
  if (run.cancelled()) return;
  const std::vector<std::int32_t> parts = choose_parts(runs, options, shape);
  if (options.expansion_px <= 0.0) {
    Tracer<Field>(field, runs, options).trace(parts, shape, run);
    return;
  }
  const detail::DistanceField distance =
      detail::distance_to_border(runs, parts, options.expansion_px);
  run.report(0.7);
  const ExpandedField expanded(distance);
  const PixelRuns expanded_runs = find_runs(expanded, run);
  if (run.cancelled()) return;
  Tracer<ExpandedField>(expanded, expanded_runs, options)
      .trace(by_falling_size(expanded_runs), shape, run);
}

template <class T>
void find_shape(const std::vector<T>& rgba, const Raster& image, const ShapeOptions& options,
                const RunControl& run, ImageShape& shape) {
  const AlphaField<T> field(rgba, image.width, image.height, options.alpha_threshold);
  if (!options.opaque_is_shape && field.is_opaque()) {
    throw AnalysisError("E_NO_ALPHA", "every pixel is opaque, so there is no shape",
                        "cut the garment out first: its background must be transparent");
  }
  find_outline(field, options, run, shape);
}

}  // namespace

ImageShape shape_from_image(const Raster& image, const ShapeOptions& options, RunControl run) {
  validate(image);
  validate(options);
  ImageShape shape;
  if (image.bit_depth == 8) {
    find_shape(image.rgba8, image, options, run, shape);
  } else {
    find_shape(image.rgba16, image, options, run, shape);
  }
  if (run.cancelled()) {
    ImageShape nothing;
    nothing.status = Status::cancelled;
    return nothing;
  }
  run.report(1.0);
  return shape;
}

}  // namespace dupin
