// Do error bars of keypoints hold what they promise, and what do they cost? Three tables in
// Markdown.
//
// 1. Keypoints kept at `--significance` under 50 % noise: the share that has a clean keypoint
// within
//    two mean edges, and the share of the clean keypoints of level 15 and up that is kept.
// 2. Surfaces without features (planes, a sphere): seeded runs that report a keypoint, and the
//    standard deviations predicted from the noisy surface over those measured, by level.
//
// 3. Time of the error bars (32 replicas, signal noise and 16 searches of replicas included) beside
// that of the stack of 35
//    levels and their Laplacians, on one thread and on two: medians of turns taken by both.
//
// keypoint_significance [--surfaces DIR] [--seeds 5] [--runs 200] [--significance 0.05]
//                       [--percent 50] [--vertices 4000] [--threads 2] [--cost 112500]
//
// 0 for --seeds, --runs or --cost leaves its table out.
//
// DIR as in keypoint_quality; a bumpy sphere is built in.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/parallel.h"
#include "dupin/features/keypoint_uncertainty.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"

namespace {

using dupin::Mesh;
using Eigen::Index;
using Eigen::VectorXd;

struct Settings {
  std::string surfaces;
  int seeds = 5;
  int runs = 200;
  double significance = 0.05;
  double percent = 50.0;
  Index vertices = 4000;
  int threads = 2;
  Index cost = 112'500;
};

constexpr double kReach = 2.0;  // mean edges
constexpr int kCoarse = 15;     // clean keypoints from this level on
constexpr std::uint64_t kSeed = 100;

struct Surface {
  std::string name;
  Mesh mesh;
  std::vector<std::uint8_t> is_guarded;
};

struct Stack {
  dupin::SurfaceGraph graph;
  dupin::DiffusionOperator op;
  VectorXd signal;
  dupin::LevelMatrix loc;
};

Stack stack_of(const Mesh& mesh, const std::vector<std::uint8_t>& is_guarded) {
  Stack stack;
  stack.graph = dupin::surface_graph(mesh, is_guarded);
  stack.op = dupin::umbrella_operator(stack.graph.topology.ring, &stack.graph.topology);
  stack.signal = dupin::compute_signal(stack.graph, dupin::Signal::height);
  dupin::ScaleSpaceOptions options;
  options.want_levels = false;
  stack.loc = dupin::compute_scale_space(stack.op, stack.signal, options).loc;
  return stack;
}

std::vector<dupin::Keypoint> keypoints_of(const Stack& stack, const dupin::LevelMatrix& loc) {
  return dupin::find_keypoints(stack.graph, loc, {}, stack.signal.cwiseAbs().maxCoeff()).keypoints;
}

dupin::StackNoise noise_of(const Stack& stack, double sigma, dupin::NoiseModel model,
                           std::uint64_t seed) {
  dupin::SignalNoiseOptions options;
  options.sigma = sigma;
  options.model = model;
  options.seed = seed;
  return dupin::estimate_stack_noise(
      stack.op, dupin::make_signal_noise(stack.graph, dupin::Signal::height, options),
      dupin::keypoint_noise_options(stack.graph, {}, {}));
}

dupin::NoisyMesh disturb(const Surface& surface, const Settings& settings, dupin::NoiseModel model,
                         std::uint64_t seed) {
  dupin::NoiseOptions options;
  options.percent = settings.percent;
  options.model = model;
  options.seed = seed;
  return dupin::add_noise(surface.mesh, options);
}

const char* name_of(dupin::NoiseModel model) {
  return model == dupin::NoiseModel::isotropic ? "isotropic" : "along normal";
}

// ---- kept keypoints ------------------------------------------------------------------------

struct Kept {
  double found = 0.0;
  double kept = 0.0;
  double counterpart = 0.0;  // kept ones with a clean keypoint near
  double found_counterpart = 0.0;
  double clean_coarse = 0.0;
  double coarse_kept = 0.0;
};

bool has_near(const Stack& clean, const dupin::Keypoint& point,
              const std::vector<dupin::Keypoint>& others) {
  return std::any_of(others.begin(), others.end(), [&](const dupin::Keypoint& other) {
    return (clean.graph.points.row(point.vertex) - clean.graph.points.row(other.vertex)).norm() <=
           kReach * clean.graph.mean_edge;
  });
}

void add_kept(const Surface& surface, const Settings& settings, dupin::NoiseModel model,
              std::uint64_t seed, const Stack& clean,
              const std::vector<dupin::Keypoint>& clean_points, Kept& total) {
  const dupin::NoisyMesh noisy = disturb(surface, settings, model, seed);
  const Stack stack = stack_of(noisy.mesh, surface.is_guarded);
  const auto found = keypoints_of(stack, stack.loc);
  const auto sure = dupin::estimate_keypoint_uncertainty(
      stack.graph, stack.loc, {}, noise_of(stack, noisy.sigma, model, seed), found, {});
  std::vector<dupin::Keypoint> kept;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const bool is_near = has_near(clean, found[i], clean_points);
    total.found_counterpart += is_near ? 1.0 : 0.0;
    if (!dupin::is_significant(sure[i], settings.significance)) continue;
    kept.push_back(found[i]);
    total.counterpart += is_near ? 1.0 : 0.0;
  }
  total.found += static_cast<double>(found.size());
  total.kept += static_cast<double>(kept.size());
  for (const dupin::Keypoint& point : clean_points) {
    if (point.level < kCoarse) continue;
    total.clean_coarse += 1.0;
    total.coarse_kept += has_near(clean, point, kept) ? 1.0 : 0.0;
  }
}

