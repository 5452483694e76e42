// Tables 4.1, 4.2 and 4.4 to 4.10 of the thesis, the printed figure beside ours, in Markdown.
//
// thesis_chapter4 [--experiments 40] [--quick]
//
// --quick: 10 experiments of 100 draws for each test, and every eighth point in Tables 4.1 and 4.2.
// The surfaces are in tests/support/thesis_surfaces.h, the reasons for gaps in
// docs/methods/local_scale.md.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "dupin/base/parallel.h"
#include "dupin/mesh/noise.h"
#include "dupin/mls/local_scale.h"
#include "dupin/spatial/neighborhoods.h"
#include "tests/support/thesis_surfaces.h"

namespace {

using dupin::LocalScale;
using dupin::LocalScaleOptions;
using dupin::Points;
using dupin::ScaleTest;
using dupin::thesis::Site;
using dupin::thesis::TorusPoint;
using Eigen::Index;

constexpr int kNeighbors = 100;  // of Tables 4.1 and 4.2

struct Row {
  std::string name;
  std::vector<int> printed;  // 0: no size passes
  std::vector<double> printed_radius;
};

LocalScaleOptions thesis_options(const Site& site, double noise, int experiments) {
  LocalScaleOptions options;
  options.draws = dupin::thesis_patch_draws(noise * site.edge);
  options.draws.experiments = experiments;
  for (int k = 30; k <= 400; k += 10) options.sizes.push_back(k);
  return options;
}

LocalScale scale_of(const Site& site, const LocalScaleOptions& options) {
  return find_local_scale(site.points, site.vertex, site.normal, options);
}

std::string size_text(int size) { return size > 0 ? std::to_string(size) : "none"; }

void print_tables_1_and_2(bool is_quick) {
  const auto sphere = dupin::make_icosphere(1.0, 6);
  const Index stride = is_quick ? 8 : 1;
  std::printf(
      "\nTables 4.1, 4.2: unit sphere, 100 neighbours, means over the surface\n\n"
      "| noise | direction | beta5 | beta7 | K | H | printed beta5, beta7 | printed K, -H |\n"
      "|---|---|---|---|---|---|---|---|\n");
  const std::vector<std::string> beta = {"-.5000, -.5000", "-.4814, -.4750", "-.3938, -.3823",
                                         "-.2674, -.2720"};
  const std::vector<std::string> kappa = {"1.0000, 1.0000", ".9011, .9521", ".6358, .7645",
                                          ".8217, .5261"};
  for (std::size_t level = 0; level < beta.size(); ++level) {
    for (const auto model : {dupin::NoiseModel::along_normal, dupin::NoiseModel::isotropic}) {
      if (level == 0 && model == dupin::NoiseModel::isotropic) continue;
      const auto noisy = dupin::add_noise(
          sphere.mesh, {.percent = 50.0 * static_cast<double>(level), .model = model});
      const Points& points = noisy.mesh.points;
      const Index count = (points.rows() + stride - 1) / stride;
      Points queries(count, 3);
      for (Index i = 0; i < count; ++i) queries.row(i) = points.row(i * stride);
      const auto table = dupin::NeighborSearch(points).nearest(queries, kNeighbors);
      Eigen::MatrixXd found(count, 4);
      dupin::parallel_for(0, count, 64, [&](Index first, Index last) {
        Points near(kNeighbors, 3);
        for (Index i = first; i < last; ++i) {
          for (Index j = 0; j < kNeighbors; ++j) near.row(j) = points.row(table.index(i, j));
          const auto patch = dupin::fit_mls_patch(queries.row(i), near, {}, queries.row(i));
          const auto curvature = dupin::patch_curvature(patch.beta);
          found.row(i) << patch.beta[4], patch.beta[6], curvature.gauss, curvature.mean;
        }
      });
      const Eigen::RowVector4d mean = found.colwise().mean();
      std::printf("| %.1f l | %s | %.4f | %.4f | %.4f | %.4f | %s | %s |\n",
                  0.5 * static_cast<double>(level),
                  model == dupin::NoiseModel::isotropic ? "isotropic" : "normal", mean[0], mean[1],
                  mean[2], mean[3], beta[level].c_str(), kappa[level].c_str());
    }
  }
}

void print_table_4(const Site& sphere, int experiments) {
  const std::vector<int> sizes = {30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130, 150, 200, 250};
  const std::vector<double> beta = {709.8, 864.0, 950.2, 517.7, 37.6, 38.5, 38.1,
                                    35.8,  36.8,  36.4,  37.3,  36.9, 38.0, 36.1};
  const std::vector<double> kappa = {53.9, 13.2, 9.1, 6.6, 4.7, 2.8, 2.6,
                                     2.6,  2.5,  2.4, 2.5, 2.9, 2.9, 3.9};
  LocalScaleOptions options = thesis_options(sphere, 0.5, experiments);
  options.sizes = sizes;
  options.stop_at_first_pass = false;
  const LocalScale scale = scale_of(sphere, options);
  std::printf(
      "\nTable 4.4: sphere, 50%% noise\n\n"
      "| k | T(beta) | sd | printed | T(kappa) | sd | printed | ranks |\n"
      "|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const ScaleTest& test = scale.tests[i];
    std::printf("| %d | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %d, %d |\n", test.neighbors,
                test.T_beta, test.T_beta_sd, beta[i], test.T_kappa, test.T_kappa_sd, kappa[i],
                static_cast<int>(test.rank_beta), static_cast<int>(test.rank_kappa));
  }
}

// "70 .0564 / 70 .0566 (40)": ours / printed, in brackets the first size at which T(beta) passes.
void print_rows(const char* title, const std::vector<double>& noises, const std::vector<Row>& rows,
                const std::function<Site(std::size_t)>& site_of, int experiments) {
  std::printf(
      "\n%s: size and radius, ours / printed; in brackets the size for T(beta) alone\n\n| point ",
      title);
  for (const double noise : noises) std::printf("| %.0f%% ", 100.0 * noise);
  std::printf("|\n|---");
  for (std::size_t i = 0; i < noises.size(); ++i) std::printf("|---");
  std::printf("|\n");
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const Site site = site_of(r);
    std::printf("| %s ", rows[r].name.c_str());
    for (std::size_t i = 0; i < noises.size(); ++i) {
      const LocalScale scale = scale_of(site, thesis_options(site, noises[i], experiments));
      int beta = 0;
      for (const ScaleTest& test : scale.tests) {
        if (beta == 0 && test.T_beta <= test.critical_beta) beta = test.neighbors;
      }
      std::printf("| %s", size_text(scale.passed() ? scale.test().neighbors : 0).c_str());
      if (scale.passed()) std::printf(" %.4f", scale.test().radius);
      if (i < rows[r].printed.size()) {
        std::printf(" / %s", size_text(rows[r].printed[i]).c_str());
        if (i < rows[r].printed_radius.size()) std::printf(" %.4f", rows[r].printed_radius[i]);
      }
      std::printf(" (%s) ", size_text(beta).c_str());
      std::fflush(stdout);
    }
    std::printf("|\n");
  }
}

