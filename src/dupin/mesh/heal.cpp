#include "dupin/mesh/heal.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/mesh/edge_table.h"
#include "dupin/mesh/manifold_cut.h"
#include "dupin/mesh/orientation.h"
#include "dupin/mesh/repeated_faces.h"
#include "dupin/mesh/topology.h"
#include "dupin/mesh/triangulate.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

// Smaller than this, in units of the surface, a triangle is a point: the fourth powers of lengths
// that areas and normals need would leave the range of double (2^-1022) once degenerate ones are
// told apart at 1e-14.
constexpr int kSmallestEdgeExponent = -200;
constexpr double kSmallestExtent = 1e-15;
constexpr double kLargestExtent = 1e15;
constexpr double kLargestOffset = 1e5;  // of the centre, in extents
constexpr Index kSmallSurface = 12;

std::string at_face(Index face) { return "face " + std::to_string(face); }
std::string at_vertex(Index vertex) { return "vertex " + std::to_string(vertex); }

// How many elements, and the first of them.
struct Tally {
  std::int64_t count = 0;
  Index first = -1;
  void add(Index element) {
    if (count++ == 0 || element < first) first = element;
  }
};

bool is_finite(const Points& points, Index v) {
  return std::isfinite(points(v, 0)) && std::isfinite(points(v, 1)) && std::isfinite(points(v, 2));
}

void validate(const PolygonMesh& input) {
  const auto num_indices = static_cast<int32_t>(input.face_index.size());
  if (input.face_offset.size() > 0) {
    bool ascending =
        input.face_offset(0) == 0 && input.face_offset(input.face_offset.size() - 1) == num_indices;
    for (Index f = 0; ascending && f < input.num_faces(); ++f) {
      ascending = input.face_offset(f) <= input.face_offset(f + 1);
    }
    if (!ascending) throw InvalidArgument("face_offset: does not rise from 0 to face_index.size()");
  } else if (num_indices % 3 != 0) {
    throw InvalidArgument("face_index: not a multiple of three");
  }
  for (Index f = 0; f < input.num_faces(); ++f) {
    const std::span<const int32_t> face = input.face(f);
    for (const int32_t v : face) {
      if (v >= 0 && v < input.points.rows()) continue;
      throw InvalidArgument("face_index: face " + std::to_string(f) + " uses vertex " +
                            std::to_string(v) + ", but there are " +
                            std::to_string(input.points.rows()));
    }
  }
}

// Triangles over the input's vertices, each with the face it comes from.
struct Soup {
  std::vector<std::array<int32_t, 3>> triangles;
  std::vector<int32_t> face;

  template <typename Keep>
  void filter(const Keep& keep) {
    size_t kept = 0;
    for (size_t t = 0; t < triangles.size(); ++t) {
      if (!keep(t)) continue;
      triangles[kept] = triangles[t];
      face[kept++] = face[t];
    }
    triangles.resize(kept);
    face.resize(kept);
  }
};

// What one run of heal() carries from stage to stage.
class Healer {
 public:
  Healer(const PolygonMesh& input, const HealOptions& options)
      : input_(input), options_(options), points_(input.points) {}

  HealedSurface run(const RunControl& run);

 private:
  void check_input();
  void scale_down_huge_coordinates();
  void split_into_triangles();
  void drop_repeated_triangles();
  void choose_local_frame();
  void make_local_points();
  void cut();
  void orient();
  void measure();
  void remark();

  void warn(const char* code, const Tally& tally, const std::string& place, const char* message) {
    if (tally.count > 0) result_.warnings.add(code, place, message, tally.count);
  }
  void warn_faces(const char* code, const Tally& tally, const char* message) {
    warn(code, tally, at_face(tally.first), message);
  }
  void warn_vertices(const char* code, const Tally& tally, const char* message) {
    warn(code, tally, at_vertex(tally.first), message);
  }

  const PolygonMesh& input_;
  const HealOptions& options_;
  HealedSurface result_;
  Points points_;               // input, times 2^-30 if it reaches 2^1000: no difference overflows
  int point_exponent_ = 0;      // points_ = input * 2^-point_exponent_
  std::vector<int32_t> place_;  // first vertex at the same place
  Soup soup_;
  RowVector3d low_, high_;  // box of the surface in units of points_
  RowVector3d center_;      // the same units
  int exponent_ = 0;        // local = (points_ - center_) * 2^-exponent_
  Points local_;            // of every input vertex; rows of unused vertices are zero
};

