// Warping a garment of 24 megapixels with a mesh of 20,000 triangles, and finding its outline. Each
// run checks what it made: a fast failure is not fast. Threads: DUPIN_BENCH_THREADS, 0 for all.
//
// warp_render_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>

#include "dupin/base/parallel.h"
#include "dupin/warp/shape_from_image.h"
#include "dupin/warp/warp_render.h"

#ifdef DUPIN_PEER_OPENCV
#include <opencv2/imgproc.hpp>
#endif

namespace {

using Eigen::Index;

constexpr int kWidth = 6000;
constexpr int kHeight = 4000;

// Fine stripes in an ellipse with a soft edge.
dupin::Raster make_garment(int bit_depth) {
  dupin::Raster raster = dupin::make_raster(kWidth, kHeight, 8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      std::uint8_t* const p = raster.rgba8.data() + 4 * (static_cast<std::size_t>(y) * kWidth +
                                                         static_cast<std::size_t>(x));
      const double d = std::hypot((x - 3000.0) / 2900.0, (y - 2000.0) / 1900.0);
      p[0] = static_cast<std::uint8_t>(128 + 100 * std::sin(0.9 * x));
      p[1] = static_cast<std::uint8_t>(x * 255 / kWidth);
      p[2] = static_cast<std::uint8_t>(y * 255 / kHeight);
      p[3] = static_cast<std::uint8_t>(
          std::lround(255.0 * std::min(1.0, std::max(0.0, 1000.0 * (1.0 - d)))));
    }
  }
  return bit_depth == 8 ? raster : dupin::with_bit_depth(raster, bit_depth);
}

const dupin::Raster& garment(int bit_depth) {
  static const dupin::Raster eight = make_garment(8);
  static const dupin::Raster sixteen = make_garment(16);
  return bit_depth == 8 ? eight : sixteen;
}

// 122 by 82 cells of 50 px cover the picture and a margin.
dupin::PlanarMesh make_mesh() {
  constexpr int kColumns = 122;
  constexpr int kRows = 82;
  dupin::PlanarMesh mesh;
  mesh.points.resize(Index{kColumns + 1} * (kRows + 1), 2);
  mesh.triangles.resize(Index{2} * kColumns * kRows, 3);
  Index face = 0;
  for (int j = 0; j <= kRows; ++j) {
    for (int i = 0; i <= kColumns; ++i) {
      mesh.points.row(Index{j} * (kColumns + 1) + i) << 50.0 * (i - 1), 50.0 * (j - 1);
      if (i == kColumns || j == kRows) continue;
      const int a = j * (kColumns + 1) + i;
      const int b = a + kColumns + 1;
      mesh.triangles.row(face++) << a, a + 1, b + 1;
      mesh.triangles.row(face++) << a, b + 1, b;
    }
  }
  return mesh;
}

// Waves that stretch and shrink by up to a fifth, about a picture `scale` as large.
dupin::Points2 waved(const dupin::Points2& points, double scale) {
  dupin::Points2 target = points;
  for (Index i = 0; i < points.rows(); ++i) {
    const double x = points(i, 0);
    const double y = points(i, 1);
    target.row(i) << 3000.0 + scale * (x - 3000.0 + 80.0 * std::sin(y / 400.0)),
        2000.0 + scale * (y - 2000.0 + 80.0 * std::sin(x / 400.0));
  }
  return target;
}

void use_threads() {
  const char* const count = std::getenv("DUPIN_BENCH_THREADS");
  dupin::set_thread_count(count == nullptr ? 0 : std::atoi(count));
}

void BM_RenderWarp(benchmark::State& state) {
  use_threads();
  const dupin::Raster& source = garment(static_cast<int>(state.range(0)));
  const dupin::PlanarMesh mesh = make_mesh();
  const dupin::Points2 target = waved(mesh.points, static_cast<double>(state.range(1)) / 100.0);
  for (auto _ : state) {
    const dupin::WarpPicture picture = dupin::render_warp(source, mesh, target);
    if (picture.raster.width != kWidth || picture.num_flipped != 0) state.SkipWithError("wrong");
  }
  state.SetItemsProcessed(state.iterations() * kWidth * kHeight);
  state.counters["triangles"] = static_cast<double>(mesh.triangles.rows());
}
// Depth, then the size of the result in percent.
BENCHMARK(BM_RenderWarp)
    ->Args({8, 100})
    ->Args({16, 100})
    ->Args({8, 50})
    ->Args({8, 10})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

void BM_WarpMap(benchmark::State& state) {
  use_threads();
  const dupin::PlanarMesh mesh = make_mesh();
  const dupin::Points2 target = waved(mesh.points, 1.0);
  dupin::WarpView view;
  view.width = kWidth;
  view.height = kHeight;
  for (auto _ : state) {
    const dupin::WarpMap map = dupin::warp_map(mesh, target, {}, view);
    if (!(map.source_xy[2 * (kWidth * std::size_t{2000} + 3000)] > 0.0F))
      state.SkipWithError("wrong");
  }
}
BENCHMARK(BM_WarpMap)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();

void BM_ShapeFromImage(benchmark::State& state) {
  use_threads();
  dupin::ShapeOptions options;
  options.expansion_px = static_cast<double>(state.range(0));
  for (auto _ : state) {
    const dupin::ImageShape shape = dupin::shape_from_image(garment(8), options);
    if (shape.outline.loops.size() != 1) state.SkipWithError("wrong");
  }
}
BENCHMARK(BM_ShapeFromImage)
    ->Arg(0)
    ->Arg(2)
    ->Arg(64)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

#ifdef DUPIN_PEER_OPENCV
// Reads by a given map, without depth, soft seams or a filter for shrinking.
void BM_OpencvRemap(benchmark::State& state) {
  const dupin::Raster& source = garment(8);
  const dupin::PlanarMesh mesh = make_mesh();
  dupin::WarpView view;
  view.width = kWidth;
  view.height = kHeight;
  dupin::WarpMap map = dupin::warp_map(mesh, waved(mesh.points, 1.0), {}, view);
  const cv::Mat from(kHeight, kWidth, CV_8UC4,
                     const_cast<std::uint8_t*>(source.rgba8.data()));  // NOLINT
  const cv::Mat places(kHeight, kWidth, CV_32FC2, map.source_xy.data());
  cv::Mat to;
  for (auto _ : state) {
    cv::remap(from, to, places, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_CONSTANT);
    if (to.cols != kWidth) state.SkipWithError("wrong");
  }
}
BENCHMARK(BM_OpencvRemap)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
#endif

}  // namespace
