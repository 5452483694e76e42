// How many keypoints are found again after a change of the surface: a table in Markdown.
//
// A keypoint of the clean surface counts as found again when a keypoint of the changed surface lies
// within two mean edges of it; both are placed at their vertex of the clean surface (after Loop: at
// the refined vertex), so the noise itself does not move them. The chance beside each figure is
// 1 - exp(-d pi (2 e)^2) with the density d of the keypoints that could be hit: what points thrown
// at random would reach. +- is the standard error over the seeds. CPU seconds: one thread, from the
// mesh to the keypoints, median of three on the clean surface.
//
// keypoint_quality --surfaces DIR [--seeds 5] [--threads 2] [--json FILE] [--no-peers] [FILE ...]
//
// DIR holds armadillo.off, bunny00.off and refined_elephant.off as Debian's libcgal-demo packs
// them; a bumpy sphere is built in.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/features/keypoints.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/noise.h"
#include "dupin/mesh/shapes.h"
#include "dupin/mesh/subdivision.h"
#include "dupin/surface/surface_graph.h"

#ifdef DUPIN_PEER_PCL_KEYPOINTS
#include <pcl/keypoints/harris_3d.h>
#include <pcl/keypoints/iss_3d.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#endif

namespace {

using dupin::Mesh;
using dupin::Points;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double kReach = 2.0;        // mean edges
constexpr int kLoopLevels = 7;        // a halved edge: the same structure, so many levels higher
constexpr int kLevel = 20;            // Fig. 5.3
constexpr int kLevelTolerance = 3;    // two extrema of the space-scale rule are the same structure
constexpr std::uint64_t kSeed = 100;  // of the first noise
constexpr std::array<std::pair<int, int>, 5> kBands = {
    {{2, 5}, {6, 11}, {12, 17}, {18, 23}, {24, 33}}};

struct Surface {
  std::string name;
  Mesh mesh;
  std::vector<std::uint8_t> is_guarded;
  double edge = 0.0;
  double area = 0.0;
};

struct Spot {
  std::int32_t vertex;
  int level;  // 0 for peers
};
using Spots = std::vector<Spot>;

enum class Detector { level, level_taubin, space_scale, persistent, harris, iss };

struct DetectorName {
  Detector detector;
  const char* name;
};
constexpr DetectorName kOwnDetectors[] = {{Detector::level, "level 20, height"},
                                          {Detector::level_taubin, "level 20, Taubin (thesis)"},
                                          {Detector::space_scale, "space-scale, height"},
                                          {Detector::persistent, "persistent, height"}};
#ifdef DUPIN_PEER_PCL_KEYPOINTS
constexpr DetectorName kPeers[] = {{Detector::harris, "PCL Harris3D r 4 e"},
                                   {Detector::iss, "PCL ISS3D r 6/4 e"}};
#endif

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// ---- detection -----------------------------------------------------------------------------

// Keypoints and CPU seconds of every detector on one surface. What detectors share (graph, stack)
// is computed once and counted for each.
struct Detection {
  std::map<Detector, Spots> spots;
  std::map<Detector, double> seconds;
};

dupin::LevelMatrix laplacian_of(const dupin::SurfaceGraph& graph, const VectorXd& signal) {
  dupin::ScaleSpaceOptions options;
  options.want_levels = false;
  return dupin::compute_scale_space(dupin::umbrella_operator(graph.topology.ring, &graph.topology),
                                    signal, options)
      .loc;
}

void find(Detection& result, Detector detector, dupin::KeypointRule rule, int level_shift,
          const dupin::SurfaceGraph& graph, const dupin::LevelMatrix& loc, const VectorXd& signal,
          double seconds_before) {
  dupin::KeypointOptions options;
  options.rule = rule;
  options.level = kLevel + level_shift;
  const double start = cpu_seconds();
  const auto set = dupin::find_keypoints(graph, loc, {}, signal.cwiseAbs().maxCoeff(), options);
  result.seconds[detector] = seconds_before + cpu_seconds() - start;
  Spots& spots = result.spots[detector];
  for (const dupin::Keypoint& point : set.keypoints) spots.push_back({point.vertex, point.level});
}

void detect_own(Detection& result, const Mesh& mesh, const std::vector<std::uint8_t>& is_guarded,
                int level_shift) {
  const double start = cpu_seconds();
  const dupin::SurfaceGraph graph = dupin::surface_graph(mesh, is_guarded);
  const double after_graph = cpu_seconds();
  {
    const VectorXd signal = dupin::compute_signal(graph, dupin::Signal::height);
    const dupin::LevelMatrix loc = laplacian_of(graph, signal);
    const double seconds = cpu_seconds() - start;
    using enum dupin::KeypointRule;
    find(result, Detector::level, level, level_shift, graph, loc, signal, seconds);
    find(result, Detector::space_scale, space_scale, level_shift, graph, loc, signal, seconds);
    find(result, Detector::persistent, persistent, level_shift, graph, loc, signal, seconds);
  }
  const double before_taubin = cpu_seconds();
  const VectorXd signal = dupin::compute_signal(graph, dupin::Signal::mean);
  const dupin::LevelMatrix loc = laplacian_of(graph, signal);
  find(result, Detector::level_taubin, dupin::KeypointRule::level, level_shift, graph, loc, signal,
       after_graph - start + cpu_seconds() - before_taubin);
}

#ifdef DUPIN_PEER_PCL_KEYPOINTS
using Cloud = pcl::PointCloud<pcl::PointXYZ>;

template <class Method>
void run_peer(Detection& result, Detector detector, Method& method, const Cloud::Ptr& cloud) {
  const double start = cpu_seconds();
  method.setSearchMethod(pcl::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
  method.setInputCloud(cloud);
  typename Method::PointCloudOut found;
  method.compute(found);
  result.seconds[detector] = cpu_seconds() - start;
  Spots& spots = result.spots[detector];
  for (const int vertex : method.getKeypointsIndices()->indices) spots.push_back({vertex, 0});
}

// Radii in mean edges of the clean surface, also after Loop: the same size in space.
void detect_peers(Detection& result, const Mesh& mesh, double edge) {
  const auto cloud = pcl::make_shared<Cloud>();
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    const Eigen::RowVector3f p = mesh.points.row(v).cast<float>();
    cloud->push_back({p.x(), p.y(), p.z()});
  }
  pcl::HarrisKeypoint3D<pcl::PointXYZ, pcl::PointXYZI> harris;
  harris.setRadius(static_cast<float>(4.0 * edge));
  harris.setNonMaxSupression(true);
  harris.setRefine(false);
  harris.setNumberOfThreads(1);
  run_peer(result, Detector::harris, harris, cloud);
  pcl::ISSKeypoint3D<pcl::PointXYZ, pcl::PointXYZ> iss;
  iss.setSalientRadius(6.0 * edge);
  iss.setNonMaxRadius(4.0 * edge);
  iss.setNumberOfThreads(1);
  run_peer(result, Detector::iss, iss, cloud);
}
#endif

Detection detect(const Mesh& mesh, const std::vector<std::uint8_t>& is_guarded, int level_shift,
                 double edge, bool with_peers) {
  Detection result;
  detect_own(result, mesh, is_guarded, level_shift);
#ifdef DUPIN_PEER_PCL_KEYPOINTS
  if (with_peers) detect_peers(result, mesh, edge);
#else
  static_cast<void>(edge);
  static_cast<void>(with_peers);
#endif
  return result;
}

// ---- comparison ----------------------------------------------------------------------------

double chance(double count, const Surface& surface) {
  const double reach = kReach * surface.edge;
  return 1.0 - std::exp(-count / surface.area * M_PI * reach * reach);
}

struct Share {
  double value = std::numeric_limits<double>::quiet_NaN();
  double chance = 0.0;
};

// `matches(a, b)`: may spot b of the changed surface stand for spot a of the clean one?
template <class Matches>
Share found_again(const Surface& surface, const Spots& clean, const Points& changed_points,
                  const Spots& changed, Matches matches) {
  if (clean.empty()) return {};
  double hits = 0.0;
  double by_chance = 0.0;
  for (const Spot& a : clean) {
    double candidates = 0.0;
    bool is_hit = false;
    for (const Spot& b : changed) {
      if (!matches(a, b)) continue;
      candidates += 1.0;
      is_hit =
          is_hit || (surface.mesh.points.row(a.vertex) - changed_points.row(b.vertex)).norm() <=
                        kReach * surface.edge;
    }
    hits += is_hit ? 1.0 : 0.0;
    by_chance += chance(candidates, surface);
  }
  const auto count = static_cast<double>(clean.size());
  return {hits / count, by_chance / count};
}

// Of the clean keypoints, the share that is a keypoint again, at the same vertex.
double same_vertices(const Spots& clean, const Spots& changed) {
  const double hits = static_cast<double>(std::count_if(clean.begin(), clean.end(), [&](Spot a) {
    return std::any_of(changed.begin(), changed.end(),
                       [&](Spot b) { return a.vertex == b.vertex && a.level == b.level; });
  }));
  return clean.empty() ? std::numeric_limits<double>::quiet_NaN()
                       : hits / static_cast<double>(std::max(clean.size(), changed.size()));
}

// A figure over seeds.
class Series {
 public:
  void add(const Share& share, std::size_t count) {
    if (std::isnan(share.value)) return;
    values_.push_back(share.value);
    chance_ += share.chance;
    count_ += static_cast<double>(count);
  }
  bool is_empty() const { return values_.empty(); }
  double mean() const {
    double sum = 0.0;
    for (const double value : values_) sum += value;
    return sum / size();
  }
  double chance() const { return chance_ / size(); }
  double count() const { return count_ / size(); }
  /// Of the mean; 0 for one value.
  double standard_error() const {
    double sum = 0.0;
    for (const double value : values_) sum += (value - mean()) * (value - mean());
    return values_.size() < 2 ? 0.0 : std::sqrt(sum / (size() - 1.0) / size());
  }

