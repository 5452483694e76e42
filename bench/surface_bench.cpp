// What comes before and after the stack: signals per 100,000 vertices, heal() per million faces,
// the three rules of find_keypoints(). On one and two threads; items are vertices
// (faces for heal).
//
// surface_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <cmath>

#include "dupin/base/parallel.h"
#include "dupin/features/keypoints.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/surface/curvature.h"
#include "dupin/surface/height_signal.h"
#include "dupin/surface/surface_graph.h"

namespace {

using Eigen::Index;
using Eigen::VectorXd;

dupin::Mesh noisy(const dupin::Mesh& mesh) {
  dupin::NoiseOptions noise;
  noise.percent = 20.0;
  noise.seed = 1;
  return dupin::add_noise(mesh, noise).mesh;
}

// 100,000 vertices with structures of several sizes, and the Laplacian of its stack.
struct Bumpy {
  dupin::SurfaceGraph graph = dupin::surface_graph(
      noisy(dupin::make_bumpy_sphere(1.0, 100'000, {120, 0.05, 0.06, 1}).surface.mesh));
  VectorXd signal = dupin::compute_signal(graph, dupin::Signal::height);
  dupin::ScaleSpace stack;

  Bumpy() {
    dupin::ScaleSpaceOptions options;
    options.want_levels = false;
    stack = dupin::compute_scale_space(
        dupin::umbrella_operator(graph.topology.ring, &graph.topology), signal, options);
  }
};

const Bumpy& bumpy() {
  static const Bumpy made;
  return made;
}

void finish(benchmark::State& state, Index items) {
  state.SetItemsProcessed(state.iterations() * items);
  state.counters["items"] = static_cast<double>(items);
  dupin::set_thread_count(1);
}

void BM_Taubin(benchmark::State& state) {
  const dupin::SurfaceGraph& graph = bumpy().graph;
  const dupin::Mesh mesh{graph.points, graph.triangles};
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const auto field = dupin::estimate_curvature_taubin(mesh, graph.topology);
    if (field.num_skipped != 0) state.SkipWithError("vertices were skipped");
    benchmark::DoNotOptimize(field.k1.data());
  }
  finish(state, graph.points.rows());
}

void BM_Height(benchmark::State& state) {
  const dupin::SurfaceGraph& graph = bumpy().graph;
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const VectorXd height = dupin::height_signal(graph.points, graph.normals, graph.topology.ring);
    if (!(height.mean() > 0.0)) state.SkipWithError("a sphere is convex");
    benchmark::DoNotOptimize(height.data());
  }
  finish(state, graph.points.rows());
}

void BM_SurfaceGraph(benchmark::State& state) {
  const dupin::Mesh mesh{bumpy().graph.points, bumpy().graph.triangles};
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const auto graph = dupin::surface_graph(mesh);
    if (graph.topology.num_boundary_edges != 0) state.SkipWithError("a sphere has no boundary");
    benchmark::DoNotOptimize(graph.points.data());
  }
  finish(state, mesh.points.rows());
}

void BM_UmbrellaOperator(benchmark::State& state) {
  const dupin::MeshTopology& topology = bumpy().graph.topology;
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const auto op = dupin::umbrella_operator(topology.ring, &topology);
    if (op.spectrum_bound != 1.5) state.SkipWithError("a closed surface is bounded by 3/2");
    benchmark::DoNotOptimize(op.index.data());
  }
  finish(state, topology.ring.num_vertices());
}

void BM_Heal(benchmark::State& state) {
  const dupin::PolygonMesh input =
      dupin::to_polygon_mesh(noisy(dupin::make_torus(1.0, 0.4, 500'000).mesh));
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const dupin::HealedSurface healed = dupin::heal(input);
    if (!healed.is_closed || healed.euler != 0) state.SkipWithError("not a torus any more");
    benchmark::DoNotOptimize(healed.mesh.points.data());
  }
  finish(state, input.num_faces());
}

void keypoints(benchmark::State& state, dupin::KeypointRule rule) {
  const Bumpy& surface = bumpy();
  dupin::KeypointOptions options;
  options.rule = rule;
  dupin::set_thread_count(static_cast<int>(state.range(0)));
  Index count = 0;
  for (auto _ : state) {
    const auto set = dupin::find_keypoints(surface.graph, surface.stack.loc, {},
                                           surface.signal.cwiseAbs().maxCoeff(), options);
    count = static_cast<Index>(set.keypoints.size());
    if (count < 120) state.SkipWithError("fewer keypoints than bumps");
  }
  state.counters["keypoints"] = static_cast<double>(count);
  finish(state, surface.graph.points.rows());
}

void BM_KeypointsLevel(benchmark::State& state) { keypoints(state, dupin::KeypointRule::level); }
void BM_KeypointsSpaceScale(benchmark::State& state) {
  keypoints(state, dupin::KeypointRule::space_scale);
}
void BM_KeypointsPersistent(benchmark::State& state) {
  keypoints(state, dupin::KeypointRule::persistent);
}

void threads(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgName("threads")->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
}

BENCHMARK(BM_Taubin)->Apply(threads);
BENCHMARK(BM_Height)->Apply(threads);
BENCHMARK(BM_SurfaceGraph)->Apply(threads);
BENCHMARK(BM_UmbrellaOperator)->Apply(threads);
BENCHMARK(BM_Heal)->Apply(threads);
BENCHMARK(BM_KeypointsLevel)->Apply(threads);
BENCHMARK(BM_KeypointsSpaceScale)->Apply(threads);
BENCHMARK(BM_KeypointsPersistent)->Apply(threads);

}  // namespace
