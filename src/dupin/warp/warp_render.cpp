#include "dupin/warp/warp_render.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/warp/pixel_filter.h"
#include "dupin/warp/triangle_raster.h"

namespace dupin {
namespace {

using detail::Colour;
using detail::FilterShape;
using detail::PixelReader;
using detail::PixelSpan;
using detail::RasterTriangle;
using detail::SourceRow;
using detail::TriangleBands;
using Eigen::Index;

/// Calls paint(triangle number, row, span) for all covered pixels of a band, back to front.
template <class Paint>
void for_each_span(const TriangleBands& bands, Index band, int width, int height,
                   const Paint& paint) {
  const auto top = static_cast<std::int32_t>(band) * detail::kBandRows;
  const std::int32_t bottom = std::min(top + detail::kBandRows, height) - 1;
  const auto b = static_cast<std::size_t>(band);
  for (std::int32_t m = bands.begin[b]; m < bands.begin[b + 1]; ++m) {
    const std::int32_t number = bands.member[static_cast<std::size_t>(m)];
    const RasterTriangle& triangle = bands.triangles[static_cast<std::size_t>(number)];
    const std::int32_t last = std::min(bottom, triangle.last_row);
    for (std::int32_t y = std::max(top, triangle.first_row); y <= last; ++y) {
      const PixelSpan span = detail::span_of(triangle, y, width);
      if (span.begin < span.end) paint(number, y, span);
    }
  }
}

/// `front` over `back`, both straight. Opaque or alone, the front passes unchanged.
template <class T>
DUPIN_INLINE void lay_over(Colour& back, Colour front) {
  constexpr float kMax = PixelReader<T>::kMax;
  if (back[3] <= 0.0F || front[3] >= kMax) {
    back = front;
    return;
  }
  if (front[3] <= 0.0F) return;
  const float shown = back[3] * (1.0F - front[3] / kMax);
  const float alpha = front[3] + shown;
  Colour mixed = (front * front[3] + back * shown) * (1.0F / alpha);
  mixed[3] = alpha;
  back = mixed;
}

template <class T>
DUPIN_INLINE void store(Colour colour, T* to) {
  constexpr float kMax = PixelReader<T>::kMax;
  for (int k = 0; k < 4; ++k) {
    to[k] = static_cast<T>(std::min(std::max(colour[k], 0.0F), kMax) + 0.5F);
  }
}

/// Paints pixels [span.begin, span.end) of row y over what `line`, the row of the canvas, holds.
template <class T>
void paint_span(const PixelReader<T>& reader, const RasterTriangle& triangle,
                const FilterShape& shape, std::int32_t y, PixelSpan span, Colour* line) {
  const SourceRow row(triangle, y);
  for (std::int32_t x = span.begin; x < span.end; ++x) {
    const auto [u, v] = row.at(x);
    lay_over<T>(line[x], reader.read(u, v, shape));
  }
}

#ifdef DUPIN_X86
template <class T>
DUPIN_AVX2 void paint_span_avx2(const PixelReader<T>& reader, const RasterTriangle& triangle,
                                const FilterShape& shape, std::int32_t y, PixelSpan span,
                                Colour* line) {
  const SourceRow row(triangle, y);
  for (std::int32_t x = span.begin; x < span.end; ++x) {
    const auto [u, v] = row.at(x);
    lay_over<T>(line[x], reader.read_avx2(u, v, shape));
  }
}
#endif

template <class T>
class Painter {
 public:
  Painter(const Raster& source, const std::vector<T>& pixels, const TriangleBands& bands,
          Raster& output, std::vector<T>& out)
      : reader_(pixels, source.width, source.height),
        bands_(bands),
        width_(output.width),
        height_(output.height),
        out_(out) {
#ifdef DUPIN_X86
    if (instruction_set() != InstructionSet::base) paint_ = paint_span_avx2<T>;
#endif
    shapes_.reserve(bands.triangles.size());
    for (const RasterTriangle& triangle : bands.triangles) {
      shapes_.push_back(detail::filter_shape(triangle));
    }
  }

  /// Paints over what is in the output already.
  void paint(Index band, std::vector<Colour>& canvas) const {
    const auto top = static_cast<std::size_t>(band) * detail::kBandRows;
    const auto width = static_cast<std::size_t>(width_);
    const std::size_t rows =
        std::min<std::size_t>(detail::kBandRows, static_cast<std::size_t>(height_) - top);
    T* const out = out_.data() + 4 * top * width;
    for (std::size_t i = 0; i < rows * width; ++i) canvas[i] = PixelReader<T>::load(out + 4 * i);
    for_each_span(
        bands_, band, width_, height_, [&](std::int32_t number, std::int32_t y, PixelSpan span) {
          const RasterTriangle& triangle = bands_.triangles[static_cast<std::size_t>(number)];
          const FilterShape& shape = shapes_[static_cast<std::size_t>(number)];
          Colour* const line = canvas.data() + (static_cast<std::size_t>(y) - top) * width;
          paint_(reader_, triangle, shape, y, span, line);
        });
    for (std::size_t i = 0; i < rows * width; ++i) store<T>(canvas[i], out + 4 * i);
  }