 private:
  double size() const { return static_cast<double>(values_.size()); }
  std::vector<double> values_;
  double chance_ = 0.0;
  double count_ = 0.0;
};

struct Condition {
  const char* name;
  dupin::NoiseModel model;
  double percent;
};
constexpr Condition kNoises[] = {{"20 %", dupin::NoiseModel::along_normal, 20.0},
                                 {"50 %", dupin::NoiseModel::along_normal, 50.0},
                                 {"80 %", dupin::NoiseModel::along_normal, 80.0},
                                 {"80 % isotropic", dupin::NoiseModel::isotropic, 80.0}};

struct Row {
  std::string surface;
  std::string detector;
  std::size_t num_clean = 0;
  double chance_clean = 0.0;
  double seconds = 0.0;
  std::map<std::string, Series> noise;  // by condition
  double rotation = 0.0;                // same vertices and levels
  double times_ten = 0.0;
  double by_thousand = 0.0;
  Series loop;
};

struct BandRow {
  std::string surface;
  std::string band;
  std::size_t num_clean = 0;
  std::map<std::string, Series> noise;
};

struct Tables {
  std::vector<Row> rows;
  std::vector<BandRow> bands;
};

Spots of_levels(const Spots& spots, std::pair<int, int> band) {
  Spots result;
  std::copy_if(spots.begin(), spots.end(), std::back_inserter(result),
               [&](Spot s) { return s.level >= band.first && s.level <= band.second; });
  return result;
}

// A rotation that is no symmetry of any grid.
Mesh rotated(const Mesh& mesh) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.7).normalized();
  const Eigen::Matrix3d R = Eigen::AngleAxisd(1.1, axis).toRotationMatrix();
  return {mesh.points * R.transpose(), mesh.triangles};
}

