#include "dupin/warp/shape_from_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/distance_field.h"
#include "dupin/warp/pixel_runs.h"

namespace dupin {
namespace {

using detail::BorderStep;
using detail::PixelBits;
using detail::PixelParts;
using detail::PixelRun;
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
      x = end_of_state(row, x, false);
      const std::int32_t begin = x;
      x = end_of_state(row, x, true);
      if (x > begin) runs.push_back({begin, x});
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
  // The first pixel from x on that is not inside, or that is, or the end of the row.
  std::int32_t end_of_state(const T* row, std::int32_t x, bool is_inside) const {
    const std::int32_t in_a_block = is_inside ? kBlock : 0;
    while (x + kBlock <= width_ && count_inside(row + 4 * x) == in_a_block) x += kBlock;
    while (x < width_ && (row[4 * x] >= least_) == is_inside) ++x;
    return x;
  }
  // Of kBlock pixels. Alpha is the top of a pixel read as one number, so that whole pixels can be
  // compared, several at once.
  std::int32_t count_inside(const T* alpha) const {
    std::int32_t count = 0;
    if constexpr (std::endian::native == std::endian::little) {
      using Pixel = std::conditional_t<sizeof(T) == 1, std::uint32_t, std::uint64_t>;
      const Pixel least = static_cast<Pixel>(Pixel{least_} << (24U * sizeof(T)));
      for (std::int32_t i = 0; i < kBlock; ++i) {
        Pixel pixel = 0;
        std::memcpy(&pixel, alpha - 3 + 4 * i, sizeof(Pixel));
        count += pixel >= least ? 1 : 0;
      }
    } else {
      for (std::int32_t i = 0; i < kBlock; ++i) count += alpha[4 * i] >= least_ ? 1 : 0;
    }
    return count;
  }

  static constexpr std::int32_t kBlock = 32;  // pixels that are looked at together
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
      if (x > begin) runs.push_back({begin, x});
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
void find_row(const Field& field, std::int32_t y, std::vector<PixelRun>& row) {
  row.clear();
  field.add_runs(y, row);
}

template <class Field>
PixelParts find_parts(const Field& field, const RunControl& run) {
  detail::PartJoiner joiner(field.height());
  std::vector<PixelRun> row;
  for (std::int32_t y = 0; y < field.height() && !run.cancelled(); ++y) {
    find_row(field, y, row);
    joiner.add_row(row);
  }
  if (run.cancelled()) return {};
  PixelParts parts = joiner.finish();
  std::size_t number = 0;
  for (std::int32_t y = 0; y < field.height() && !run.cancelled(); ++y) {
    find_row(field, y, row);
    for (const PixelRun& pixels : row) {
      const auto part = static_cast<std::size_t>(parts.of_run[number++]);
      parts.parts[part].num_pixels += pixels.end - pixels.begin;
    }
  }
  return parts;
}

/// Follows the borders of chosen parts.
template <class Field>
class Tracer {
 public:
  Tracer(const Field& field, const PixelParts& all, const ShapeOptions& options)
      : field_(field),
        all_(all),
        options_(options),
        is_visited_(field.width(), field.height()),
        is_contact_(0, 0) {}

  /// Adds the loops of `parts` (indices into all.parts) to `shape`, in that order.
  void trace(const std::vector<std::int32_t>& parts, ImageShape& shape, const RunControl& run);

 private:
  struct Loop {
    Points2 corners;
    double area = 0.0;
  };
  struct Hole {
    std::int32_t component;
    Loop loop;
  };
  /// Fills corners_ and returns the number of pixels inside the loop, negative for a hole.
  std::int64_t follow(std::int32_t x, std::int32_t y);
  void add_corner(const BorderStep& step, bool is_turn);
  void note_contact(const BorderStep& step, const BorderStep& next);
  Loop loop() const {
    Loop result;
    result.corners =
        Eigen::Map<const Points2>(corners_.data(), static_cast<Index>(corners_.size() / 2), 2);
    result.area = signed_area(result.corners);
    if (!options_.keep_outline) result.corners.resize(0, 2);
    return result;
  }
  void keep(Loop& loop, std::int32_t number, ImageShape& shape) const;
  void warn(std::int64_t num_closed, const std::string& first_closed, ImageShape& shape) const;

