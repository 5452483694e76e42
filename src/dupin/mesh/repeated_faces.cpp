#include "dupin/mesh/repeated_faces.h"

#include <algorithm>
#include <span>
#include <utility>

namespace dupin {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t value) {
  std::uint64_t z = (hash ^ value) + 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

// Places of a polygon from its smallest one on, towards the smaller neighbour: the same for every
// rotation and direction.
std::vector<int32_t> canonical(std::span<const int32_t> face, const std::vector<int32_t>& place) {
  std::vector<int32_t> ring(face.size());
  for (size_t k = 0; k < face.size(); ++k) ring[k] = place[static_cast<size_t>(face[k])];
  std::rotate(ring.begin(), std::min_element(ring.begin(), ring.end()), ring.end());
  if (ring.back() < ring[1]) std::reverse(ring.begin() + 1, ring.end());
  return ring;
}

}  // namespace

std::vector<std::uint8_t> find_repeated_triangles(
    const std::vector<std::array<int32_t, 3>>& triangles, const std::vector<int32_t>& place) {
  const size_t count = triangles.size();
  std::vector<std::array<int32_t, 3>> key(count);
  std::vector<int32_t> bucket(place.size() + 1, 0);
  for (size_t t = 0; t < count; ++t) {
    for (size_t k = 0; k < 3; ++k) key[t][k] = place[static_cast<size_t>(triangles[t][k])];
    std::sort(key[t].begin(), key[t].end());
    ++bucket[static_cast<size_t>(key[t][0]) + 1];
  }
  for (size_t v = 1; v < bucket.size(); ++v) bucket[v] += bucket[v - 1];
  std::vector<int32_t> order(count);
  std::vector<int32_t> cursor(bucket.begin(), bucket.end() - 1);
  for (size_t t = 0; t < count; ++t) {
    order[static_cast<size_t>(cursor[static_cast<size_t>(key[t][0])]++)] = static_cast<int32_t>(t);
  }
  std::vector<std::uint8_t> is_repeated(count, 0);
  for (size_t v = 0; v + 1 < bucket.size(); ++v) {
    const auto first = order.begin() + bucket[v];
    const auto last = order.begin() + bucket[v + 1];
    std::sort(first, last, [&](int32_t a, int32_t b) {
      const auto& ka = key[static_cast<size_t>(a)];
      const auto& kb = key[static_cast<size_t>(b)];
      return ka != kb ? ka < kb : a < b;
    });
    for (auto it = first; it != last && it + 1 != last; ++it) {
      if (key[static_cast<size_t>(*it)] == key[static_cast<size_t>(*(it + 1))]) {
        is_repeated[static_cast<size_t>(*(it + 1))] = 1;
      }
    }
  }
  return is_repeated;
}

std::vector<std::uint8_t> find_repeated_polygons(const PolygonMesh& mesh,
                                                 const std::vector<int32_t>& place) {
  std::vector<std::uint8_t> is_repeated(static_cast<size_t>(mesh.num_faces()), 0);
  if (mesh.face_offset.size() == 0) return is_repeated;
  std::vector<std::pair<std::uint64_t, int32_t>> order;
  for (Index f = 0; f < mesh.num_faces(); ++f) {
    const std::span<const int32_t> face = mesh.face(f);
    if (face.size() <= 3) continue;
    std::uint64_t hash = face.size();
    for (const int32_t v : canonical(face, place)) {
      hash = mixed(hash, static_cast<std::uint64_t>(v));
    }
    order.emplace_back(hash, static_cast<int32_t>(f));
  }
  std::sort(order.begin(), order.end());
  for (size_t i = 1; i < order.size(); ++i) {
    if (order[i].first != order[i - 1].first) continue;
    // Unequal polygons with equal hashes can only hide a repetition, never invent one.
    const bool is_equal = canonical(mesh.face(order[i].second), place) ==
                          canonical(mesh.face(order[i - 1].second), place);
    is_repeated[static_cast<size_t>(order[i].second)] = is_equal ? 1 : 0;
  }
  return is_repeated;
}

}  // namespace dupin