void Healer::check_input() {
  validate(input_);
  result_.num_input_vertices = input_.points.rows();
  result_.num_input_faces = input_.num_faces();
  if (input_.points.rows() == 0) throw AnalysisError("E_NO_VERTICES", "the input has no vertices");
  Tally nonfinite;
  bool has_box = false;
  for (Index v = 0; v < input_.points.rows(); ++v) {
    if (!is_finite(input_.points, v)) {
      nonfinite.add(v);
      // Zero keeps comparisons free of invalid operations; no face of it survives.
      points_.row(v).setZero();
      continue;
    }
    const RowVector3d p = input_.points.row(v);
    result_.box_min = has_box ? RowVector3d(result_.box_min.cwiseMin(p)) : p;
    result_.box_max = has_box ? RowVector3d(result_.box_max.cwiseMax(p)) : p;
    has_box = true;
  }
  if (nonfinite.count > 0 && !options_.drop_nonfinite) {
    throw AnalysisError("E_NONFINITE",
                        at_vertex(nonfinite.first) + " is not finite (" +
                            std::to_string(nonfinite.count) + " in all)",
                        "--drop-nonfinite removes such vertices and their faces");
  }
  warn_vertices("W_NONFINITE_DROPPED", nonfinite, "vertices that are not finite were dropped");
  if (!has_box) throw AnalysisError("E_NO_VERTICES", "the input has no finite vertex");
  if (input_.num_faces() == 0) {
    throw AnalysisError("E_NO_FACES", "the input has vertices but no faces: a point cloud",
                        "this analysis needs a surface");
  }
}

void Healer::scale_down_huge_coordinates() {
  const double largest =
      std::max(result_.box_min.cwiseAbs().maxCoeff(), result_.box_max.cwiseAbs().maxCoeff());
  if (largest < 0x1.0p1000) return;
  point_exponent_ = 30;
  points_ *= 0x1.0p-30;
}

void Healer::split_into_triangles() {
  if (options_.weld) {
    place_ = find_coincident(points_);
  } else {
    place_.resize(static_cast<size_t>(points_.rows()));
    std::iota(place_.begin(), place_.end(), 0);
  }
  const std::vector<std::uint8_t> is_repeated = find_repeated_polygons(input_, place_);
  Tally degenerate;
  Tally repeated;
  Tally split;
  Tally crossed;
  for (Index f = 0; f < input_.num_faces(); ++f) {
    const std::span<const int32_t> face = input_.face(f);
    if (std::any_of(face.begin(), face.end(),
                    [&](int32_t v) { return !is_finite(input_.points, v); })) {
      continue;
    }
    if (is_repeated[static_cast<size_t>(f)] != 0) {
      repeated.add(f);
      continue;
    }
    const size_t before = soup_.triangles.size();
    if (face.size() == 3) {
      const std::array<int32_t, 3> t{face[0], face[1], face[2]};
      if (!is_degenerate(points_.row(t[0]), points_.row(t[1]), points_.row(t[2]))) {
        soup_.triangles.push_back(t);
      }
    } else if (face.size() > 3) {
      Points corners(static_cast<Index>(face.size()), 3);
      for (size_t k = 0; k < face.size(); ++k) {
        corners.row(static_cast<Index>(k)) = points_.row(face[k]);
      }
      const PolygonTriangles polygon = triangulate_polygon(corners);
      for (const auto& t : polygon.triangles) {
        soup_.triangles.push_back({face[static_cast<size_t>(t[0])], face[static_cast<size_t>(t[1])],
                                   face[static_cast<size_t>(t[2])]});
      }
      if (!polygon.triangles.empty()) split.add(f);
      if (polygon.is_crossed) crossed.add(f);
    }
    if (soup_.triangles.size() == before) degenerate.add(f);
    soup_.face.resize(soup_.triangles.size(), static_cast<int32_t>(f));
  }
  warn_faces("W_POLYGON_SPLIT", split, "polygons were cut into triangles");
  warn_faces("W_POLYGON_CROSSED", crossed, "polygons cross themselves: their triangles overlap");
  warn_faces("W_DEGENERATE_FACE", degenerate, "faces without area were dropped");
  warn_faces("W_DUPLICATE_FACE", repeated, "faces that repeat another were dropped");
}

