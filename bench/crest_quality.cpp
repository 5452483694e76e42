// How near crest lines come to those known in closed form, and what they cost: a table in Markdown.
//
// "near true" is the share of the length found that lies within 1.5 mean edges of a true line of
// its kind, "true near" the share of the true length within 1.5 mean edges of a line found. Points
// on noisy surfaces are placed on their edge of the clean surface, so the noise itself does not
// move them. The noise is along the normals; its deviation is given to the program or, with
// --estimate, estimated.
//
// --null N: instead, lines found on surfaces that have none, over N draws of either noise, and how
// high their signal-to-noise ratio is: what a threshold on it costs and saves.
//
// crest_quality [--size 20000] [--seeds 3] [--threads 1] [--estimate] [--null 40]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/crest/crest_noise.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mls/noise_level.h"
#include "tests/support/crest_surfaces.h"

namespace {

using namespace dupin;
using Eigen::Index;

constexpr double kReach = 1.5;        // mean edges
constexpr std::uint64_t kSeed = 100;  // of the first noise
constexpr Index kTimedSize = 113'000;

struct Settings {
  Index size = 20'000;
  int seeds = 3;
  int threads = 1;
  bool is_estimated = false;
  int null_draws = 0;
};

std::vector<test::CrestSurface> make_surfaces(Index size) {
  return {test::crest_ellipsoid(size),
          test::crest_torus(size),
          test::crest_gaussian_ridge(size),
          test::crest_rounded_cube(size),
          {"plane", make_plane({.num_vertices = size, .jitter = 0.25}).mesh, {}},
          {"sphere", make_sphere(1.0, size).mesh, {}},
          {"cylinder", make_cylinder(1.0, 4.0, size).mesh, {}},
          {"circular torus 3:1", make_torus(3.0, 1.0, size).mesh, {}}};
}

void print_agreement(const Settings& settings, const std::vector<test::CrestSurface>& surfaces) {
  std::printf("| surface | noise | near true | true near | lines | length in edges |\n");
  std::printf("|---|---|---|---|---|---|\n");
  for (const test::CrestSurface& surface : surfaces) {
    const double edge = surface_graph(surface.mesh).mean_edge;
    for (const double percent : {0.0, 20.0, 50.0}) {
      const int seeds = percent > 0.0 ? settings.seeds : 1;
      test::LineAgreement worst{1.0, 1.0};
      double lines = 0.0;
      double length = 0.0;
      for (int s = 0; s < seeds; ++s) {
        const NoisyMesh noisy = add_noise(
            surface.mesh, {.percent = percent, .seed = kSeed + static_cast<std::uint64_t>(s)});
        CrestOptions options;
        options.noise_sigma =
            settings.is_estimated ? estimate_noise(noisy.mesh.points).sigma : noisy.sigma;
        const CrestSet set = find_crest_lines(surface_graph(noisy.mesh), options);
        const test::LineAgreement a = test::agreement(surface, set.lines, kReach * edge);
        worst.found_near_true = std::min(worst.found_near_true, a.found_near_true);
        worst.true_near_found = std::min(worst.true_near_found, a.true_near_found);
        lines += static_cast<double>(set.lines.size()) / seeds;
        for (const CrestLine& line : set.lines) length += line.length / edge / seeds;
      }
      if (surface.lines.empty()) {
        std::printf("| %s | %.0f %% | - | - | %.1f | %.0f |\n", surface.name.c_str(), percent,
                    lines, length);
      } else {
        std::printf("| %s | %.0f %% | %.1f %% | %.1f %% | %.1f | %.0f |\n", surface.name.c_str(),
                    percent, 100.0 * worst.found_near_true, 100.0 * worst.true_near_found, lines,
                    length);
      }
    }
  }
}

// SNR of every line found on `draws` noisy copies, and on how many of them there was one at all.
struct NullLines {
  std::vector<double> snr;
  std::vector<double> largest;  // of every draw, 0 without a line
};

NullLines null_lines(const Mesh& mesh, NoiseModel model, double percent, int draws) {
  NullLines out;
  for (int s = 0; s < draws; ++s) {
    const NoisyMesh noisy = add_noise(
        mesh, {.percent = percent, .model = model, .seed = kSeed + static_cast<std::uint64_t>(s)});
    const SurfaceGraph graph = surface_graph(noisy.mesh);
    // Noise along the normals alone is what isotropic noise leaves of itself on a surface.
    CrestOptions options;
    options.noise_sigma = noisy.sigma;
    const CrestSet set = find_crest_lines(graph, options);
    double largest = 0.0;
    for (const CrestUncertainty& u :
         estimate_crest_uncertainty(graph, set, options, {.sigma = noisy.sigma}).lines) {
      out.snr.push_back(u.snr);
      largest = std::max(largest, u.snr);
    }
    out.largest.push_back(largest);
  }
  return out;
}

void print_null(const Settings& settings) {
  const std::pair<const char*, Mesh> surfaces[] = {
      {"plane", make_plane({.num_vertices = settings.size, .jitter = 0.25}).mesh},
      {"sphere", make_sphere(1.0, settings.size).mesh},
      {"cylinder", make_cylinder(1.0, 4.0, settings.size).mesh}};
  constexpr double kThresholds[] = {0.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  std::printf("| surface | noise | lines a draw |");
  for (const double t : kThresholds) std::printf(" snr %.0f |", t);
  std::printf(" largest |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& [name, mesh] : surfaces) {
    for (const NoiseModel model : {NoiseModel::along_normal, NoiseModel::isotropic}) {
      for (const double percent : {20.0, 50.0}) {
        const NullLines found = null_lines(mesh, model, percent, settings.null_draws);
        std::printf("| %s | %.0f %%, %s | %.2f |", name, percent,
                    model == NoiseModel::isotropic ? "isotropic" : "along normals",
                    static_cast<double>(found.snr.size()) / settings.null_draws);
        for (const double t : kThresholds) {
          const auto survive = std::count_if(found.largest.begin(), found.largest.end(),
                                             [&](double snr) { return snr > t; });
          std::printf(" %.0f %% |", 100.0 * static_cast<double>(survive) / settings.null_draws);
        }
        std::printf(" %.1f |\n", *std::max_element(found.largest.begin(), found.largest.end()));
        std::fflush(stdout);
      }
    }
  }
}

void print_times() {
  const Mesh mesh = test::crest_ellipsoid(kTimedSize).mesh;
  double least[3] = {1e300, 1e300, 1e300};
  double cpu = 1e300;
  for (int run = 0; run < 5; ++run) {
    const std::clock_t begin = std::clock();
    const auto a = std::chrono::steady_clock::now();
    const SurfaceGraph graph = surface_graph(mesh);
    const auto b = std::chrono::steady_clock::now();
    CrestOptions options;
    options.noise_sigma = estimate_noise(graph.points).sigma;
    const auto c = std::chrono::steady_clock::now();
    find_crest_lines(graph, options);
    const auto d = std::chrono::steady_clock::now();
    const double seconds[3] = {std::chrono::duration<double>(b - a).count(),
                               std::chrono::duration<double>(c - b).count(),
                               std::chrono::duration<double>(d - c).count()};
    for (int i = 0; i < 3; ++i) least[i] = std::min(least[i], seconds[i]);
    cpu = std::min(cpu, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  std::printf(
      "\n%td vertices, %d thread(s): graph %.3f s, noise %.3f s, lines %.3f s (least of five); "
      "processor time together %.3f s\n",
      mesh.points.rows(), thread_count(), least[0], least[1], least[2], cpu);
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  CLI::App app("Crest lines beside the truth");
  app.add_option("--size", settings.size, "Vertices of the surfaces")->capture_default_str();
  app.add_option("--seeds", settings.seeds, "Draws of the noise; the worst counts")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--threads", settings.threads)->capture_default_str();
  app.add_flag("--estimate", settings.is_estimated, "Estimate the noise");
  app.add_option("--null", settings.null_draws, "Draws on surfaces without lines instead")
      ->check(CLI::Range(0, 10'000));
  CLI11_PARSE(app, argc, argv);
  set_thread_count(settings.threads);
  if (settings.null_draws > 0) {
    print_null(settings);
    return 0;
  }
  const std::vector<test::CrestSurface> surfaces = make_surfaces(settings.size);
  print_agreement(settings, surfaces);
  std::fflush(stdout);
  print_times();
  return 0;
}
