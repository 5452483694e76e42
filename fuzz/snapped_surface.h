#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dupin/mesh/polygon_mesh.h"

namespace dupin::fuzz {

/// The bytes of one input, in turn; zeros after their end.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  bool empty() const { return at_ >= size_; }
  unsigned next() { return empty() ? 0U : data_[at_++]; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

/// A surface of at most 64 vertices on few snapped places, so that repeated, collinear and crossing
/// things abound: a byte each for the number of vertices, the scale and the grid, three a vertex,
/// then faces as a byte for the size and one an index.
inline PolygonMesh snapped_surface(Bytes& bytes) {
  PolygonMesh mesh;
  const unsigned num_vertices = 1 + bytes.next() % 64;
  const double unit = std::ldexp(1.0, static_cast<int>(bytes.next()) * 8 - 1020);
  const unsigned grid = 2 + bytes.next() % 15;
  mesh.points.resize(num_vertices, 3);
  for (Eigen::Index i = 0; i < mesh.points.size(); ++i) {
    mesh.points.data()[i] = unit * (bytes.next() % grid);
  }
  std::vector<std::int32_t> index;
  std::vector<std::int32_t> offset{0};
  while (!bytes.empty()) {
    // Mostly triangles, sometimes anything up to 15 corners.
    const unsigned kind = bytes.next();
    const unsigned size = kind < 192 ? 3 : kind % 16;
    for (unsigned k = 0; k < size; ++k) {
      index.push_back(static_cast<std::int32_t>(bytes.next() % num_vertices));
    }
    offset.push_back(static_cast<std::int32_t>(index.size()));
  }
  mesh.face_index =
      Eigen::Map<PolygonMesh::Indices>(index.data(), static_cast<Eigen::Index>(index.size()));
  mesh.face_offset =
      Eigen::Map<PolygonMesh::Indices>(offset.data(), static_cast<Eigen::Index>(offset.size()));
  return mesh;
}

}  // namespace dupin::fuzz