void Healer::drop_repeated_triangles() {
  const std::vector<std::uint8_t> is_repeated = find_repeated_triangles(soup_.triangles, place_);
  Tally faces;
  for (size_t t = 0; t < is_repeated.size(); ++t) {
    const bool is_counted = t > 0 && is_repeated[t - 1] != 0 && soup_.face[t - 1] == soup_.face[t];
    if (is_repeated[t] != 0 && !is_counted) faces.add(soup_.face[t]);
  }
  if (faces.count == 0) return;
  soup_.filter([&](size_t t) { return is_repeated[t] == 0; });
  warn_faces("W_DUPLICATE_FACE", faces, "faces that repeat another were dropped");
}

// Center and exponent of the surface that is left. An axis is shifted only when the surface lies
// more than its own size away from the origin: then every difference p - c is exact (Sterbenz), so
// that local coordinates never lose a bit, and healing twice shifts nothing the second time.
void Healer::choose_local_frame() {
  Tally tiny;
  for (bool changed = true; changed;) {
    changed = false;
    if (soup_.triangles.empty()) {
      throw AnalysisError("E_ALL_DEGENERATE", "no face has an area",
                          "all vertices coincide or lie on lines");
    }
    low_ = high_ = points_.row(soup_.triangles.front()[0]);
    for (const auto& t : soup_.triangles) {
      for (const int32_t v : t) {
        low_ = low_.cwiseMin(points_.row(v));
        high_ = high_.cwiseMax(points_.row(v));
      }
    }
    const double half = 0.5 * (high_ - low_).maxCoeff();
    double largest = 0.0;
    for (Index k = 0; k < 3; ++k) {
      const double middle = 0.5 * low_(k) + 0.5 * high_(k);
      center_(k) = std::abs(middle) > 2.0 * half ? middle : 0.0;
      largest =
          std::max({largest, std::abs(low_(k) - center_(k)), std::abs(high_(k) - center_(k))});
    }
    std::frexp(largest, &exponent_);
    const double smallest = std::ldexp(1.0, exponent_ + kSmallestEdgeExponent);
    const size_t before = soup_.triangles.size();
    soup_.filter([&](size_t i) {
      const auto& t = soup_.triangles[i];
      const RowVector3d a = points_.row(t[0]);
      const double length = std::max((points_.row(t[1]) - a).cwiseAbs().maxCoeff(),
                                     (points_.row(t[2]) - a).cwiseAbs().maxCoeff());
      if (length < smallest) tiny.add(soup_.face[i]);
      return length >= smallest;
    });
    changed = soup_.triangles.size() != before;
  }
  warn_faces("W_DEGENERATE_FACE", tiny, "faces without area were dropped");
}

void Healer::make_local_points() {
  local_ = Points::Zero(points_.rows(), 3);
  std::vector<std::uint8_t> is_used(static_cast<size_t>(points_.rows()), 0);
  bool is_exact = true;
  for (const auto& t : soup_.triangles) {
    for (const int32_t v : t) {
      if (std::exchange(is_used[static_cast<size_t>(v)], std::uint8_t{1}) != 0) continue;
      for (Index k = 0; k < 3; ++k) {
        const double shifted = points_(v, k) - center_(k);
        local_(v, k) = std::ldexp(shifted, -exponent_);
        is_exact = is_exact && std::ldexp(local_(v, k), exponent_) == shifted;
      }
    }
  }
  // Only lengths under 2^-1022 of the surface are rounded, and then places may fall together.
  if (is_exact || !options_.weld) return;
  place_ = find_coincident(local_);
  soup_.filter([&](size_t t) {
    const auto [a, b, c] = soup_.triangles[t];
    return !is_degenerate(local_.row(a), local_.row(b), local_.row(c));
  });
  drop_repeated_triangles();
}