void print_kept(const std::vector<Surface>& surfaces, const Settings& settings) {
  std::printf(
      "Kept at significance %.3g under %.0f %% noise, %d seeds: shares with a counterpart within "
      "%.0f mean edges.\n\n| surface | noise | clean | found | found with clean one | kept | kept "
      "with clean one | clean ones of level %d up that are kept "
      "|\n|---|---|---|---|---|---|---|---|\n",
      settings.significance, settings.percent, settings.seeds, kReach, kCoarse);
  for (const Surface& surface : surfaces) {
    const Stack clean = stack_of(surface.mesh, surface.is_guarded);
    const auto clean_points = keypoints_of(clean, clean.loc);
    for (const auto model : {dupin::NoiseModel::along_normal, dupin::NoiseModel::isotropic}) {
      Kept total;
      for (int seed = 0; seed < settings.seeds; ++seed) {
        add_kept(surface, settings, model, kSeed + static_cast<std::uint64_t>(seed), clean,
                 clean_points, total);
      }
      const double seeds = settings.seeds;
      std::printf("| %s | %s | %zu | %.1f | %.3f | %.1f | %.3f | %.3f |\n", surface.name.c_str(),
                  name_of(model), clean_points.size(), total.found / seeds,
                  total.found_counterpart / std::max(1.0, total.found), total.kept / seeds,
                  total.counterpart / std::max(1.0, total.kept),
                  total.coarse_kept / std::max(1.0, total.clean_coarse));
      std::fflush(stdout);
    }
  }
}

// ---- surfaces without features -------------------------------------------------------------

void print_empty(const Settings& settings) {
  std::printf(
      "\nRuns of %d that report a keypoint on a surface without any, %.0f %% noise, significance "
      "%.3g.\n\n| surface | noise | keypoints found | runs with p <= %.3g | p <= 0.5 | runs that "
      "keep any | predicted "
      "over true sd, levels 12, 18, 24, 30 |\n|---|---|---|---|---|---|---|\n",
      settings.runs, settings.percent, settings.significance, settings.significance);
  dupin::PlaneOptions regular;
  regular.num_vertices = settings.vertices;
  dupin::PlaneOptions irregular = regular;
  irregular.jitter = 0.3;
  const std::vector<Surface> surfaces{
      {"plane", dupin::make_plane(regular).mesh, {}},
      {"irregular plane", dupin::make_plane(irregular).mesh, {}},
      {"sphere", dupin::make_sphere(1.0, settings.vertices).mesh, {}}};
  for (const Surface& surface : surfaces) {
    const Stack clean = stack_of(surface.mesh, {});
    for (const auto model : {dupin::NoiseModel::along_normal, dupin::NoiseModel::isotropic}) {
      double found = 0.0;
      int reports = 0;
      int half = 0;
      int kept = 0;
      VectorXd predicted = VectorXd::Zero(clean.loc.rows());
      VectorXd measured = predicted;
      for (int run = 0; run < settings.runs; ++run) {
        const auto seed = kSeed + static_cast<std::uint64_t>(run);
        const dupin::NoisyMesh noisy = disturb(surface, settings, model, seed);
        const Stack stack = stack_of(noisy.mesh, {});
        const auto points = keypoints_of(stack, stack.loc);
        const dupin::StackNoise noise = noise_of(stack, noisy.sigma, model, seed);
        double p = 1.0;
        bool is_kept = false;
        for (const auto& sure :
             dupin::estimate_keypoint_uncertainty(stack.graph, stack.loc, {}, noise, points, {})) {
          p = std::min(p, sure.p_value);
          is_kept = is_kept || dupin::is_significant(sure, settings.significance);
        }
        kept += is_kept ? 1 : 0;
        found += static_cast<double>(points.size());
        reports += p <= settings.significance ? 1 : 0;
        half += p <= 0.5 ? 1 : 0;
        predicted += noise.loc_sd.cast<double>().rowwise().squaredNorm();
        // Noise lengthens the mean edge, which is no deviation but another unit.
        const double unit = std::pow(clean.graph.mean_edge / stack.graph.mean_edge, 2);
        measured += (stack.loc - unit * clean.loc).rowwise().squaredNorm();
      }
      const auto ratio = [&](Index level) { return std::sqrt(predicted[level] / measured[level]); };
      std::printf("| %s | %s | %.1f | %d | %d | %d | %.2f, %.2f, %.2f, %.2f |\n",
                  surface.name.c_str(), name_of(model), found / settings.runs, reports, half, kept,
                  ratio(12), ratio(18), ratio(24), ratio(30));
      std::fflush(stdout);
    }
  }
}

