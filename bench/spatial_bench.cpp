// The k nearest neighbours of every vertex of a noisy sphere, sorting or building the tree
// included: NeighborSearch, visited and as a sorted table, against nanoflann. Items are vertices.
//
// spatial_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <atomic>
#include <vector>

#include "bench/nanoflann_search.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/spatial/neighborhoods.h"

namespace {

using Eigen::Index;

const dupin::Points& surface(Index num_vertices) {
  static Index made_for = 0;
  static dupin::Points points;
  if (made_for != num_vertices) {
    dupin::NoiseOptions noise;
    noise.percent = 20.0;
    noise.seed = 1;
    points = dupin::add_noise(dupin::make_sphere(1.0, num_vertices).mesh, noise).mesh.points;
    made_for = num_vertices;
  }
  return points;
}

void finish(benchmark::State& state, Index items) {
  state.SetItemsProcessed(state.iterations() * items);
  dupin::set_thread_count(1);
}

void BM_Nanoflann(benchmark::State& state) {
  const dupin::Points& points = surface(state.range(0));
  const auto k = static_cast<std::size_t>(state.range(1));
  dupin::set_thread_count(static_cast<int>(state.range(2)));
  for (auto _ : state) {
    const dupin::bench::NanoflannSearch tree(points);
    std::atomic<std::size_t> num_found{0};
    dupin::parallel_for(0, points.rows(), 512, [&](Index first, Index last) {
      std::vector<std::int32_t> index(k);
      std::vector<double> squared(k);
      std::size_t found = 0;
      for (Index q = first; q < last; ++q) {
        found += tree.nearest(points.row(q).data(), k, index.data(), squared.data());
        benchmark::DoNotOptimize(squared.data());
      }
      num_found += found;
    });
    if (num_found != k * static_cast<std::size_t>(points.rows())) {
      state.SkipWithError("neighbours are missing");
    }
  }
  finish(state, points.rows());
}

void BM_NeighborTable(benchmark::State& state) {
  const dupin::Points& points = surface(state.range(0));
  const int k = static_cast<int>(state.range(1));
  dupin::set_thread_count(static_cast<int>(state.range(2)));
  for (auto _ : state) {
    const auto table = dupin::NeighborSearch(points).nearest(points, k);
    if (table.index(0, 0) != 0) state.SkipWithError("a point is its own nearest");
    benchmark::DoNotOptimize(table.squared.data());
  }
  finish(state, points.rows());
}

void BM_NeighborSearch(benchmark::State& state) {
  const dupin::Points& points = surface(state.range(0));
  const int k = static_cast<int>(state.range(1));
  dupin::set_thread_count(static_cast<int>(state.range(2)));
  for (auto _ : state) {
    std::atomic<Index> num_found{0};
    dupin::NeighborSearch(points).visit_nearest(points, k, [&] {
      return [&](Index /*query*/, std::span<const std::int32_t> index,
                 std::span<const double> squared) {
        benchmark::DoNotOptimize(squared.data());
        num_found.fetch_add(static_cast<Index>(index.size()), std::memory_order_relaxed);
      };
    });
    if (num_found != points.rows() * k) state.SkipWithError("neighbours are missing");
  }
  finish(state, points.rows());
}

void sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"V", "k", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (const int num_vertices : {10'000, 100'000, 1'000'000}) {
    for (const int k : {20, 100}) {
      for (const int threads : {1, 2}) benchmark->Args({num_vertices, k, threads});
    }
  }
}

BENCHMARK(BM_Nanoflann)->Apply(sizes);
BENCHMARK(BM_NeighborTable)->Apply(sizes);
BENCHMARK(BM_NeighborSearch)->Apply(sizes);

}  // namespace