void Healer::cut() {
  Triangles triangles(static_cast<Index>(soup_.triangles.size()), 3);
  for (Index t = 0; t < triangles.rows(); ++t) {
    for (Index k = 0; k < 3; ++k) {
      triangles(t, k) = soup_.triangles[static_cast<size_t>(t)][static_cast<size_t>(k)];
    }
  }
  ManifoldCut cut = cut_to_manifold(triangles, place_);
  const auto num_vertices = static_cast<Index>(cut.source.size());
  result_.mesh.points.resize(num_vertices, 3);
  for (Index v = 0; v < num_vertices; ++v) {
    result_.mesh.points.row(v) = local_.row(cut.source[static_cast<size_t>(v)]);
  }
  result_.mesh.triangles = std::move(cut.triangles);
  result_.num_edges = cut.num_edges;
  result_.euler = cut.num_vertices - cut.num_edges + triangles.rows();
  result_.is_manifold = cut.num_bad_edges == 0 && cut.num_bad_vertices == 0;
  result_.is_guarded = std::move(cut.is_cut);
  result_.input_vertex = std::move(cut.source);
  result_.input_face = soup_.face;
  warn_vertices("W_DUPLICATE_VERTEX", {cut.num_merged, cut.first_merged},
                "vertices at the place of another were merged");
  Tally isolated;
  for (size_t v = 0; v < cut.first.size(); ++v) {
    if (cut.first[v] < 0 && is_finite(input_.points, static_cast<Index>(v))) {
      isolated.add(static_cast<Index>(v));
    }
  }
  warn_vertices("W_ISOLATED_VERTEX", isolated, "vertices without a face are left out");
  const Index bad_face =
      cut.first_bad_face < 0 ? -1 : soup_.face[static_cast<size_t>(cut.first_bad_face)];
  warn_faces("W_NONMANIFOLD_EDGE", {cut.num_bad_edges, bad_face},
             "edges with more than two faces: the surface was cut there");
  warn_vertices("W_NONMANIFOLD_VERTEX", {cut.num_bad_vertices, cut.first_bad_vertex},
                "vertices where surfaces touch in a point: the surface was cut there");
  result_.analysis_vertex = std::move(cut.first);
}

void Healer::orient() {
  Triangles& triangles = result_.mesh.triangles;
  const EdgeTable edges = compute_edge_table(triangles, result_.mesh.points.rows());
  // One vote a face of the input, however many triangles it was cut into.
  std::vector<std::uint8_t> votes(soup_.face.size(), 1);
  for (size_t t = 1; t < votes.size(); ++t) votes[t] = soup_.face[t] != soup_.face[t - 1] ? 1 : 0;
  const Orientation orientation = orient_components(triangles, edges, votes);
  if (orientation.conflict >= 0) {
    throw AnalysisError("E_NOT_ORIENTABLE",
                        "the surface is one-sided near " +
                            at_face(soup_.face[static_cast<size_t>(orientation.conflict)]),
                        "the sign of curvature is undefined on it");
  }
  std::vector<int32_t> next(static_cast<size_t>(result_.mesh.points.rows()), -1);
  for (int32_t e = 0; e < edges.num_edges(); ++e) {
    if (edges.num_faces(e) != 1) continue;
    const int32_t h = *edges.begin(e);
    int32_t from = tail(triangles, h);
    int32_t to = head(triangles, h);
    if (orientation.flip[static_cast<size_t>(h / 3)] != 0) std::swap(from, to);
    next[static_cast<size_t>(from)] = to;
    result_.is_guarded[static_cast<size_t>(from)] = 1;
    result_.is_guarded[static_cast<size_t>(to)] = 1;
  }
  result_.is_closed = true;
  for (size_t v = 0; v < next.size(); ++v) {
    if (next[v] < 0) continue;
    result_.is_closed = false;
    ++result_.num_boundary_loops;
    for (auto at = static_cast<int32_t>(v); at >= 0;) {
      at = std::exchange(next[static_cast<size_t>(at)], -1);
    }
  }

  Tally flipped;
  for (Index t = 0; t < triangles.rows(); ++t) {
    if (orientation.flip[static_cast<size_t>(t)] == 0) continue;
    std::swap(triangles(t, 1), triangles(t, 2));
    if (votes[static_cast<size_t>(t)] != 0) flipped.add(soup_.face[static_cast<size_t>(t)]);
  }
  result_.is_oriented = flipped.count == 0;
  warn_faces("W_ORIENTATION_FIXED", flipped, "faces were turned to agree with their neighbours");
}

// Nearest finite double to value * 2^exponent.
double rescaled(double value, int exponent) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  return std::clamp(std::ldexp(value, exponent), -kLargest, kLargest);
}

void Healer::measure() {
  const Mesh& mesh = result_.mesh;
  const Adjacency ring = compute_topology(mesh.triangles, mesh.points.rows()).ring;
  result_.num_components = find_components(ring).count;
  result_.exponent = exponent_ + point_exponent_;
  for (Index k = 0; k < 3; ++k) result_.center(k) = std::ldexp(center_(k), point_exponent_);
  result_.area = rescaled(surface_area(mesh), 2 * result_.exponent);
  result_.mean_edge_length = rescaled(mean_edge_length(mesh.points, ring), result_.exponent);
  if (result_.is_closed) result_.volume = rescaled(enclosed_volume(mesh), 3 * result_.exponent);
}

