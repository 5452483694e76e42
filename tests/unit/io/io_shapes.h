#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "dupin/io/surface_io.h"

namespace dupin::test {

/// A folder that is gone at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = ::testing::TempDir() + "dupin-io-XXXXXX";
    path_ = ::mkdtemp(pattern.data());
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }
  std::size_t num_entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_),
                                                  std::filesystem::directory_iterator()));
  }

 private:
  std::string path_;
};

inline std::string slurp(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

inline void spit(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

inline std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// A closed surface of 12 vertices and 20 faces whose coordinates need every digit.
inline SurfaceOutput icosahedron() {
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  SurfaceOutput surface;
  surface.points.resize(12, 3);
  surface.points << -1, t, 0, 1, t, 0, -1, -t, 0, 1, -t, 0, 0, -1, t, 0, 1, t, 0, -1, -t, 0, 1, -t,
      t, 0, -1, t, 0, 1, -t, 0, -1, -t, 0, 1;
  surface.points /= std::sqrt(1.0 + t * t);
  surface.triangles.resize(20, 3);
  surface.triangles << 0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10,
      2, 10, 7, 6, 7, 1, 8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2,
      10, 8, 6, 7, 9, 8, 1;
  return surface;
}

/// Equality of everything that a reader returns but its warnings; bits, not values.
inline bool is_same_mesh(const PolygonMesh& a, const PolygonMesh& b) {
  const auto equal = [](const auto& x, const auto& y) {
    using Scalar = typename std::decay_t<decltype(x)>::Scalar;
    return x.rows() == y.rows() && x.cols() == y.cols() &&
           (x.size() == 0 || std::memcmp(x.data(), y.data(),
                                         static_cast<std::size_t>(x.size()) * sizeof(Scalar)) == 0);
  };
  return equal(a.points, b.points) && equal(a.normals, b.normals) &&
         equal(a.face_index, b.face_index) && equal(a.face_offset, b.face_offset);
}

/// What every reader guarantees of every mesh that it returns.
inline ::testing::AssertionResult is_sound(const PolygonMesh& mesh) {
  for (Eigen::Index i = 0; i < mesh.points.size(); ++i) {
    if (!std::isfinite(mesh.points.data()[i])) {
      return ::testing::AssertionFailure() << "point " << i / 3 << " is not finite";
    }
  }
  for (Eigen::Index i = 0; i < mesh.face_index.size(); ++i) {
    if (mesh.face_index[i] < 0 || mesh.face_index[i] >= mesh.points.rows()) {
      return ::testing::AssertionFailure() << "index " << i << " is out of range";
    }
  }
  if (mesh.normals.size() > 0 && mesh.normals.rows() != mesh.points.rows()) {
    return ::testing::AssertionFailure() << "normals for other points";
  }
  if (mesh.face_offset.size() == 0) {
    if (mesh.face_index.size() % 3 != 0) return ::testing::AssertionFailure() << "a broken face";
    return ::testing::AssertionSuccess();
  }
  if (mesh.face_offset[0] != 0 ||
      mesh.face_offset[mesh.face_offset.size() - 1] != mesh.face_index.size()) {
    return ::testing::AssertionFailure() << "offsets do not span the indices";
  }
  for (Eigen::Index i = 1; i < mesh.face_offset.size(); ++i) {
    if (mesh.face_offset[i] < mesh.face_offset[i - 1]) {
      return ::testing::AssertionFailure() << "offset " << i << " falls";
    }
  }
  return ::testing::AssertionSuccess();
}

/// Code of the error that reading `text` under `name` ends in; empty if it is read.
inline std::string code_of(const std::string& text, const std::string& name,
                           const ReadOptions& options = {}) {
  try {
    parse_surface(bytes_of(text), name, options);
    return {};
  } catch (const Error& error) {
    return error.code();
  }
}

}  // namespace dupin::test
