#include "dupin/warp/distance_field.h"

#include <algorithm>
#include <cmath>

#include "dupin/base/parallel.h"

namespace dupin::detail {
namespace {

using Eigen::Index;

struct Box {
  int left = 0;
  int top = 0;
  int right = 0;  // one past the end
  int bottom = 0;
};

Box box_of(int width, int height, const ShapeRow& shape) {
  Box box{width, height, 0, 0};
  std::vector<PixelRun> runs;
  for (int y = 0; y < height; ++y) {
    shape(y, runs);
    if (runs.empty()) continue;
    box.left = std::min(box.left, static_cast<int>(runs.front().begin));
    box.right = std::max(box.right, static_cast<int>(runs.back().end));
    box.top = std::min(box.top, y);
    box.bottom = y + 1;
  }
  return box;
}

/// Squared distances along one row, from the distances `column` to the nearest inside pixel of each
/// column: the lower envelope of the parabolas (x - c)^2 + column[c]^2.
class RowEnvelope {
 public:
  explicit RowEnvelope(int width)
      : place_(static_cast<std::size_t>(width)), start_(static_cast<std::size_t>(width)) {}

  /// Calls take(x, squared distance) for each x, or nothing if no column is within `limit`.
  template <class Take>
  void run(const std::uint16_t* column, int width, int limit, const Take& take) {
    std::size_t size = 0;
    for (int c = 0; c < width; ++c) {
      if (column[c] > limit) continue;
      // The first x at which the new parabola is the lower one.
      int from = 0;
      while (size > 0) {
        from = first_below(place_[size - 1], c, column);
        if (from > start_[size - 1]) break;
        --size;
      }
      if (size == 0) from = 0;
      if (from >= width) continue;
      place_[size] = c;
      start_[size] = from;
      ++size;
    }
    for (std::size_t i = 0; i < size; ++i) {
      const int end = i + 1 < size ? start_[i + 1] : width;
      const std::int64_t height = column[place_[i]];
      for (int x = start_[i]; x < end; ++x) {
        const std::int64_t across = x - place_[i];
        take(x, across * across + height * height);
      }
    }
  }

 private:
  // Smallest x with (x - c)^2 + column[c]^2 < (x - b)^2 + column[b]^2, for b < c, at least 0.
  static int first_below(int b, int c, const std::uint16_t* column) {
    const std::int64_t f = std::int64_t{c} * c + std::int64_t{column[c]} * column[c];
    const std::int64_t g = std::int64_t{b} * b + std::int64_t{column[b]} * column[b];
    const std::int64_t twice = 2 * (std::int64_t{c} - b);
    if (f < g) return 0;
    return static_cast<int>(std::min<std::int64_t>((f - g) / twice + 1, 1 << 30));
  }

  std::vector<int> place_;
  std::vector<int> start_;
};

}  // namespace

DistanceField distance_to_border(int width_of_picture, int height_of_picture, const ShapeRow& shape,
                                 double expansion) {
  const Box box = box_of(width_of_picture, height_of_picture, shape);
  const int margin = static_cast<int>(std::ceil(expansion)) + 2;
  const int limit = margin;  // columns further away do not matter
  DistanceField field;
  field.origin_x = box.left - margin;
  field.origin_y = box.top - margin;
  field.width = box.right - box.left + 2 * margin;
  field.height = box.bottom - box.top + 2 * margin;
  const auto width = static_cast<std::size_t>(field.width);
  const auto far = static_cast<std::uint16_t>(limit + 1);
  std::vector<std::uint16_t> column(width * static_cast<std::size_t>(field.height), far);
  std::vector<PixelRun> runs;
  for (int y = box.top; y < box.bottom; ++y) {
    std::uint16_t* const row = column.data() + width * static_cast<std::size_t>(y - field.origin_y);
    shape(y, runs);
    for (const PixelRun& run : runs) {
      std::fill(row + (run.begin - field.origin_x), row + (run.end - field.origin_x),
                std::uint16_t{0});
    }
  }
  const auto take_nearer = [&](std::size_t y, std::size_t from) {
    std::uint16_t* const row = column.data() + width * y;
    const std::uint16_t* const other = column.data() + width * from;
    for (std::size_t x = 0; x < width; ++x) {
      row[x] = std::min(row[x], static_cast<std::uint16_t>(std::min<unsigned>(other[x] + 1U, far)));
    }
  };
  const auto height = static_cast<std::size_t>(field.height);
  for (std::size_t y = 1; y < height; ++y) take_nearer(y, y - 1);
  for (std::size_t y = height - 1; y-- > 0;) take_nearer(y, y + 1);
  const auto level = static_cast<float>(expansion + 0.5);
  field.value.assign(width * height, -2.0F);
  parallel_for(0, field.height, 16, [&](Index first, Index last) {
    RowEnvelope envelope(field.width);
    for (Index y = first; y < last; ++y) {
      float* const row = field.value.data() + width * static_cast<std::size_t>(y);
      envelope.run(column.data() + width * static_cast<std::size_t>(y), field.width, limit,
                   [&](int x, std::int64_t squared) {
                     row[x] = std::max(level - std::sqrt(static_cast<float>(squared)), -2.0F);
                   });
    }
  });
  return field;
}

}  // namespace dupin::detail
