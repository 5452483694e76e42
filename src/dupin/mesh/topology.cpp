#include "dupin/mesh/topology.h"

#include <algorithm>
#include <limits>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

// Directed edges of all triangles bucketed by their first vertex (counting sort, no per-vertex
// list).
void bucket_edges(const Triangles& triangles, Index num_vertices, std::vector<int32_t>& offset,
                  std::vector<int32_t>& target) {
  offset.assign(static_cast<size_t>(num_vertices) + 1, 0);
  const Index num_faces = triangles.rows();
  const auto visit = [&](auto&& action) {
    for (Index f = 0; f < num_faces; ++f) {
      for (Index k = 0; k < 3; ++k) {
        const int32_t a = triangles(f, k);
        const int32_t b = triangles(f, (k + 1) % 3);
        if (a == b) continue;
        action(a, b);
        action(b, a);
      }
    }
  };
  visit([&](int32_t a, int32_t) { ++offset[static_cast<size_t>(a) + 1]; });
  for (size_t v = 1; v < offset.size(); ++v) offset[v] += offset[v - 1];
  target.resize(static_cast<size_t>(offset.back()));
  std::vector<int32_t> cursor(offset.begin(), offset.end() - 1);
  visit([&](int32_t a, int32_t b) {
    target[static_cast<size_t>(cursor[static_cast<size_t>(a)]++)] = b;
  });
}

}  // namespace

void require_indexable(Index num_faces) {
  constexpr Index kMostFaces = std::numeric_limits<int32_t>::max() / 6;
  if (num_faces <= kMostFaces) return;
  throw Error(Errc::over_limit, "E_TOO_LARGE",
              std::to_string(num_faces) + " faces are more than " + std::to_string(kMostFaces), {},
              "a smaller surface, or one part after another");
}

MeshTopology compute_topology(const Triangles& triangles, Index num_vertices) {
  require_indexable(triangles.rows());
  if (triangles.size() > 0 && (triangles.minCoeff() < 0 || triangles.maxCoeff() >= num_vertices)) {
    throw InvalidArgument("triangles: an index is outside 0 to " +
                          std::to_string(num_vertices - 1));
  }
  MeshTopology topology;
  topology.vertex_faces.assign(static_cast<size_t>(num_vertices), 0);
  topology.is_boundary.assign(static_cast<size_t>(num_vertices), 0);
  for (Index f = 0; f < triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) ++topology.vertex_faces[static_cast<size_t>(triangles(f, k))];
  }

  std::vector<int32_t> bucket;
  std::vector<int32_t> target;
  bucket_edges(triangles, num_vertices, bucket, target);

  Adjacency& ring = topology.ring;
  ring.offset.assign(static_cast<size_t>(num_vertices) + 1, 0);
  ring.neighbor.reserve(target.size() / 2 + 1);
  topology.edge_faces.reserve(target.size() / 2 + 1);
  Index directed = 0;
  Index directed_boundary = 0;
  Index directed_nonmanifold = 0;
  for (Index v = 0; v < num_vertices; ++v) {
    const auto first = target.begin() + bucket[static_cast<size_t>(v)];
    const auto last = target.begin() + bucket[static_cast<size_t>(v) + 1];
    std::sort(first, last);
    for (auto it = first; it != last;) {
      auto run = it;
      while (run != last && *run == *it) ++run;
      const auto faces = static_cast<int32_t>(run - it);
      ring.neighbor.push_back(*it);
      topology.edge_faces.push_back(faces);
      ++directed;
      if (faces == 1) {
        ++directed_boundary;
        topology.is_boundary[static_cast<size_t>(v)] = 1;
      }
      if (faces > 2) ++directed_nonmanifold;
      it = run;
    }
    ring.offset[static_cast<size_t>(v) + 1] = static_cast<int32_t>(ring.neighbor.size());
  }
  topology.num_edges = directed / 2;
  topology.num_boundary_edges = directed_boundary / 2;
  topology.num_nonmanifold_edges = directed_nonmanifold / 2;
  return topology;
}

Components find_components(const Adjacency& ring) {
  const Index num_vertices = ring.num_vertices();
  Components components;
  components.label.assign(static_cast<size_t>(num_vertices), -1);
  std::vector<int32_t> stack;
  for (Index seed = 0; seed < num_vertices; ++seed) {
    if (components.label[static_cast<size_t>(seed)] >= 0) continue;
    const auto label = static_cast<int32_t>(components.count++);
    components.label[static_cast<size_t>(seed)] = label;
    stack.push_back(static_cast<int32_t>(seed));
    while (!stack.empty()) {
      const int32_t v = stack.back();
      stack.pop_back();
      for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        int32_t& other = components.label[static_cast<size_t>(*j)];
        if (other >= 0) continue;
        other = label;
        stack.push_back(*j);
      }
    }
  }
  return components;
}

double mean_edge_length(const Points& points, const Adjacency& ring) {
  double sum = 0.0;
  Index count = 0;
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      if (*j <= v) continue;
      sum += (points.row(v) - points.row(*j)).norm();
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

}  // namespace dupin