// Whether all points lie in one plane, within 1e-12 of the size and what rounding of the input
// coordinates (`offset`: the largest of them, local unit) can do.
bool is_flat(const Points& points, double offset) {
  const auto farthest = [&](const auto& distance) {
    Index best = 0;
    double largest = -1.0;
    for (Index v = 0; v < points.rows(); ++v) {
      const double d = distance(RowVector3d(points.row(v)));
      if (d > largest) {
        largest = d;
        best = v;
      }
    }
    return RowVector3d(points.row(best));
  };
  const RowVector3d a = points.row(0);
  const RowVector3d b = farthest([&](const RowVector3d& p) { return (p - a).squaredNorm(); });
  const RowVector3d axis = (b - a).normalized();
  const RowVector3d c =
      farthest([&](const RowVector3d& p) { return (p - a).cross(axis).squaredNorm(); });
  const RowVector3d across = (c - a) - (c - a).dot(axis) * axis;
  const RowVector3d normal = axis.cross(across.normalized());
  const double slack =
      1e-12 * (b - a).norm() + 4.0 * std::numeric_limits<double>::epsilon() * offset;
  return ((points.rowwise() - a) * normal.transpose()).cwiseAbs().maxCoeff() <= slack;
}

void Healer::remark() {
  const Index num_vertices = result_.mesh.points.rows();
  if (result_.num_components > 1) {
    result_.warnings.add("W_COMPONENTS", at_vertex(result_.input_vertex.front()), "separate pieces",
                         result_.num_components);
  }
  const std::string everything = "the whole surface";
  const double extent = rescaled((high_ - low_).maxCoeff(), point_exponent_);
  if (extent < kSmallestExtent || extent > kLargestExtent) {
    result_.warnings.add("W_SCALE_EXTREME", everything,
                         "the size is outside 1e-15 to 1e15 units; normalised inside");
  }
  const RowVector3d middle = 0.5 * low_ + 0.5 * high_;
  if (middle.cwiseAbs().maxCoeff() > kLargestOffset * (high_ - low_).maxCoeff()) {
    result_.warnings.add("W_OFFSET_LARGE", everything,
                         "the surface lies more than 100000 times its size from the origin");
  }
  const double offset =
      std::ldexp(std::max(low_.cwiseAbs().maxCoeff(), high_.cwiseAbs().maxCoeff()), -exponent_);
  if (is_flat(result_.mesh.points, offset)) {
    result_.warnings.add("W_NO_CURVATURE", everything, "all of it lies in one plane");
  }
  if (num_vertices < kSmallSurface) {
    result_.warnings.add("W_TOO_SMALL", everything,
                         "fewer than 12 vertices are too few for curvature");
  }
}

HealedSurface Healer::run(const RunControl& run) {
  using Stage = void (Healer::*)();
  constexpr std::array<Stage, 10> kStages{&Healer::check_input,
                                          &Healer::scale_down_huge_coordinates,
                                          &Healer::split_into_triangles,
                                          &Healer::drop_repeated_triangles,
                                          &Healer::choose_local_frame,
                                          &Healer::make_local_points,
                                          &Healer::cut,
                                          &Healer::orient,
                                          &Healer::measure,
                                          &Healer::remark};
  for (size_t i = 0; i < kStages.size(); ++i) {
    if (run.cancelled()) {
      HealedSurface nothing;
      nothing.status = Status::cancelled;
      return nothing;
    }
    (this->*kStages[i])();
    run.report(static_cast<double>(i + 1) / static_cast<double>(kStages.size()));
  }
  return std::move(result_);
}

}  // namespace

RowVector3d HealedSurface::to_input(const RowVector3d& local) const {
  return {center(0) + std::ldexp(local(0), exponent), center(1) + std::ldexp(local(1), exponent),
          center(2) + std::ldexp(local(2), exponent)};
}

double HealedSurface::unit() const { return rescaled(1.0, exponent); }

HealedSurface heal(const PolygonMesh& input, const HealOptions& options, RunControl run) {
  return Healer(input, options).run(run);
}

PolygonMesh to_polygon_mesh(const Mesh& mesh) {
  PolygonMesh result;
  result.points = mesh.points;
  result.face_index =
      Eigen::Map<const PolygonMesh::Indices>(mesh.triangles.data(), mesh.triangles.size());
  return result;
}

}  // namespace dupin
