#include "dupin/crest/ridge_segments.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dupin/base/parallel.h"

namespace dupin::detail {

using Eigen::Index;
using Eigen::RowVector3d;
using std::int32_t;
using std::size_t;

namespace {

constexpr Index kVertexGrain = 4096;
constexpr Index kFaceBlock = 16384;

// A triangle with the directions of its corners turned into the half space of the first.
struct Corners {
  std::array<int32_t, 3> vertex;
  std::array<double, 3> extremality;
  std::array<RowVector3d, 3> direction;
};

// False where the three do not agree: the triangle surrounds an umbilic, or has no directions.
bool make_consistent(const SurfaceGraph& graph, const BendField& field, Index f, Corners& out) {
  for (size_t k = 0; k < 3; ++k) {
    const int32_t v = graph.triangles(f, static_cast<Index>(k));
    out.vertex[k] = v;
    out.direction[k] = field.direction.row(v);
    out.extremality[k] = field.extremality[v];
    if (k > 0 && out.direction[k].dot(out.direction[0]) < 0.0) {
      out.direction[k] = -out.direction[k];
      out.extremality[k] = -out.extremality[k];
    }
  }
  return out.direction[1].dot(out.direction[0]) > 0.0 &&
         out.direction[2].dot(out.direction[0]) > 0.0 &&
         out.direction[1].dot(out.direction[2]) > 0.0;
}

// Slope of the extremality along the common direction of the corners.
double slope_of(const SurfaceGraph& graph, const Corners& corners) {
  const RowVector3d a = graph.points.row(corners.vertex[0]);
  const RowVector3d b = graph.points.row(corners.vertex[1]);
  const RowVector3d c = graph.points.row(corners.vertex[2]);
  const RowVector3d normal = (b - a).cross(c - a);
  const double squared = normal.squaredNorm();
  const RowVector3d along = corners.direction[0] + corners.direction[1] + corners.direction[2];
  const double length = along.norm();
  if (!(squared > 0.0) || !(length > 0.0)) return 0.0;
  const auto& e = corners.extremality;
  const RowVector3d gradient =
      normal.cross(e[0] * (c - b) + e[1] * (a - c) + e[2] * (b - a)) / squared;
  return gradient.dot(along) / length;
}

EdgeCrossing crossing_of(int32_t a, int32_t b, double ea, double eb) {
  if (a > b) return crossing_of(b, a, eb, ea);
  return {a, b, ea / (ea - eb)};
}

struct Piece {
  EdgeCrossing from;
  EdgeCrossing to;
};

bool find_piece(const SurfaceGraph& graph, const BendField& field, Index f, Piece& piece) {
  const auto corner = graph.triangles.row(f);
  if (field.strength[corner[0]] <= 0.0 && field.strength[corner[1]] <= 0.0 &&
      field.strength[corner[2]] <= 0.0)
    return false;
  for (Index k = 0; k < 3; ++k) {
    if (graph.is_guarded[static_cast<size_t>(corner[k])] != 0) return false;
  }
  Corners corners;
  if (!make_consistent(graph, field, f, corners)) return false;
  // Zero counts as positive: a line through a vertex crosses two of the edges around it.
  std::array<bool, 3> is_positive{};
  for (size_t k = 0; k < 3; ++k) is_positive[k] = corners.extremality[k] >= 0.0;
  if (is_positive[0] == is_positive[1] && is_positive[1] == is_positive[2]) return false;
  const double slope = slope_of(graph, corners);
  if (!(slope < 0.0)) return false;
  std::array<EdgeCrossing, 2> ends{};
  size_t count = 0;
  for (size_t k = 0; k < 3; ++k) {
    const size_t next = (k + 1) % 3;
    if (is_positive[k] == is_positive[next]) continue;
    ends[count] = crossing_of(corners.vertex[k], corners.vertex[next], corners.extremality[k],
                              corners.extremality[next]);
    ends[count].face = static_cast<int32_t>(f);
    ends[count].sharpness = -slope;
    ++count;
  }
  piece = {ends[0], ends[1]};
  return std::all_of(ends.begin(), ends.end(), [&](const EdgeCrossing& c) {
    return interpolate(field.bend, c) > 0.0 && interpolate(field.strength, c) > 0.0;
  });
}

bool is_before(const EdgeCrossing& a, const EdgeCrossing& b) {
  return std::pair(a.a, a.b) < std::pair(b.a, b.b);
}

}  // namespace

BendField bend_field(const SurfaceGraph& graph, const TensorStack& stack,
                     const Eigen::VectorXd& level, double ratio, const GradientStencil& stencil,
                     CrestKind kind) {
  const Index count = graph.points.rows();
  const bool is_ridge = kind == CrestKind::ridge;
  const Adjacency& ring = graph.topology.ring;
  BendField out;
  out.bend.resize(count);
  out.strength.resize(count);
  out.direction.resize(count, 3);
  out.extremality.resize(count);
  parallel_for(0, count, kVertexGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      const PrincipalFrame frame = principal_frame(stack, v, level[v], ratio);
      out.bend[v] = is_ridge ? frame.k1 : -frame.k2;
      out.strength[v] = std::abs(out.bend[v]) - std::abs(is_ridge ? frame.k2 : frame.k1);
      out.direction.row(v) = is_ridge ? frame.d1 : frame.d2;
    }
  });
  parallel_for(0, count, kVertexGrain, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      double slope = 0.0;
      for (const int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
        slope += (out.bend[*j] - out.bend[v]) *
                 stencil.weight.row(j - ring.neighbor.data()).dot(out.direction.row(v));
      }
      out.extremality[v] = slope;
    }
  });
  return out;
}

