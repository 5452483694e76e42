#include "dupin/mesh/orientation.h"

#include <cstddef>

namespace dupin {

Orientation orient_components(const Triangles& triangles, const EdgeTable& edges,
                              const std::vector<std::uint8_t>& votes) {
  using std::int32_t;
  using std::size_t;
  const auto num_faces = static_cast<size_t>(triangles.rows());
  Orientation result;
  result.flip.assign(num_faces, 0);
  std::vector<std::uint8_t> is_seen(num_faces, 0);
  std::vector<int32_t> component;  // in the order of the flood, which is also its queue
  for (size_t seed = 0; seed < num_faces; ++seed) {
    if (is_seen[seed] != 0) continue;
    is_seen[seed] = 1;
    component.assign(1, static_cast<int32_t>(seed));
    std::int64_t votes_as_is[2] = {0, 0};
    for (size_t at = 0; at < component.size(); ++at) {
      const int32_t f = component[at];
      const std::uint8_t flip_f = result.flip[static_cast<size_t>(f)];
      votes_as_is[flip_f] += votes[static_cast<size_t>(f)];
      for (int32_t h = 3 * f; h < 3 * f + 3; ++h) {
        const int32_t e = edges.edge[static_cast<size_t>(h)];
        if (edges.num_faces(e) != 2) continue;
        const int32_t other = edges.begin(e)[0] == h ? edges.begin(e)[1] : edges.begin(e)[0];
        const auto g = static_cast<size_t>(other / 3);
        // Neighbours agree when they run along their edge in opposite directions.
        const bool agrees = tail(triangles, h) != tail(triangles, other);
        const auto flip_g = static_cast<std::uint8_t>(agrees ? flip_f : 1 - flip_f);
        if (is_seen[g] != 0) {
          if (result.flip[g] != flip_g && result.conflict < 0) {
            result.conflict = static_cast<int32_t>(g);
          }
          continue;
        }
        is_seen[g] = 1;
        result.flip[g] = flip_g;
        component.push_back(static_cast<int32_t>(g));
      }
    }
    if (votes_as_is[1] > votes_as_is[0]) {
      for (const int32_t f : component) {
        std::uint8_t& flip = result.flip[static_cast<size_t>(f)];
        flip = static_cast<std::uint8_t>(1 - flip);
      }
    }
  }
  return result;
}

}  // namespace dupin
