// How well partial scans are brought together: tables in Markdown.
//
// A pair is a success when its rotation is within one degree and the mean point of the moving part
// within 0.5 % of the diameter of where it belongs; within 5 degrees and 2 edges it is "near",
// which a refinement could reach. CPU seconds are those of the whole process, without reading.
//
// registration_quality --surfaces DIR [--modes pairs,scaled,different,mirrored,outliers,views,real]
//     [--write FILES [--open3d /usr/bin/python3]] [--real DIR] [--fixed cloud|mesh] [--draw N]
//
// DIR holds armadillo.off, bunny00.off and refined_elephant.off as Debian's libcgal-demo packs
// them; a bumpy sphere is built in. --open3d has bench/peers/open3d_registration.py register the
// files that --write made. --real holds lidar_pair/ and bunny_views/.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench/registration/methods.h"
#include "bench/registration/pairs.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/random.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/registration/register_all.h"
#include "dupin/render/range_view.h"
#include "dupin/spatial/neighborhoods.h"

namespace {

using dupin::Mesh;
using dupin::Points;
using dupin::Pose;
using dupin::bench::Answer;
using dupin::bench::Method;
using dupin::bench::NamedPair;
using dupin::bench::NamedSurface;
using Eigen::Index;

struct Request {
  std::string surfaces;
  std::string write;
  std::string open3d;
  std::string real;
  std::string fixed = "cloud";
  std::vector<std::string> modes = {"pairs"};
  std::vector<std::string> only;
  std::uint64_t draw = 1;
  std::size_t different = 100;
  int threads = 1;
};

enum class Outcome { wrong, near, success };

struct Judged {
  const NamedPair* named = nullptr;
  Answer answer;
  dupin::test::PoseError error;
  Outcome outcome = Outcome::wrong;
};

Judged judge(const NamedPair& named, const Answer& answer) {
  Judged judged{&named, answer, {}, Outcome::wrong};
  const auto& pair = named.pair;
  judged.error = dupin::test::pose_error(answer.pose, pair.truth, pair.moving.points);
  const bool has_scale = std::abs(judged.error.scale) < 0.01;
  if (judged.error.rotation_deg < 1.0 && judged.error.translation < 0.005 * pair.diameter &&
      has_scale) {
    judged.outcome = Outcome::success;
  } else if (judged.error.rotation_deg < 5.0 && judged.error.translation < 2.0 * pair.edge &&
             has_scale) {
    judged.outcome = Outcome::near;
  }
  return judged;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// One row: successes (and near) by noise and overlap, totals, medians.
void print_row(const std::string& name, const std::vector<Judged>& all) {
  std::map<std::pair<int, int>, int> success;
  std::map<int, std::vector<double>> angles;  // by noise
  std::vector<double> shifts;
  std::vector<double> seconds;
  int num_success = 0;
  int num_near = 0;
  int num_accepted_wrong = 0;
  for (const Judged& judged : all) {
    const std::pair key(judged.named->noise_percent, judged.named->overlap_percent);
    success[key] += judged.outcome == Outcome::success ? 1 : 0;
    seconds.push_back(judged.answer.seconds);
    num_near += judged.outcome == Outcome::near ? 1 : 0;
    num_accepted_wrong += judged.answer.is_accepted && judged.outcome == Outcome::wrong ? 1 : 0;
    if (judged.outcome != Outcome::success) continue;
    ++num_success;
    angles[judged.named->noise_percent].push_back(judged.error.rotation_deg);
    shifts.push_back(judged.error.translation / judged.named->pair.diameter);
  }
  std::printf("| %s |", name.c_str());
  for (const int noise : {0, 20, 50}) {
    std::printf(" %d + %d + %d |", success[{noise, 30}], success[{noise, 50}],
                success[{noise, 70}]);
  }
  std::printf(" %d of %zu | %d | %d |", num_success, all.size(), num_near, num_accepted_wrong);
  for (const int noise : {0, 20, 50}) {
    const char* after = noise == 50 ? " |" : " /";
    if (angles[noise].empty()) {
      std::printf(" -%s", after);
    } else {
      std::printf(" %.3f%s", median(angles[noise]), after);
    }
  }
  if (num_success > 0) {
    std::printf(" %.1e |", median(shifts));
  } else {
    std::printf(" - |");
  }
  std::printf(" %.2f |\n", median(seconds));
  std::fflush(stdout);
}

void tell(const std::string& method, const Judged& judged) {
  std::cerr << method << ' ' << judged.named->name << ": "
            << (judged.answer.is_accepted ? "accepted" : "refused") << ", "
            << judged.error.rotation_deg << " deg, "
            << judged.error.translation / judged.named->pair.diameter << " of the diameter, scale "
            << judged.error.scale << ", " << judged.answer.seconds << " s\n";
}

// ---- Open3D --------------------------------------------------------------------------------

std::map<std::string, std::vector<Judged>> ask_open3d(const Request& request,
                                                      const std::vector<NamedPair>& pairs) {
  const std::string answers = request.write + "/open3d.json";
  const std::string command = request.open3d + " " + DUPIN_BENCH_SOURCE +
                              "/peers/open3d_registration.py " + request.write + " " + answers;
  std::map<std::string, std::vector<Judged>> rows;
  if (std::system(command.c_str()) != 0) {
    std::cerr << "Open3D is left out: its script failed\n";
    return rows;
  }
  std::ifstream file(answers);
  for (const auto& entry : nlohmann::json::parse(file)) {
    const auto named = std::find_if(pairs.begin(), pairs.end(), [&](const NamedPair& pair) {
      return pair.name == entry.at("pair");
    });
    if (named == pairs.end()) continue;
    Answer answer;
    answer.is_accepted = true;  // it never refuses
    answer.seconds = entry.at("seconds");
    const std::vector<std::vector<double>> T = entry.at("T_fixed_moving");
    for (std::size_t r = 0; r < 3; ++r) {
      const auto row = static_cast<Index>(r);
      answer.pose.rotation.row(row) << T.at(r).at(0), T.at(r).at(1), T.at(r).at(2);
      answer.pose.translation[row] = T.at(r).at(3);
    }
    rows[entry.at("method")].push_back(judge(*named, answer));
  }
  return rows;
}

// ---- modes ---------------------------------------------------------------------------------

std::vector<Method> methods_of(const Request& request) {
  std::vector<Method> methods = dupin::bench::registration_methods();
  if (!request.only.empty()) {
    std::erase_if(methods, [&](const Method& method) {
      return std::none_of(request.only.begin(), request.only.end(), [&](const std::string& word) {
        return method.name.find(word) != std::string::npos;
      });
    });
  }
  return methods;
}

void print_success(const Request& request, const std::string& title,
                   const std::vector<NamedPair>& pairs, bool is_scale_known, bool with_peers) {
  std::printf(
      "\n%s, fixed part as %s. Successes of the overlaps 30 + 50 + 70 %%; near: within 5 degrees "
      "and 2 edges; medians over the successes, seconds over all.\n\n"
      "| method | noise 0 | 20 %% | 50 %% | success | near | wrong but accepted | deg at 0 / 20 / "
      "50 %% | shift / "
      "diameter | CPU s |\n|---|---|---|---|---|---|---|---|---|---|\n",
      title.c_str(), request.fixed.c_str());
  for (const Method& method : methods_of(request)) {
    if (method.knows_scale && !is_scale_known) continue;
    std::vector<Judged> row;
    for (const NamedPair& named : pairs) {
      row.push_back(judge(named, method.run(named.pair, request.fixed == "cloud")));
      if (row.back().outcome != Outcome::success) tell(method.name, row.back());
    }
    print_row(method.name, row);
  }
  if (!with_peers || request.open3d.empty()) return;
  for (const auto& [name, row] : ask_open3d(request, pairs)) print_row(name, row);
}

void print_refusals(const Request& request, const std::string& title,
                    const std::vector<NamedPair>& pairs) {
  std::printf(
      "\n%s: accepted, of %zu, and CPU s.\n\n| method | accepted | CPU s |\n|---|---|---|\n",
      title.c_str(), pairs.size());
  for (const Method& method : methods_of(request)) {
    int num_accepted = 0;
    std::vector<double> seconds;
    for (const NamedPair& named : pairs) {
      const Judged judged = judge(named, method.run(named.pair, request.fixed == "cloud"));
      seconds.push_back(judged.answer.seconds);
      if (!judged.answer.is_accepted) continue;
      ++num_accepted;
      tell(method.name, judged);
    }
    std::printf("| %s | %d | %.2f |\n", method.name.c_str(), num_accepted, median(seconds));
    std::fflush(stdout);
  }
}

// 1000 points of a surface one across, noise 0.01, 95 % of the places drawn in its ball.
void print_outliers(const std::vector<NamedSurface>& surfaces, std::uint64_t draw) {
  constexpr int kRuns = 20;
  std::printf(
      "\n1000 matches, 95 %% wrong, noise 0.01 of a surface one across: found within 5 degrees and "
      "0.05, of %d; medians.\n\n| surface | method | found | deg | shift | CPU s "
      "|\n|---|---|---|---|---|---|\n",
      kRuns);
  for (const NamedSurface& surface : surfaces) {
    const Eigen::RowVector3d low = surface.mesh.points.colwise().minCoeff();
    const Eigen::RowVector3d size = surface.mesh.points.colwise().maxCoeff() - low;
    for (const auto& estimator : dupin::bench::pose_estimators()) {
      std::vector<double> angles;
      std::vector<double> shifts;
      std::vector<double> seconds;
      int num_found = 0;
      for (std::uint64_t run = 0; run < kRuns; ++run) {
        dupin::Rng rng(draw * 1000 + run);
        Points from(1000, 3);
        for (Index i = 0; i < from.rows(); ++i) {
          const auto vertex =
              static_cast<Index>(rng.below(static_cast<std::uint64_t>(surface.mesh.points.rows())));
          from.row(i) = (surface.mesh.points.row(vertex) - low) / size.norm();
        }
        const Pose truth = dupin::test::random_pose(1.0, 1.0, rng.next());
        Points to = dupin::transformed(from, truth);
        const Eigen::RowVector3d middle = to.colwise().mean();
        for (Index i = 0; i < to.rows(); ++i) {
          for (int c = 0; c < 3; ++c) {
            to(i, c) = i % 20 == 0 ? to(i, c) + 0.01 * rng.normal()
                                   : middle[c] + 0.5 * rng.uniform(-1.0, 1.0);
          }
        }
        const Answer answer = estimator.run(from, to, 0.03);
        const auto error = dupin::test::pose_error(answer.pose, truth, from);
        const bool is_found =
            answer.is_accepted && error.rotation_deg < 5.0 && error.translation < 0.05;
        num_found += is_found ? 1 : 0;
        angles.push_back(error.rotation_deg);
        shifts.push_back(error.translation);
        seconds.push_back(answer.seconds);
      }
      std::printf("| %s | %s | %d | %.2f | %.4f | %.3f |\n", surface.name.c_str(),
                  estimator.name.c_str(), num_found, median(angles), median(shifts),
                  median(seconds));
      std::fflush(stdout);
    }
  }
}

// ---- sets of views ---------------------------------------------------------------------------

// Twelve range views, 30 degrees apart, each in a pose of its own, into one frame.
void print_views(const std::vector<NamedSurface>& surfaces, std::uint64_t draw) {
  constexpr int kViews = 12;
  std::printf(
      "\n%d views of 160 x 160 pixels, 30 degrees apart, in random poses: views in one frame, "
      "largest error of any point over the diameter, pairs accepted, CPU s.\n\n"
      "| surface | registered | largest error | pairs | CPU s |\n|---|---|---|---|---|\n",
      kViews);
  for (const NamedSurface& surface : surfaces) {
    std::vector<dupin::ScanFeatures> scans;
    std::vector<Points> points;
    std::vector<Pose> truth;
    const double start = dupin::bench::cpu_seconds();
    for (int k = 0; k < kViews; ++k) {
      dupin::Camera direction;
      direction.azimuth_deg = 30.0 * k;
      const auto camera = dupin::fit_range_camera(surface.mesh.points, direction, 160, 160);
      Mesh view = dupin::scan_range_view(surface.mesh, camera).mesh;
      const Pose moved =
          dupin::test::random_pose(1.0, 1.0, 100 * draw + static_cast<std::uint64_t>(k));
      view.points = dupin::transformed(view.points, moved);
      truth.push_back(compose({1.0, camera.rotation.transpose(), camera.position}, inverse(moved)));
      points.push_back(view.points);
      scans.push_back(dupin::describe_scan(view));
    }
    const dupin::RegisterAllResult found = dupin::register_all(scans);
    int registered = 0;
    double largest = 0.0;
    for (std::size_t i = 0; i < scans.size() && found.reference >= 0; ++i) {
      if (!found.poses[i]) continue;
      ++registered;
      const Pose& frame = truth[static_cast<std::size_t>(found.reference)];
      const Points there = dupin::transformed(points[i], compose(frame, *found.poses[i]));
      largest = std::max(
          largest, (there - dupin::transformed(points[i], truth[i])).rowwise().norm().maxCoeff());
    }
    const double diameter =
        (surface.mesh.points.colwise().maxCoeff() - surface.mesh.points.colwise().minCoeff())
            .norm();
    std::printf("| %s | %d | %.5f | %zu | %.1f |\n", surface.name.c_str(), registered,
                largest / diameter, found.pairs.size(), dupin::bench::cpu_seconds() - start);
    std::fflush(stdout);
  }
}

// ---- real scans ----------------------------------------------------------------------------

struct RealPair {
  std::string name;
  Mesh moving;
  Mesh fixed;
  bool has_truth = false;
  Pose truth;
};

Mesh read_points(const std::string& path) {
  return {dupin::read_surface(path).mesh.points, dupin::Triangles(0, 3)};
}

Pose read_pose(const std::string& path) {
  Eigen::Matrix4d T;
  std::ifstream file(path);
  for (int i = 0; i < 16; ++i) file >> T(i / 4, i % 4);
  Pose pose;
  pose.rotation = dupin::nearest_rotation(T.topLeftCorner<3, 3>());
  pose.translation = T.topRightCorner<3, 1>();
  return pose;
}

std::vector<RealPair> real_pairs(const std::string& directory) {
  std::vector<RealPair> pairs;
  const std::string lidar = directory + "/lidar_pair/";
  pairs.push_back({"lidar", read_points(lidar + "source.ply"), read_points(lidar + "target.ply"),
                   true, read_pose(lidar + "T_target_source.txt")});
  const std::string bunny = directory + "/bunny_views/";
  const Mesh view = read_points(bunny + "bun0.pcd");
  pairs.push_back({"two views of the bunny", read_points(bunny + "bun4.pcd"), view, false, {}});
  pairs.push_back({"bunny and milk carton (nothing to find)",
                   read_points(bunny + "milk.pcd"),
                   view,
                   false,
                   {}});
  return pairs;
}

// Share of `from` within `reach` of `to`.
double covered(const Points& from, const Points& to, double reach) {
  const auto table = dupin::NeighborSearch(to).nearest(from, 1);
  return static_cast<double>((table.squared.array() <= reach * reach).count()) /
         static_cast<double>(from.rows());
}

void print_real(const Request& request) {
  std::printf(
      "\nReal scans. Covered: share of the points of each within 1 %% of the diameter of the other "
      "one.\n\n| pair | method | accepted | deg | shift | covered moving / fixed | CPU s "
      "|\n|---|---|---|---|---|---|---|\n");
  for (const RealPair& real : real_pairs(request.real)) {
    dupin::test::ScanPair pair;
    pair.moving = real.moving;
    pair.fixed = real.fixed;
    const double reach =
        0.01 *
        (real.fixed.points.colwise().maxCoeff() - real.fixed.points.colwise().minCoeff()).norm();
    std::vector<Method> methods = methods_of(request);
    methods.push_back(dupin::bench::from_given_pose());
    for (const Method& method : methods) {
      const Answer answer = method.run(pair, true);
      const Points there = dupin::transformed(real.moving.points, answer.pose);
      const auto error = dupin::test::pose_error(answer.pose, real.truth, real.moving.points);
      const std::string angle = real.has_truth ? std::to_string(error.rotation_deg) : "-";
      const std::string shift = real.has_truth ? std::to_string(error.translation) : "-";
      std::printf("| %s | %s | %s | %s | %s | %.2f / %.2f | %.2f |\n", real.name.c_str(),
                  method.name.c_str(), answer.is_accepted ? "yes" : "no", angle.c_str(),
                  shift.c_str(), covered(there, real.fixed.points, reach),
                  covered(real.fixed.points, there, reach), answer.seconds);
      std::fflush(stdout);
    }
  }
}

void run(const Request& request) {
  const std::set<std::string> modes(request.modes.begin(), request.modes.end());
  if (request.surfaces.empty()) {
    std::cerr << "no --surfaces DIR: armadillo, bunny00 and refined_elephant are left out\n";
  }
  const auto surfaces = dupin::bench::registration_surfaces(request.surfaces);
  if (modes.contains("pairs")) {
    const auto pairs = dupin::bench::overlap_pairs(surfaces, 1.0, request.draw);
    if (!request.write.empty()) dupin::bench::write_pairs(request.write, pairs);
    print_success(request, "Pairs of one surface", pairs, true, true);
  }
  if (modes.contains("scaled")) {
    const auto pairs = dupin::bench::overlap_pairs(surfaces, 100.0, request.draw);
    if (!request.write.empty()) dupin::bench::write_pairs(request.write + "/scaled", pairs);
    print_success(request, "The moving part in a unit of its own, 0.01 to 100", pairs, false,
                  false);
  }
  if (modes.contains("different")) {
    const auto pairs = dupin::bench::different_pairs(surfaces, request.different, request.draw);
    if (!request.write.empty()) dupin::bench::write_pairs(request.write + "/different", pairs);
    print_refusals(request, "Different objects", pairs);
  }
  if (modes.contains("mirrored")) {
    const auto pairs = dupin::bench::mirrored_pairs(surfaces, request.draw);
    if (!request.write.empty()) dupin::bench::write_pairs(request.write + "/mirrored", pairs);
    print_refusals(request, "Mirror images", pairs);
  }
  if (modes.contains("outliers")) print_outliers(surfaces, request.draw);
  if (modes.contains("views")) print_views(surfaces, request.draw);
  if (modes.contains("real")) {
    if (request.real.empty()) {
      std::cerr << "real scans are left out: no --real DIR\n";
    } else {
      print_real(request);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Success of the registration of partial scans"};
  Request request;
  app.add_option("--surfaces", request.surfaces,
                 "Folder with armadillo, bunny00, refined_elephant (.off)");
  app.add_option("--modes", request.modes, "What to measure")
      ->delimiter(',')
      ->check(
          CLI::IsMember({"pairs", "scaled", "different", "mirrored", "outliers", "views", "real"}));
  app.add_option("--only", request.only, "Methods whose name contains one of these; NONE: none")
      ->delimiter(',');
  app.add_option("--fixed", request.fixed, "The fixed part: cloud or mesh")
      ->check(CLI::IsMember({"cloud", "mesh"}));
  app.add_option("--write", request.write, "Write the pairs here as PLY, the truth as JSON");
  app.add_option("--open3d", request.open3d, "Python with Open3D, to compare with (needs --write)")
      ->needs("--write");
  app.add_option("--real", request.real, "Folder with lidar_pair and bunny_views");
  app.add_option("--draw", request.draw, "Other cuts, poses and noise");
  app.add_option("--different", request.different, "Pairs of different objects");
  app.add_option("--threads", request.threads, "Threads (poses do not depend on it)");
  CLI11_PARSE(app, argc, argv);
  try {
    dupin::set_thread_count(request.threads);
    run(request);
  } catch (const dupin::Error& error) {
    std::cerr << error.diagnostic() << '\n';
    return static_cast<int>(error.errc());
  }
  return 0;
}