  void paint_all(const RunControl& run) const {
    const Index num_bands = bands_.num_bands();
    parallel_for(0, num_bands, 1, [&](Index first, Index last) {
      std::vector<Colour> canvas(static_cast<std::size_t>(width_) * detail::kBandRows);
      for (Index band = first; band < last && !run.cancelled(); ++band) {
        paint(band, canvas);
        run.report(static_cast<double>(band) / static_cast<double>(num_bands));
      }
    });
  }

 private:
  PixelReader<T> reader_;
  const TriangleBands& bands_;
  int width_;
  int height_;
  std::vector<T>& out_;
  std::vector<FilterShape> shapes_;
  void (*paint_)(const PixelReader<T>&, const RasterTriangle&, const FilterShape&, std::int32_t,
                 PixelSpan, Colour*) = paint_span<T>;
};

Raster canvas_of(const Raster& source, const Raster* background, int width, int height) {
  if (background == nullptr) {
    Raster canvas = make_raster(width, height, source.bit_depth);
    canvas.colour = source.colour;
    return canvas;
  }
  if (background->width != width || background->height != height) {
    throw InvalidArgument("background: " + std::to_string(background->width) + " x " +
                          std::to_string(background->height) + " pixels, the output has " +
                          std::to_string(width) + " x " + std::to_string(height));
  }
  Raster canvas = with_bit_depth(*background, source.bit_depth);
  canvas.colour = source.colour;
  return canvas;
}

}  // namespace

WarpPicture render_warp(const Raster& source, const PlanarMesh& mesh, const Points2& target,
                        const std::vector<std::int32_t>& draw_order, const WarpView& view,
                        const Raster* background, RunControl run) {
  validate(source);
  if (background != nullptr) validate(*background);
  const Raster& size = background != nullptr ? *background : source;
  const int width = view.width == 0 ? size.width : view.width;
  const int height = view.height == 0 ? size.height : view.height;
  const TriangleBands bands = detail::make_bands(mesh, target, draw_order, view, width, height);
  WarpPicture picture;
  picture.num_flipped = bands.num_flipped;
  picture.num_degenerate = bands.num_degenerate;
  picture.raster = canvas_of(source, background, width, height);
  if (source.bit_depth == 8) {
    Painter<std::uint8_t>(source, source.rgba8, bands, picture.raster, picture.raster.rgba8)
        .paint_all(run);
  } else {
    Painter<std::uint16_t>(source, source.rgba16, bands, picture.raster, picture.raster.rgba16)
        .paint_all(run);
  }
  if (run.cancelled()) {
    picture.status = Status::cancelled;
    picture.raster = Raster();
    return picture;
  }
  run.report(1.0);
  return picture;
}

WarpMap warp_map(const PlanarMesh& mesh, const Points2& target,
                 const std::vector<std::int32_t>& draw_order, const WarpView& view,
                 RunControl run) {
  const TriangleBands bands =
      detail::make_bands(mesh, target, draw_order, view, view.width, view.height);
  WarpMap map;
  map.width = view.width;
  map.height = view.height;
  const auto width = static_cast<std::size_t>(map.width);
  map.source_xy.assign(2 * width * static_cast<std::size_t>(map.height),
                       std::numeric_limits<float>::quiet_NaN());
  parallel_for(0, bands.num_bands(), 1, [&](Index first, Index last) {
    for (Index band = first; band < last && !run.cancelled(); ++band) {
      for_each_span(bands, band, map.width, map.height,
                    [&](std::int32_t number, std::int32_t y, PixelSpan span) {
                      const SourceRow row(bands.triangles[static_cast<std::size_t>(number)], y);
                      float* const line =
                          map.source_xy.data() + 2 * width * static_cast<std::size_t>(y);
                      for (std::int32_t x = span.begin; x < span.end; ++x) {
                        const auto [u, v] = row.at(x);
                        line[2 * x] = static_cast<float>(u);
                        line[2 * x + 1] = static_cast<float>(v);
                      }
                    });
    }
  });
  if (run.cancelled()) {
    map = WarpMap();
    map.status = Status::cancelled;
    return map;
  }
  run.report(1.0);
  return map;
}

}  // namespace dupin
