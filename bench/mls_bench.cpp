// Search of the 100 nearest neighbours, cubic fit and curvatures of 40,000 points, one thread, on a
// sphere and a torus with 0, 20 and 50 % isotropic noise, beside CGAL's Monge_via_jet_fitting of
// degree 3 with the same neighbours found by nanoflann. rms_H is the root mean square error of the
// mean curvature against the analytic one [1/radius]; the peer fits without weights, so "uniform"
// is its like and "gaussian" the default of this library.
//
// mls_bench --benchmark_repetitions=5 --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/nanoflann_search.h"
#include "dupin/base/parallel.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mls/mls_surface.h"
#include "dupin/mls/noise_level.h"

#ifdef DUPIN_PEER_CGAL
#include <CGAL/Monge_via_jet_fitting.h>
#include <CGAL/Simple_cartesian.h>
#endif

namespace {

using Eigen::Index;

constexpr int kNeighbors = 100;
constexpr Index kPoints = 40'000;

struct Case {
  std::string name;
  dupin::AnalyticSurface clean;
  dupin::Points points;
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = [] {
    std::vector<Case> made;
    for (const char* shape : {"sphere", "torus"}) {
      for (const double percent : {0.0, 20.0, 50.0}) {
        const bool is_sphere = std::string(shape) == "sphere";
        Case c;
        c.clean =
            is_sphere ? dupin::make_sphere(1.0, kPoints) : dupin::make_torus(1.0, 0.4, kPoints);
        c.points =
            dupin::add_noise(c.clean.mesh,
                             {.percent = percent, .model = dupin::NoiseModel::isotropic, .seed = 1})
                .mesh.points;
        c.name = std::string(shape) + "/" + std::to_string(static_cast<int>(percent)) + "%";
        made.push_back(std::move(c));
      }
    }
    return made;
  }();
  return all;
}

void report(benchmark::State& state, const Case& c, const Eigen::VectorXd& mean) {
  state.counters["rms_H"] =
      std::sqrt((mean - c.clean.mean).squaredNorm() / static_cast<double>(mean.size()));
  state.counters["s_per_100K"] = benchmark::Counter(
      static_cast<double>(c.points.rows()) / 1e5,
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void dupin_curvature(benchmark::State& state, const Case& c, dupin::MlsWeight weight,
                     bool want_deviations) {
  dupin::set_thread_count(1);
  dupin::MlsCurvatureOptions options;
  options.patch.neighbors = kNeighbors;
  options.patch.weight = weight;
  options.want_deviations = want_deviations;
  dupin::MlsCurvature found;
  for (auto _ : state) found = dupin::estimate_curvature_mls(c.points, c.clean.normals, options);
  if (found.field.num_skipped != 0) state.SkipWithError("points without curvature");
  report(state, c, found.field.mean());
}

void dupin_noise(benchmark::State& state, const Case& c) {
  dupin::set_thread_count(1);
  for (auto _ : state) benchmark::DoNotOptimize(dupin::estimate_noise(c.points));
}

#ifdef DUPIN_PEER_CGAL
void cgal_jet(benchmark::State& state, const Case& c) {
  using Kernel = CGAL::Simple_cartesian<double>;
  using Fitting = CGAL::Monge_via_jet_fitting<Kernel>;
  dupin::set_thread_count(1);
  Eigen::VectorXd mean(c.points.rows());
  for (auto _ : state) {
    const dupin::bench::NanoflannSearch search(c.points);
    std::vector<std::int32_t> index(kNeighbors);
    std::vector<double> squared(kNeighbors);
    std::vector<Kernel::Point_3> around;
    for (Index v = 0; v < c.points.rows(); ++v) {
      around.clear();
      search.nearest(c.points.row(v).data(), index.size(), index.data(), squared.data());
      for (const std::int32_t j : index) {
        const auto row = c.points.row(j);
        around.emplace_back(row[0], row[1], row[2]);
      }
      Fitting fitting;
      Fitting::Monge_form form = fitting(around.begin(), around.end(), 3, 2);
      const auto normal = c.clean.normals.row(v);
      form.comply_wrt_given_normal(Kernel::Vector_3(normal[0], normal[1], normal[2]));
      // Curvatures of the Monge form over the given normal: negative on a sphere.
      mean[v] = -0.5 * (form.principal_curvatures(0) + form.principal_curvatures(1));
    }
  }
  report(state, c, mean);
}
#endif

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (const Case& c : cases()) {
    const auto add = [&](const std::string& name, auto run) {
      benchmark::RegisterBenchmark((name + "/" + c.name).c_str(), run)
          ->Unit(benchmark::kMillisecond);
    };
    add("uniform", [&c](benchmark::State& state) {
      dupin_curvature(state, c, dupin::MlsWeight::uniform, false);
    });
    add("gaussian", [&c](benchmark::State& state) {
      dupin_curvature(state, c, dupin::MlsWeight::gaussian, false);
    });
    add("gaussian_deviations", [&c](benchmark::State& state) {
      dupin_curvature(state, c, dupin::MlsWeight::gaussian, true);
    });
    add("noise_level", [&c](benchmark::State& state) { dupin_noise(state, c); });
#ifdef DUPIN_PEER_CGAL
    add("cgal_jet", [&c](benchmark::State& state) { cgal_jet(state, c); });
#endif
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