Mesh scaled(const Mesh& mesh, double factor) { return {mesh.points * factor, mesh.triangles}; }

// CPU seconds on one thread: the median of three runs.
std::map<Detector, double> clean_seconds(const Surface& surface, bool with_peers) {
  const int threads = dupin::thread_count();
  dupin::set_thread_count(1);
  std::map<Detector, std::vector<double>> all;
  for (int run = 0; run < 3; ++run) {
    for (const auto& [detector, seconds] :
         detect(surface.mesh, surface.is_guarded, 0, surface.edge, with_peers).seconds) {
      all[detector].push_back(seconds);
    }
  }
  dupin::set_thread_count(threads);
  std::map<Detector, double> median;
  for (auto& [detector, seconds] : all) {
    std::sort(seconds.begin(), seconds.end());
    median[detector] = seconds[1];
  }
  return median;
}

void add_noise_columns(const Surface& surface, const Detection& clean, int seeds, bool with_peers,
                       const std::vector<DetectorName>& detectors, Tables& tables,
                       std::size_t first_row, std::size_t first_band) {
  for (const Condition& condition : kNoises) {
    for (int seed = 0; seed < seeds; ++seed) {
      dupin::NoiseOptions noise;
      noise.percent = condition.percent;
      noise.model = condition.model;
      noise.seed = kSeed + static_cast<std::uint64_t>(seed);
      const Mesh mesh = dupin::add_noise(surface.mesh, noise).mesh;
      const Detection changed = detect(mesh, surface.is_guarded, 0, surface.edge, with_peers);
      for (std::size_t i = 0; i < detectors.size(); ++i) {
        const Spots& spots = changed.spots.at(detectors[i].detector);
        tables.rows[first_row + i].noise[condition.name].add(
            found_again(surface, clean.spots.at(detectors[i].detector), surface.mesh.points, spots,
                        [](Spot, Spot) { return true; }),
            spots.size());
      }
      const Spots& spots = changed.spots.at(Detector::space_scale);
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        tables.bands[first_band + b].noise[condition.name].add(
            found_again(
                surface, of_levels(clean.spots.at(Detector::space_scale), kBands[b]),
                surface.mesh.points, spots,
                [](Spot x, Spot y) { return std::abs(x.level - y.level) <= kLevelTolerance; }),
            of_levels(spots, kBands[b]).size());
      }
    }
  }
}