// ---- cost ----------------------------------------------------------------------------------

struct Elapsed {
  double wall = 0.0;
  double processor = 0.0;  // of all threads
};

template <class Work>
Elapsed time_of(Work work) {
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t ticks = std::clock();
  work();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          static_cast<double>(std::clock() - ticks) / CLOCKS_PER_SEC};
}

Elapsed median(std::vector<Elapsed> all) {
  const auto of = [&](double Elapsed::*field) {
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end(),
                     [&](const Elapsed& a, const Elapsed& b) { return a.*field < b.*field; });
    return (*middle).*field;
  };
  return {of(&Elapsed::wall), of(&Elapsed::processor)};
}

void print_cost(const Settings& settings) {
  constexpr int kTurns = 5;
  dupin::NoiseOptions noise;
  noise.percent = 20.0;
  noise.model = dupin::NoiseModel::isotropic;
  const dupin::NoisyMesh noisy =
      dupin::add_noise(dupin::make_torus(1.0, 0.4, settings.cost).mesh, noise);
  const Stack stack = stack_of(noisy.mesh, {});
  const auto found = keypoints_of(stack, stack.loc);
  std::printf(
      "\nTorus of %td vertices, seconds (processor seconds).\n\n| threads | stack | error bars | "
      "ratio | ratio to the stack on one thread |\n|---|---|---|---|---|\n",
      stack.graph.points.rows());
  double single = 0.0;
  for (const int threads : {1, 2}) {
    dupin::set_thread_count(threads);
    std::vector<Elapsed> plain;
    std::vector<Elapsed> bars;
    for (int turn = 0; turn < kTurns; ++turn) {
      plain.push_back(time_of([&] { dupin::compute_scale_space(stack.op, stack.signal); }));
      bars.push_back(time_of([&] {
        const dupin::StackNoise bar = noise_of(stack, noisy.sigma, dupin::NoiseModel::isotropic,
                                               static_cast<std::uint64_t>(turn));
        dupin::estimate_keypoint_uncertainty(stack.graph, stack.loc, {}, bar, found, {});
      }));
    }
    const Elapsed a = median(plain);
    const Elapsed b = median(bars);
    if (threads == 1) single = a.wall;
    std::printf("| %d | %.3f (%.3f) | %.3f (%.3f) | %.1f (%.1f) | %.1f |\n", threads, a.wall,
                a.processor, b.wall, b.processor, b.wall / a.wall, b.processor / a.processor,
                b.wall / single);
    std::fflush(stdout);
  }
}

std::vector<Surface> all_surfaces(const Settings& settings) {
  std::vector<Surface> surfaces;
  if (!settings.surfaces.empty()) {
    for (const char* name : {"armadillo.off", "bunny00.off", "refined_elephant.off"}) {
      const auto path = std::filesystem::path(settings.surfaces) / name;
      if (!std::filesystem::exists(path)) continue;
      dupin::HealedSurface healed = dupin::heal(dupin::read_surface(path.string()).mesh);
      surfaces.push_back(
          {path.stem().string(), std::move(healed.mesh), std::move(healed.is_guarded)});
    }
  }
  surfaces.push_back(
      {"bumpy sphere", dupin::make_bumpy_sphere(1.0, 20'000, {40, 0.1, 0.12, 1}).surface.mesh, {}});
  return surfaces;
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Error bars of keypoints against what really happens");
  app.add_option("--surfaces", settings.surfaces, "Directory of keypoint_quality's surfaces");
  app.add_option("--seeds", settings.seeds)->check(CLI::Range(0, 1000));
  app.add_option("--runs", settings.runs)->check(CLI::Range(0, 100'000));
  app.add_option("--significance", settings.significance)->check(CLI::Range(0.0, 1.0));
  app.add_option("--percent", settings.percent)->check(CLI::Range(0.1, 200.0));
  app.add_option("--vertices", settings.vertices)->check(CLI::Range(Index{500}, Index{1'000'000}));
  app.add_option("--threads", settings.threads)->check(CLI::Range(1, 64));
  app.add_option("--cost", settings.cost)->check(CLI::Range(Index{0}, Index{2'000'000}));
  CLI11_PARSE(app, argc, argv);
  dupin::set_thread_count(settings.threads);
  if (settings.seeds > 0) print_kept(all_surfaces(settings), settings);
  if (settings.runs > 0) print_empty(settings);
  if (settings.cost > 0) print_cost(settings);
}
