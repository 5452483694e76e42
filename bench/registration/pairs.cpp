#include "bench/registration/pairs.h"

#include <Eigen/Geometry>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <utility>

#include "dupin/base/random.h"
#include "dupin/io/file.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"

namespace dupin::bench {
namespace {

constexpr int kOverlaps[] = {30, 50, 70};
constexpr int kNoises[] = {0, 20, 50};

// Distinct for each case of a draw, so that no two share a cut or a pose.
std::uint64_t seed_of(std::uint64_t draw, std::uint64_t family, std::uint64_t index) {
  Rng rng((draw << 32U) + (family << 24U) + index);
  return rng.next();
}

Mesh unit_diameter(Mesh mesh) {
  const Eigen::RowVector3d low = mesh.points.colwise().minCoeff();
  const Eigen::RowVector3d high = mesh.points.colwise().maxCoeff();
  mesh.points = (mesh.points.rowwise() - 0.5 * (low + high)) / (high - low).norm();
  return mesh;
}

Mesh bumpy(std::uint64_t seed, const Eigen::RowVector3d& axes) {
  Mesh mesh = make_bumpy_sphere(1.0, 16'000, {40, 0.1, 0.12, seed}).surface.mesh;
  mesh.points.array().rowwise() *= axes.array();
  return mesh;
}

std::vector<NamedSurface> distinct_objects(const std::vector<NamedSurface>& surfaces) {
  std::vector<NamedSurface> objects = surfaces;
  for (std::uint64_t seed = 2; seed <= 7; ++seed) {
    objects.push_back({"bumpy" + std::to_string(seed), bumpy(seed, {1.0, 1.0, 1.0})});
  }
  for (std::uint64_t seed = 8; seed <= 11; ++seed) {
    objects.push_back({"ellipsoid" + std::to_string(seed), bumpy(seed, {1.0, 0.8, 0.6})});
  }
  objects.push_back({"torus", make_torus(1.0, 0.4, 16'000).mesh});
  for (NamedSurface& object : objects) object.mesh = unit_diameter(std::move(object.mesh));
  return objects;
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

std::string json_of(const NamedPair& named) {
  const test::ScanPair& pair = named.pair;
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = pair.truth.scale * pair.truth.rotation;
  T.topRightCorner<3, 1>() = pair.truth.translation;
  std::ostringstream out;
  out << "{\"name\": \"" << named.name << "\", \"surface\": \"" << named.surface
      << "\", \"overlap_percent\": " << named.overlap_percent
      << ", \"noise_percent\": " << named.noise_percent << ", \"overlap\": " << number(pair.overlap)
      << ", \"diameter\": " << number(pair.diameter) << ", \"edge\": " << number(pair.edge)
      << ", \"scale\": " << number(pair.truth.scale) << ", \"T_fixed_moving\": [";
  for (int r = 0; r < 4; ++r) {
    out << (r == 0 ? "[" : ", [");
    for (int c = 0; c < 4; ++c) out << (c == 0 ? "" : ", ") << number(T(r, c));
    out << "]";
  }
  out << "]}";
  return out.str();
}

void write_ply(const std::string& path, const Points& points, const Triangles& triangles) {
  SurfaceOutput output;
  output.points = points;
  output.triangles = triangles;
  write_surface(path, output, SurfaceFormat::ply_binary);
}

}  // namespace

std::vector<NamedSurface> registration_surfaces(const std::string& directory) {
  std::vector<NamedSurface> surfaces;
  if (!directory.empty()) {
    // As CGAL calls them, or as `./run demo` does.
    for (const auto& [name, other] : {std::pair{"armadillo", "armadillo"},
                                      {"bunny00", "bunny"},
                                      {"refined_elephant", "elephant"}}) {
      const bool is_there = std::filesystem::exists(directory + "/" + name + ".off");
      const std::string file = directory + "/" + (is_there ? name : other) + ".off";
      surfaces.push_back({name, heal(read_surface(file).mesh).mesh});
    }
  }
  surfaces.push_back({"bumpy", bumpy(1, {1.0, 1.0, 1.0})});
  return surfaces;
}

std::vector<NamedPair> overlap_pairs(const std::vector<NamedSurface>& surfaces, double scale_range,
                                     std::uint64_t draw) {
  std::vector<NamedPair> pairs;
  for (const NamedSurface& surface : surfaces) {
    for (const int overlap : kOverlaps) {
      for (const int noise : kNoises) {
        test::ScanPairOptions options;
        options.overlap = overlap / 100.0;
        options.noise_percent = noise;
        options.scale_range = scale_range;
        options.seed = seed_of(draw, scale_range > 1.0 ? 1 : 0, pairs.size());
        pairs.push_back({surface.name + "_" + std::to_string(overlap) + "_" +
                             std::to_string(noise) + (scale_range > 1.0 ? "_scaled" : ""),
                         surface.name, overlap, noise, make_scan_pair(surface.mesh, options)});
      }
    }
  }
  return pairs;
}

std::vector<NamedPair> different_pairs(const std::vector<NamedSurface>& surfaces, std::size_t count,
                                       std::uint64_t draw) {
  const std::vector<NamedSurface> objects = distinct_objects(surfaces);
  std::vector<NamedPair> pairs;
  // By growing distance in the list, so that few pairs too are of many kinds.
  for (std::size_t step = 1; step < objects.size() && pairs.size() < count; ++step) {
    for (std::size_t i = 0; i + step < objects.size() && pairs.size() < count; ++i) {
      test::ScanPairOptions options;
      options.overlap = 0.57;  // parts of 70 % of the area
      options.seed = seed_of(draw, 2, 2 * pairs.size());
      test::ScanPair pair = make_scan_pair(objects[i].mesh, options);
      options.seed = seed_of(draw, 2, 2 * pairs.size() + 1);
      pair.fixed = make_scan_pair(objects[i + step].mesh, options).fixed;
      pair.overlap = 0.0;
      const std::string name = objects[i].name + "-" + objects[i + step].name;
      pairs.push_back({name, name, 0, 0, std::move(pair)});
    }
  }
  return pairs;
}

std::vector<NamedPair> mirrored_pairs(const std::vector<NamedSurface>& surfaces,
                                      std::uint64_t draw) {
  std::vector<NamedPair> pairs;
  for (const NamedSurface& surface : surfaces) {
    test::ScanPairOptions options;
    options.overlap = 0.7;
    options.seed = seed_of(draw, 3, pairs.size());
    test::ScanPair pair = make_scan_pair(surface.mesh, options);
    pair.moving = test::mirrored(pair.moving);
    pairs.push_back({surface.name + "_mirrored", surface.name, 70, 0, std::move(pair)});
  }
  return pairs;
}

void write_pairs(const std::string& directory, const std::vector<NamedPair>& pairs) {
  std::filesystem::create_directories(directory);
  std::string document = "[";
  for (const NamedPair& named : pairs) {
    const std::string stem = directory + "/" + named.name;
    write_ply(stem + "_moving.ply", named.pair.moving.points, named.pair.moving.triangles);
    write_ply(stem + "_fixed.ply", named.pair.fixed.points, Triangles(0, 3));
    write_ply(stem + "_fixed_mesh.ply", named.pair.fixed.points, named.pair.fixed.triangles);
    document += (document == "[" ? "\n " : ",\n ") + json_of(named);
  }
  write_file_atomically(directory + "/pairs.json", document + "\n]\n");
}

}  // namespace dupin::bench