  const Field& field_;
  const PixelParts& all_;
  const ShapeOptions& options_;
  PixelBits is_visited_;         // the left end of each run
  std::vector<double> corners_;  // x, y of the loop being followed
  PixelBits is_contact_;         // the upper left corner of the pixel; empty until there is one
  std::int64_t num_contacts_ = 0;
  std::int64_t first_contact_ = std::numeric_limits<std::int64_t>::max();
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
  const std::int32_t corner_x = std::max(step.x, x);
  const std::int32_t corner_y = std::max(step.y, y);
  if (num_contacts_ == 0) is_contact_ = PixelBits(field_.width(), field_.height());
  if (!is_contact_.set(corner_x, corner_y)) return;
  ++num_contacts_;
  first_contact_ = std::min(first_contact_, std::int64_t{corner_y} * field_.width() + corner_x);
}

template <class Field>
std::int64_t Tracer<Field>::follow(std::int32_t x, std::int32_t y) {
  const BorderStep first{x, y, 0};
  const auto is_inside = [&](std::int32_t px, std::int32_t py) { return field_.is_inside(px, py); };
  corners_.clear();
  std::int64_t num_pixels = 0;
  BorderStep step = first;
  do {
    if (step.side == 0) {
      num_pixels -= step.x;
      is_visited_.set(step.x, step.y);
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
void Tracer<Field>::keep(Loop& loop, std::int32_t number, ImageShape& shape) const {
  shape.area += loop.area;
  if (!options_.keep_outline) return;
  shape.outline.loops.push_back(std::move(loop.corners));
  shape.outline.component.push_back(number);
}

template <class Field>
void Tracer<Field>::trace(const std::vector<std::int32_t>& parts, ImageShape& shape,
                          const RunControl& run) {
  std::vector<std::int32_t> component(all_.parts.size(), -1);
  std::vector<Loop> outer(parts.size());
  std::vector<Hole> holes;
  std::int64_t num_closed = 0;
  std::string first_closed;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    component[static_cast<std::size_t>(parts[i])] = static_cast<std::int32_t>(i);
    shape.part_areas.push_back(
        static_cast<double>(all_.parts[static_cast<std::size_t>(parts[i])].num_pixels));
  }
  std::vector<PixelRun> row;
  std::size_t run_number = 0;
  for (std::int32_t y = 0; y < field_.height() && !run.cancelled(); ++y) {
    find_row(field_, y, row);
    for (const PixelRun& pixels : row) {
      const std::int32_t number = component[static_cast<std::size_t>(all_.of_run[run_number++])];
      if (number < 0 || is_visited_.holds(pixels.begin, y)) continue;
      const std::int64_t enclosed = follow(pixels.begin, y);
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
    keep(outer[i], number, shape);
    for (; hole < holes.size() && holes[hole].component == number; ++hole)
      keep(holes[hole].loop, number, shape);
  }
  warn(num_closed, first_closed, shape);
}

template <class Field>
void Tracer<Field>::warn(std::int64_t num_closed, const std::string& first_closed,
                         ImageShape& shape) const {
  if (num_closed > 0 && options_.keep_holes) {
    shape.warnings.add("W_HOLE_CLOSED", "beside " + first_closed,
                       "holes below the minimum area were closed", num_closed);
  }
  if (num_contacts_ == 0) return;
  shape.warnings.add("W_NONMANIFOLD_VERTEX",
                     "corner (" + std::to_string(first_contact_ % field_.width()) + ", " +
                         std::to_string(first_contact_ / field_.width()) + ")",
                     "pixels that meet only at a corner were kept apart", num_contacts_);
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
std::vector<std::int32_t> choose_parts(const PixelParts& all, const ShapeOptions& options,
                                       ImageShape& shape) {
  std::vector<std::int32_t> chosen;
  std::int64_t largest = 0;
  std::int64_t num_specks = 0;
  for (std::size_t i = 0; i < all.parts.size(); ++i) {
    const std::int64_t size = all.parts[i].num_pixels;
    largest = std::max(largest, size);
    if (static_cast<double>(size) >= options.minimum_area) {
      chosen.push_back(static_cast<std::int32_t>(i));
    } else {
      ++num_specks;
      shape.left_out_area += static_cast<double>(size);
    }
  }
  if (all.parts.empty()) {
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
    return all.parts[static_cast<std::size_t>(a)].num_pixels >
           all.parts[static_cast<std::size_t>(b)].num_pixels;
  });
  if (chosen.size() > 1) {
    const bool keeps_one = options.parts == ShapeParts::largest;
    shape.warnings.add("W_COMPONENTS", "part 0",
                       keeps_one ? "separate parts; the largest is kept" : "separate parts",
                       shape.num_parts);
    for (std::size_t i = 1; keeps_one && i < chosen.size(); ++i) {
      shape.left_out_area +=
          static_cast<double>(all.parts[static_cast<std::size_t>(chosen[i])].num_pixels);
    }
    if (keeps_one) chosen.resize(1);
  }
  shape.num_left_out = static_cast<std::int64_t>(all.parts.size() - chosen.size());
  if (num_specks > 0) {
    shape.warnings.add("W_SPECK", "a part", "parts below the minimum area were left out",
                       num_specks);
  }
  const auto num_thin = std::count_if(chosen.begin(), chosen.end(), [&](std::int32_t part) {
    return all.parts[static_cast<std::size_t>(part)].is_thin;
  });
  if (num_thin > 0) {
    shape.warnings.add("W_THIN_SHAPE", "a part", "nowhere two pixels wide", num_thin);
  }
  return chosen;
}

std::vector<std::int32_t> by_falling_size(const PixelParts& all) {
  std::vector<std::int32_t> order(all.parts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::int32_t>(i);
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return all.parts[static_cast<std::size_t>(a)].num_pixels >
           all.parts[static_cast<std::size_t>(b)].num_pixels;
  });
  return order;
}

template <class Field>
void find_outline(const Field& field, const ShapeOptions& options, const RunControl& run,
                  ImageShape& shape) {
  const PixelParts all = find_parts(field, run);
  run.report(0.3);
  if (run.cancelled()) return;
  const std::vector<std::int32_t> parts = choose_parts(all, options, shape);
  if (options.expansion_px <= 0.0) {
    Tracer<Field>(field, all, options).trace(parts, shape, run);
    return;
  }
  std::vector<bool> is_kept(all.parts.size(), false);
  for (const std::int32_t part : parts) is_kept[static_cast<std::size_t>(part)] = true;
  std::vector<PixelRun> every;
  const auto kept_runs = [&](std::int32_t y, std::vector<PixelRun>& row) {
    find_row(field, y, every);
    row.clear();
    auto number = static_cast<std::size_t>(all.row_begin[static_cast<std::size_t>(y)]);
    for (const PixelRun& pixels : every) {
      const std::int32_t part = all.of_run[number++];
      if (is_kept[static_cast<std::size_t>(part)]) row.push_back(pixels);
    }
  };
  const detail::DistanceField distance =
      detail::distance_to_border(field.width(), field.height(), kept_runs, options.expansion_px);
  run.report(0.7);
  const ExpandedField expanded(distance);
  const PixelParts expanded_parts = find_parts(expanded, run);
  if (run.cancelled()) return;
  Tracer<ExpandedField>(expanded, expanded_parts, options)
      .trace(by_falling_size(expanded_parts), shape, run);
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