void evaluate(const Surface& surface, int seeds, bool with_peers, Tables& tables) {
  std::vector<DetectorName> detectors(std::begin(kOwnDetectors), std::end(kOwnDetectors));
#ifdef DUPIN_PEER_PCL_KEYPOINTS
  if (with_peers) detectors.insert(detectors.end(), std::begin(kPeers), std::end(kPeers));
#endif
  const auto run = [&](const Mesh& mesh, const std::vector<std::uint8_t>& guard, int shift,
                       double edge) { return detect(mesh, guard, shift, edge, with_peers); };
  const Detection clean = run(surface.mesh, surface.is_guarded, 0, surface.edge);
  const Detection turned = run(rotated(surface.mesh), surface.is_guarded, 0, surface.edge);
  const Detection large =
      run(scaled(surface.mesh, 10.0), surface.is_guarded, 0, 10.0 * surface.edge);
  const Detection small =
      run(scaled(surface.mesh, 1e-3), surface.is_guarded, 0, 1e-3 * surface.edge);
  const Mesh fine = dupin::loop_subdivide(surface.mesh);
  std::vector<std::uint8_t> fine_guard = surface.is_guarded;
  fine_guard.resize(static_cast<std::size_t>(fine.points.rows()), 0);
  const Detection looped = run(fine, fine_guard, kLoopLevels, surface.edge);
  const auto seconds = clean_seconds(surface, with_peers);

  const std::size_t first_row = tables.rows.size();
  const std::size_t first_band = tables.bands.size();
  for (const auto& [detector, name] : detectors) {
    const Spots& spots = clean.spots.at(detector);
    Row row;
    row.surface = surface.name;
    row.detector = name;
    row.num_clean = spots.size();
    row.chance_clean = chance(static_cast<double>(spots.size()), surface);
    row.seconds = seconds.at(detector);
    row.rotation = same_vertices(spots, turned.spots.at(detector));
    row.times_ten = same_vertices(spots, large.spots.at(detector));
    row.by_thousand = same_vertices(spots, small.spots.at(detector));
    row.loop.add(found_again(surface, spots, fine.points, looped.spots.at(detector),
                             [](Spot, Spot) { return true; }),
                 looped.spots.at(detector).size());
    tables.rows.push_back(std::move(row));
  }
  for (const auto& band : kBands) {
    tables.bands.push_back({surface.name,
                            std::to_string(band.first) + "-" + std::to_string(band.second),
                            of_levels(clean.spots.at(Detector::space_scale), band).size(),
                            {}});
  }
  add_noise_columns(surface, clean, seeds, with_peers, detectors, tables, first_row, first_band);
}

