#include "tests/support/heal_invariants.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "dupin/mesh/topology.h"
#include "dupin/mesh/triangulate.h"

namespace dupin::test {
namespace {

using Eigen::Index;
using std::int32_t;
using std::size_t;

std::string at(const char* what, Index i) { return std::string(what) + " " + std::to_string(i); }

std::string broken_topology(const HealedSurface& healed) {
  const Triangles& triangles = healed.mesh.triangles;
  const Index num_vertices = healed.mesh.points.rows();
  std::map<std::pair<int32_t, int32_t>, int32_t> far;  // directed edge -> third corner
  std::vector<int32_t> faces(static_cast<size_t>(num_vertices), 0);
  std::vector<int32_t> start(static_cast<size_t>(num_vertices), -1);
  for (Index f = 0; f < triangles.rows(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const int32_t a = triangles(f, k);
      const int32_t b = triangles(f, (k + 1) % 3);
      const int32_t c = triangles(f, (k + 2) % 3);
      if (a == b) return at("repeated vertex in triangle", f);
      if (!far.emplace(std::make_pair(a, b), c).second) return at("edge run twice, triangle", f);
      ++faces[static_cast<size_t>(a)];
      start[static_cast<size_t>(a)] = b;
    }
  }
  Index boundary_edges = 0;
  for (const auto& [edge, corner] : far) {
    if (far.count({edge.second, edge.first}) > 0) continue;
    ++boundary_edges;
    start[static_cast<size_t>(edge.first)] = edge.second;  // begin a half-disc at its border
    if (healed.is_guarded[static_cast<size_t>(edge.first)] == 0) {
      return at("unguarded boundary vertex", edge.first);
    }
  }
  if (healed.is_closed != (boundary_edges == 0)) return "is_closed is wrong";
  for (int32_t v = 0; v < num_vertices; ++v) {
    if (faces[static_cast<size_t>(v)] == 0) return at("isolated vertex", v);
    int32_t turned = 0;
    int32_t spoke = start[static_cast<size_t>(v)];
    do {
      const auto it = far.find({v, spoke});
      if (it == far.end()) break;
      spoke = it->second;
      ++turned;
    } while (spoke != start[static_cast<size_t>(v)] && turned <= faces[static_cast<size_t>(v)]);
    if (turned != faces[static_cast<size_t>(v)]) return at("more than one fan at vertex", v);
  }
  const MeshTopology topology = compute_topology(triangles, num_vertices);
  const Index euler = num_vertices - topology.num_edges + triangles.rows();
  const Index components = find_components(topology.ring).count;
  if (components != healed.num_components) return "num_components is wrong";
  if (healed.is_manifold && healed.euler != euler) return "euler is wrong";
  const Index handles_twice = 2 * components - euler - healed.num_boundary_loops;
  if (handles_twice < 0 || handles_twice % 2 != 0) return "V - E + F = 2c - 2g - b has no genus g";
  return "";
}

}  // namespace

std::string broken_invariant(const PolygonMesh& input, const HealedSurface& healed) {
  const Mesh& mesh = healed.mesh;
  const Index num_vertices = mesh.points.rows();
  if (healed.status != Status::ok) return "status";
  if (num_vertices < 3 || mesh.triangles.rows() < 1) return "nothing left";
  if (static_cast<Index>(healed.input_vertex.size()) != num_vertices ||
      static_cast<Index>(healed.is_guarded.size()) != num_vertices ||
      static_cast<Index>(healed.input_face.size()) != mesh.triangles.rows() ||
      static_cast<Index>(healed.analysis_vertex.size()) != input.points.rows()) {
    return "sizes";
  }
  for (Index i = 0; i < mesh.points.size(); ++i) {
    if (!std::isfinite(mesh.points.data()[i])) return "not finite";
  }
  const double largest = mesh.points.cwiseAbs().maxCoeff();
  if (!(largest >= 0.5 && largest < 1.0)) return "local coordinates outside [1/2, 1)";
  for (Index v = 0; v < num_vertices; ++v) {
    const int32_t source = healed.input_vertex[static_cast<size_t>(v)];
    if (source < 0 || source >= input.points.rows()) return at("input_vertex", v);
    const Eigen::RowVector3d back = healed.to_input(mesh.points.row(v));
    for (Index k = 0; k < 3; ++k) {
      // Exact but for what underflows far below the surface's own size.
      const double gap = std::abs(back(k) - input.points(source, k));
      if (gap > std::ldexp(1.0, healed.exponent - 1000)) return at("to_input", v);
    }
  }
  for (Index v = 0; v < input.points.rows(); ++v) {
    const int32_t target = healed.analysis_vertex[static_cast<size_t>(v)];
    if (target < -1 || target >= num_vertices) return at("analysis_vertex", v);
    if (target < 0) continue;
    if (healed.input_vertex[static_cast<size_t>(target)] > v) {
      return at("analysis_vertex not the smallest of its group", v);
    }
  }
  for (Index f = 0; f < mesh.triangles.rows(); ++f) {
    const int32_t face = healed.input_face[static_cast<size_t>(f)];
    if (face < 0 || face >= input.num_faces()) return at("input_face", f);
    for (Index k = 0; k < 3; ++k) {
      if (mesh.triangles(f, k) < 0 || mesh.triangles(f, k) >= num_vertices) return at("index", f);
    }
    if (is_degenerate(mesh.points.row(mesh.triangles(f, 0)), mesh.points.row(mesh.triangles(f, 1)),
                      mesh.points.row(mesh.triangles(f, 2))) ||
        !(triangle_area(mesh, f) > 0.0)) {
      return at("triangle without area", f);
    }
  }
  for (const double value : {healed.area, healed.volume, healed.mean_edge_length, healed.unit()}) {
    if (!std::isfinite(value)) return "measure not finite";
  }
  for (const Warning& w : healed.warnings.all()) {
    if (w.count < 1 || w.first.empty() || w.message.empty()) return "warning " + w.code;
  }
  return broken_topology(healed);
}

std::string broken_idempotence(const HealedSurface& healed) {
  const PolygonMesh input = to_polygon_mesh(healed.mesh);
  const HealedSurface again = heal(input);
  const std::string broken = broken_invariant(input, again);
  if (!broken.empty()) return "second time: " + broken;
  if (again.exponent != 0 || !again.center.isZero(0.0)) return "frame moved";
  if (again.mesh.points.rows() != healed.mesh.points.rows() ||
      !(again.mesh.points == healed.mesh.points)) {
    return "points changed";
  }
  if (again.mesh.triangles.rows() != healed.mesh.triangles.rows() ||
      !(again.mesh.triangles == healed.mesh.triangles)) {
    return "triangles changed";
  }
  if (!again.is_oriented) return "turned again";
  // Closed sheets that were cut apart at a point no longer show it, so guards may go, never come.
  for (size_t v = 0; v < healed.is_guarded.size(); ++v) {
    if (again.is_guarded[v] > healed.is_guarded[v]) return "a new guard";
  }
  for (const Warning& w : again.warnings.all()) {
    const auto& before = healed.warnings.all();
    const auto same = std::find_if(before.begin(), before.end(),
                                   [&](const Warning& other) { return other.code == w.code; });
    if (same == before.end()) return "new warning " + w.code;
    if (same->count < w.count) return "more of " + w.code;
  }
  return "";
}

}  // namespace dupin::test
