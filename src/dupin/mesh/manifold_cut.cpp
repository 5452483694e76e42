#include "dupin/mesh/manifold_cut.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <utility>

#include "dupin/mesh/edge_table.h"

namespace dupin {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

// Sets of integers with their smallest member as representative.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int32_t find(int32_t i) {
    while (parent_[static_cast<size_t>(i)] != i) {
      int32_t& up = parent_[static_cast<size_t>(i)];
      up = parent_[static_cast<size_t>(up)];
      i = up;
    }
    return i;
  }
  void join(int32_t a, int32_t b) {
    a = find(a);
    b = find(b);
    if (a != b) parent_[static_cast<size_t>(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<int32_t> parent_;
};

std::uint64_t mix(std::uint64_t z) {
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

Triangles renamed(const Triangles& triangles, const std::vector<int32_t>& name) {
  Triangles result(triangles.rows(), 3);
  for (Index i = 0; i < triangles.size(); ++i) {
    result.data()[i] = name[static_cast<size_t>(triangles.data()[i])];
  }
  return result;
}

// Joins the ends of every edge of `by_place` whose two faces do not share it in `triangles`.
std::vector<int32_t> merged_names(const Triangles& triangles, const Triangles& placed,
                                  const EdgeTable& by_place, size_t num_vertices) {
  DisjointSets sets(num_vertices);
  for (int32_t e = 0; e < by_place.num_edges(); ++e) {
    if (by_place.num_faces(e) != 2) continue;
    const int32_t g = by_place.begin(e)[0];
    const int32_t h = by_place.begin(e)[1];
    const bool same_way = tail(placed, g) == tail(placed, h);
    sets.join(tail(triangles, g), same_way ? tail(triangles, h) : head(triangles, h));
    sets.join(head(triangles, g), same_way ? head(triangles, h) : tail(triangles, h));
  }
  std::vector<int32_t> name(num_vertices);
  for (size_t v = 0; v < num_vertices; ++v) name[v] = sets.find(static_cast<int32_t>(v));
  return name;
}

// Corner of triangle `h / 3` at the tail, and at the head, of half-edge h.
int32_t corner_at_tail(int32_t h) { return h; }
int32_t corner_at_head(int32_t h) { return h / 3 * 3 + (h % 3 + 1) % 3; }

// Corners that share a vertex after the cut.
DisjointSets corner_fans(const Triangles& triangles, const EdgeTable& edges) {
  DisjointSets fans(static_cast<size_t>(triangles.size()));
  for (int32_t e = 0; e < edges.num_edges(); ++e) {
    if (edges.num_faces(e) != 2) continue;
    const int32_t g = edges.begin(e)[0];
    const int32_t h = edges.begin(e)[1];
    const bool same_way = tail(triangles, g) == tail(triangles, h);
    fans.join(corner_at_tail(g), same_way ? corner_at_tail(h) : corner_at_head(h));
    fans.join(corner_at_head(g), same_way ? corner_at_head(h) : corner_at_tail(h));
  }
  return fans;
}

// Counts edges with more than two faces and marks their ends (in merged names).
std::vector<std::uint8_t> mark_bad_edges(const Triangles& merged, const EdgeTable& edges,
                                         const EdgeTable& by_place, size_t num_vertices,
                                         ManifoldCut& cut) {
  std::vector<std::uint8_t> is_bad(num_vertices, 0);
  for (int32_t e = 0; e < by_place.num_edges(); ++e) {
    const int32_t* first = by_place.begin(e);
    const int32_t* last = first + by_place.num_faces(e);
    if (last - first <= 2) continue;
    // Sheets that cross along edges of their own are two sheets, not a bad edge.
    const bool all_paired = std::all_of(first, last, [&](int32_t h) {
      return edges.num_faces(edges.edge[static_cast<size_t>(h)]) == 2;
    });
    if (all_paired) continue;
    ++cut.num_bad_edges;
    const int32_t lowest_face = *first / 3;
    if (cut.first_bad_face < 0 || lowest_face < cut.first_bad_face) {
      cut.first_bad_face = lowest_face;
    }
    for (const int32_t* h = first; h != last; ++h) {
      is_bad[static_cast<size_t>(tail(merged, *h))] = 1;
      is_bad[static_cast<size_t>(head(merged, *h))] = 1;
    }
  }
  return is_bad;
}

}  // namespace

std::vector<int32_t> find_coincident(const Points& points) {
  const auto num_vertices = static_cast<int32_t>(points.rows());
  std::vector<std::pair<std::uint64_t, int32_t>> order(static_cast<size_t>(num_vertices));
  for (int32_t v = 0; v < num_vertices; ++v) {
    std::uint64_t hash = 0;
    for (Index k = 0; k < 3; ++k) {
      const double place = points(v, k) + 0.0;  // -0 + 0 is 0
      std::uint64_t bits = 0;
      std::memcpy(&bits, &place, sizeof bits);  // older libc++ has no std::bit_cast
      hash = mix(hash + bits);
    }
    order[static_cast<size_t>(v)] = {hash, v};
  }
  // Places decide where hashes collide, so that a hostile file cannot make this quadratic.
  const auto place_order = [&](int32_t a, int32_t b) {
    for (Index k = 0; k < 3; ++k) {
      if (points(a, k) != points(b, k)) return points(a, k) < points(b, k) ? -1 : 1;
    }
    return 0;
  };
  std::sort(order.begin(), order.end(), [&](const auto& a, const auto& b) {
    if (a.first != b.first) return a.first < b.first;
    const int sign = place_order(a.second, b.second);
    return sign != 0 ? sign < 0 : a.second < b.second;
  });
  std::vector<int32_t> place(static_cast<size_t>(num_vertices));
  int32_t current = -1;
  for (const auto& [hash, v] : order) {
    if (current < 0 || place_order(current, v) != 0) current = v;
    place[static_cast<size_t>(v)] = current;
  }
  return place;
}

ManifoldCut cut_to_manifold(const Triangles& triangles, const std::vector<int32_t>& place) {
  const size_t num_vertices = place.size();
  const auto num_given = static_cast<Index>(num_vertices);
  bool has_coincident = false;
  for (size_t v = 0; v < num_vertices; ++v) {
    has_coincident = has_coincident || place[v] != static_cast<int32_t>(v);
  }
  ManifoldCut cut;
  std::vector<int32_t> name(num_vertices);
  std::iota(name.begin(), name.end(), 0);
  EdgeTable by_place = compute_edge_table(renamed(triangles, place), num_given);
  EdgeTable own;
  if (has_coincident) {
    name = merged_names(triangles, renamed(triangles, place), by_place, num_vertices);
    own = compute_edge_table(renamed(triangles, name), num_given);
  }
  const Triangles merged = renamed(triangles, name);
  const EdgeTable& edges = has_coincident ? own : by_place;
  cut.num_edges = edges.num_edges();
  const std::vector<std::uint8_t> on_bad_edge =
      mark_bad_edges(merged, edges, by_place, num_vertices, cut);

  // One new vertex a fan, sorted by the merged vertex and then by the first corner.
  DisjointSets fans = corner_fans(merged, edges);
  const auto num_corners = static_cast<int32_t>(merged.size());
  std::vector<std::pair<int32_t, int32_t>> order;  // (merged vertex, first corner)
  for (int32_t c = 0; c < num_corners; ++c) {
    if (fans.find(c) == c) order.emplace_back(merged.data()[c], c);
  }
  std::sort(order.begin(), order.end());
  std::vector<int32_t> new_of_corner(static_cast<size_t>(num_corners));
  std::vector<int32_t> first_new(num_vertices, -1);  // of a merged vertex
  cut.source.resize(order.size());
  cut.is_cut.assign(order.size(), 0);
  for (size_t i = 0; i < order.size();) {
    const int32_t v = order[i].first;
    size_t last = i;
    while (last < order.size() && order[last].first == v) ++last;
    const bool is_split = last - i > 1;
    const bool is_bad = on_bad_edge[static_cast<size_t>(v)] != 0;
    if (is_split && !is_bad) {
      ++cut.num_bad_vertices;
      if (cut.first_bad_vertex < 0) cut.first_bad_vertex = v;
    }
    ++cut.num_vertices;
    first_new[static_cast<size_t>(v)] = static_cast<int32_t>(i);
    for (; i < last; ++i) {
      new_of_corner[static_cast<size_t>(order[i].second)] = static_cast<int32_t>(i);
      cut.source[i] = v;
      cut.is_cut[i] = is_split || is_bad ? 1 : 0;
    }
  }
  cut.triangles.resize(triangles.rows(), 3);
  cut.first.assign(num_vertices, -1);
  for (int32_t c = 0; c < num_corners; ++c) {
    const int32_t vertex = new_of_corner[static_cast<size_t>(fans.find(c))];
    cut.triangles.data()[c] = vertex;
    int32_t& first = cut.first[static_cast<size_t>(triangles.data()[c])];
    if (first < 0 || vertex < first) first = vertex;
  }
  for (size_t v = 0; v < num_vertices; ++v) {
    if (cut.first[v] < 0 || name[v] == static_cast<int32_t>(v)) continue;
    ++cut.num_merged;
    if (cut.first_merged < 0) cut.first_merged = static_cast<int32_t>(v);
  }
  return cut;
}

}  // namespace dupin
