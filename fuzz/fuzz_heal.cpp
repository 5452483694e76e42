#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/mesh/heal.h"
#include "tests/support/heal_invariants.h"

// The input is a surface of at most 64 vertices on few snapped places, so that repeated, collinear
// and crossing things abound: a byte each for the number of vertices, the scale and the grid, three
// a vertex, then faces as a byte for the size and one an index. heal() refuses with a code or keeps
// every promise, also the second time.
namespace dupin::fuzz {
namespace {

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

PolygonMesh surface_of(Bytes bytes) {
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

void require_kept(const std::string& broken) {
  if (broken.empty()) return;
  std::fprintf(stderr, "broken promise: %s\n", broken.c_str());
  std::abort();
}

}  // namespace
}  // namespace dupin::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const dupin::PolygonMesh input = dupin::fuzz::surface_of({data, size});
  try {
    const dupin::HealedSurface healed = dupin::heal(input);
    dupin::fuzz::require_kept(dupin::test::broken_invariant(input, healed));
    dupin::fuzz::require_kept(dupin::test::broken_idempotence(healed));
  } catch (const dupin::AnalysisError&) {
    return 0;
  }
  return 0;
}