// ---- surfaces ------------------------------------------------------------------------------

Surface make_surface(std::string name, Mesh mesh, std::vector<std::uint8_t> is_guarded) {
  Surface surface{std::move(name), std::move(mesh), std::move(is_guarded)};
  const auto topology = dupin::compute_topology(surface.mesh.triangles, surface.mesh.points.rows());
  surface.edge = dupin::mean_edge_length(surface.mesh.points, topology.ring);
  surface.area = dupin::surface_area(surface.mesh);
  return surface;
}

Surface read(const std::string& path) {
  dupin::HealedSurface healed = dupin::heal(dupin::read_surface(path).mesh);
  return make_surface(std::filesystem::path(path).stem().string(), std::move(healed.mesh),
                      std::move(healed.is_guarded));
}

Surface bumpy_sphere() {
  return make_surface("bumpy sphere",
                      dupin::make_bumpy_sphere(1.0, 20'000, {40, 0.1, 0.12, 1}).surface.mesh, {});
}

// ---- output --------------------------------------------------------------------------------

std::string fixed(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  return std::isnan(value) ? "-" : text;
}

std::string cell(const Series& series) {
  if (series.is_empty()) return "-";
  std::string text = fixed(series.mean(), 3);
  if (series.standard_error() > 0.0) text += " +- " + fixed(series.standard_error(), 3);
  return text + " (" + fixed(series.chance(), 2) + "; " + fixed(series.count(), 0) + ")";
}

std::string noise_headers() {
  std::string text;
  for (const Condition& condition : kNoises) text += std::string(" ") + condition.name + " |";
  return text;
}

std::string markdown(const Tables& tables, int seeds) {
  std::ostringstream out;
  out << "Found again within " << kReach << " mean edges: share +- standard error over " << seeds
      << " seeds (chance; number of keypoints then). Rotation and scaling: share of keypoints at "
         "exactly the same vertex and level.\n\n"
      << "| surface | detector | n | chance |" << noise_headers()
      << " rotation | x 10 | x 1/1000 | Loop | CPU s |\n"
      << "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Row& row : tables.rows) {
    out << "| " << row.surface << " | " << row.detector << " | " << row.num_clean << " | "
        << fixed(row.chance_clean, 3) << " |";
    for (const Condition& noise : kNoises) out << ' ' << cell(row.noise.at(noise.name)) << " |";
    out << ' ' << fixed(row.rotation, 3) << " | " << fixed(row.times_ten, 3) << " | "
        << fixed(row.by_thousand, 3) << " | " << cell(row.loop) << " | " << fixed(row.seconds, 3)
        << " |\n";
  }
  out << "\nSpace-scale rule by level: a keypoint is found again when one within "
      << kLevelTolerance << " levels is near enough.\n\n"
      << "| surface | levels | n |" << noise_headers() << "\n|---|---|---|---|---|---|---|\n";
  for (const BandRow& row : tables.bands) {
    out << "| " << row.surface << " | " << row.band << " | " << row.num_clean << " |";
    for (const Condition& noise : kNoises) out << ' ' << cell(row.noise.at(noise.name)) << " |";
    out << '\n';
  }
  return out.str();
}

std::string json_string(const std::string& text) { return '"' + dupin::escaped(text) + '"'; }

std::string json_number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return std::isfinite(value) ? text : "null";
}