double face_sharpness(const SurfaceGraph& graph, const BendField& field, int32_t face) {
  Corners corners;
  return make_consistent(graph, field, face, corners) ? -slope_of(graph, corners) : 0.0;
}

RidgeSegments find_ridge_segments(const SurfaceGraph& graph, const BendField& field) {
  const Index num_blocks = (graph.triangles.rows() + kFaceBlock - 1) / kFaceBlock;
  std::vector<std::vector<Piece>> parts(static_cast<size_t>(num_blocks));
  parallel_for(0, num_blocks, 1, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b) {
      const Index end = std::min(graph.triangles.rows(), (b + 1) * kFaceBlock);
      Piece piece;
      for (Index f = b * kFaceBlock; f < end; ++f) {
        if (find_piece(graph, field, f, piece)) parts[static_cast<size_t>(b)].push_back(piece);
      }
    }
  });
  RidgeSegments out;
  for (const auto& part : parts) {
    for (const Piece& piece : part) {
      out.crossings.push_back(piece.from);
      out.crossings.push_back(piece.to);
    }
  }
  std::stable_sort(out.crossings.begin(), out.crossings.end(), is_before);
  const auto same = [](const EdgeCrossing& a, const EdgeCrossing& b) {
    return a.a == b.a && a.b == b.b;
  };
  out.crossings.erase(std::unique(out.crossings.begin(), out.crossings.end(), same),
                      out.crossings.end());
  const auto index_of = [&](const EdgeCrossing& c) {
    return static_cast<int32_t>(
        std::lower_bound(out.crossings.begin(), out.crossings.end(), c, is_before) -
        out.crossings.begin());
  };
  for (const auto& part : parts) {
    for (const Piece& piece : part)
      out.segments.push_back({index_of(piece.from), index_of(piece.to)});
  }
  return out;
}

std::vector<std::vector<int32_t>> link_segments(const RidgeSegments& found) {
  const size_t count = found.crossings.size();
  std::vector<std::vector<int32_t>> at(count);  // segments
  for (size_t s = 0; s < found.segments.size(); ++s) {
    at[static_cast<size_t>(found.segments[s].from)].push_back(static_cast<int32_t>(s));
    at[static_cast<size_t>(found.segments[s].to)].push_back(static_cast<int32_t>(s));
  }
  std::vector<std::uint8_t> is_used(found.segments.size(), 0);
  std::vector<std::vector<int32_t>> chains;
  const auto follow = [&](int32_t start, int32_t segment) {
    std::vector<int32_t> chain{start};
    int32_t self = start;
    for (;;) {
      is_used[static_cast<size_t>(segment)] = 1;
      const RidgeSegment& s = found.segments[static_cast<size_t>(segment)];
      self = s.from == self ? s.to : s.from;
      chain.push_back(self);
      const auto& around = at[static_cast<size_t>(self)];
      if (around.size() != 2) break;
      segment = around[0] == segment ? around[1] : around[0];
      if (is_used[static_cast<size_t>(segment)] != 0) break;
    }
    chains.push_back(std::move(chain));
  };
  // From the ends first; what is left then are rings.
  for (const bool is_end : {true, false}) {
    for (size_t c = 0; c < count; ++c) {
      if ((at[c].size() != 2) != is_end) continue;
      for (const int32_t segment : at[c]) {
        if (is_used[static_cast<size_t>(segment)] == 0) follow(static_cast<int32_t>(c), segment);
      }
    }
  }
  return chains;
}

}  // namespace dupin::detail