TorusPoint torus_point(std::size_t i) {
  return i == 0 ? TorusPoint::hyperbolic : i == 1 ? TorusPoint::parabolic : TorusPoint::elliptic;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Tables of chapter 4 of the thesis");
  int experiments = 40;
  bool is_quick = false;
  app.add_option("--experiments", experiments, "Experiments of 100 draws for each test")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  app.add_flag("--quick", is_quick, "10 experiments, an eighth of the sphere");
  CLI11_PARSE(app, argc, argv);
  if (is_quick) experiments = 10;

  const Site sphere = dupin::thesis::sphere();
  print_tables_1_and_2(is_quick);
  print_table_4(sphere, experiments);
  print_rows(
      "Table 4.5", {0.2, 0.5, 0.8, 1.0, 1.5}, {{"sphere", {30, 70, 100, 130, 210}, {}}},
      [&](std::size_t) { return sphere; }, experiments);
  const std::vector<double> noises = {0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4};
  print_rows(
      "Tables 4.6, 4.7", noises,
      {{"plane",
        {50, 60, 80, 110, 130, 160, 180},
        {.0736, .0757, .0892, .1071, .1143, .1262, .1359}},
       {"cylinder",
        {110, 170, 200, 240, 280, 310, 350},
        {.1070, .1298, .1437, .1535, .1683, .1784, .1896}},
       {"sphere",
        {40, 70, 80, 100, 130, 150, 180},
        {.0477, .0634, .0689, .0783, .0921, .1015, .1096}},
       {"torus, hyperbolic",
        {70, 100, 130, 160, 200, 250, 260},
        {.0566, .0713, .0793, .0890, .0991, .1115, .1135}},
       {"torus, parabolic",
        {70, 100, 140, 170, 180, 200, 250},
        {.0808, .0948, .1130, .1248, .1279, .1347, .1508}},
       {"torus, elliptic",
        {70, 100, 130, 160, 190, 190, 250},
        {.1058, .1188, .1378, .1587, .1673, .1673, .1925}}},
      [&](std::size_t row) {
        if (row == 0) return dupin::thesis::plane();
        if (row == 1) return dupin::thesis::cylinder();
        if (row == 2) return sphere;
        return dupin::thesis::torus(torus_point(row - 3), false);
      },
      experiments);
  const auto quarter = [](std::size_t row) { return dupin::thesis::torus(torus_point(row), true); };
  print_rows("Tables 4.8, 4.9", noises,
             {{"hyperbolic",
               {30, 40, 60, 80, 100, 120, 140},
               {.0780, .0873, .1103, .1260, .1403, .1490, .1651}},
              {"parabolic",
               {30, 50, 50, 70, 80, 90, 100},
               {.1034, .1343, .1343, .1591, .1683, .1770, .1870}},
              {"elliptic",
               {30, 50, 60, 70, 70, 90, 90},
               {.1256, .1715, .1812, .2079, .2079, .2321, .2321}}},
             quarter, experiments);
  print_rows("Table 4.10", {0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 4.0, 5.6},
             {{"hyperbolic", {50, 80, 120, 180, 0, 0, 0}, {}},
              {"parabolic", {50, 70, 90, 110, 140, 170, 0}, {}},
              {"elliptic", {40, 70, 90, 100, 150, 0, 0}, {}}},
             quarter, experiments);
  return 0;
}