std::string json_series(const Series& series) {
  if (series.is_empty()) return "null";
  return "{\"refound\": " + json_number(series.mean()) +
         ", \"standard_error\": " + json_number(series.standard_error()) +
         ", \"chance\": " + json_number(series.chance()) +
         ", \"n\": " + json_number(series.count()) + "}";
}

std::string json_noise(const std::map<std::string, Series>& noise) {
  std::string text;
  for (const Condition& condition : kNoises) {
    text += (text.empty() ? "" : ", ") + json_string(condition.name) + ": " +
            json_series(noise.at(condition.name));
  }
  return "{" + text + "}";
}

std::string json(const Tables& tables, int seeds) {
  std::ostringstream out;
  out << "{\"reach_edges\": " << kReach << ", \"seeds\": " << seeds << ",\n \"rows\": [";
  const char* separator = "\n  ";
  for (const Row& row : tables.rows) {
    out << separator << "{\"surface\": " << json_string(row.surface)
        << ", \"detector\": " << json_string(row.detector) << ", \"n\": " << row.num_clean
        << ", \"chance\": " << json_number(row.chance_clean)
        << ", \"noise\": " << json_noise(row.noise)
        << ", \"rotation\": " << json_number(row.rotation)
        << ", \"times_ten\": " << json_number(row.times_ten)
        << ", \"by_thousand\": " << json_number(row.by_thousand)
        << ", \"loop\": " << json_series(row.loop)
        << ", \"cpu_seconds\": " << json_number(row.seconds) << "}";
    separator = ",\n  ";
  }
  out << "],\n \"space_scale_by_level\": [";
  separator = "\n  ";
  for (const BandRow& row : tables.bands) {
    out << separator << "{\"surface\": " << json_string(row.surface)
        << ", \"levels\": " << json_string(row.band) << ", \"n\": " << row.num_clean
        << ", \"noise\": " << json_noise(row.noise) << "}";
    separator = ",\n  ";
  }
  out << "]}\n";
  return out.str();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Repeatability of keypoints under noise, rotation, scaling and subdivision"};
  std::string directory;
  std::vector<std::string> paths;
  std::string json_path;
  int seeds = 5;
  int threads = 2;
  bool without_peers = false;
  app.add_option("--surfaces", directory,
                 "Folder with armadillo, bunny00, refined_elephant (.off)");
  app.add_option("FILE", paths, "More surfaces");
  app.add_option("--seeds", seeds, "Draws of every noise")->check(CLI::Range(1, 1000));
  app.add_option("--threads", threads, "Threads (figures do not depend on it)");
  app.add_option("--json", json_path, "Also write the figures here");
  app.add_flag("--no-peers", without_peers, "Leave PCL out");
  CLI11_PARSE(app, argc, argv);
  try {
    dupin::set_thread_count(threads);
    std::vector<Surface> surfaces;
    if (directory.empty()) {
      std::cerr << "no --surfaces DIR: armadillo, bunny00 and refined_elephant are left out\n";
    } else {
      for (const char* name : {"armadillo", "bunny00", "refined_elephant"}) {
        surfaces.push_back(read(directory + "/" + name + ".off"));
      }
    }
    surfaces.push_back(bumpy_sphere());
    for (const std::string& path : paths) surfaces.push_back(read(path));
    Tables tables;
    for (const Surface& surface : surfaces) {
      std::cerr << surface.name << ": " << surface.mesh.points.rows() << " vertices\n";
      evaluate(surface, seeds, !without_peers, tables);
    }
    std::cout << markdown(tables, seeds);
    if (!json_path.empty()) dupin::write_file_atomically(json_path, json(tables, seeds));
  } catch (const dupin::Error& error) {
    std::cerr << error.diagnostic() << '\n';
    return static_cast<int>(error.errc());
  }
  return 0;
}
