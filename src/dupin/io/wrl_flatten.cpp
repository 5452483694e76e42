#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dupin/io/wrl_scene.h"

namespace dupin::detail {
namespace {

// Visits that a scene may cost, however often it uses its nodes again.
constexpr std::int64_t kMaxVisits = 1'000'000;
constexpr std::int64_t kFreeBytes = std::int64_t{64} << 20;

/// What VRML's traversal carries along.
struct State {
  AffineMap transform;
  std::int32_t coordinate = -1;
  std::int32_t normal = -1;
  bool is_clockwise = false;
};

/// One face set as it is to be drawn.
struct Instance {
  AffineMap transform;
  std::int32_t faces = -1;
  std::int32_t points = -1;   ///< index into scene.vectors
  std::int32_t normals = -1;  ///< the same
  bool is_clockwise = false;
};

/// Finds the face sets of a scene in drawing order, without recursion.
class Traversal {
 public:
  Traversal(const WrlScene& scene, const WrlLexer& lexer, const ReadLimits& limits)
      : scene_(scene), lexer_(lexer), limits_(limits) {}

  std::vector<Instance> run() {
    enter(0);
    while (!path_.empty()) {
      Frame& frame = path_.back();
      const WrlNode& node = node_of(frame.node);
      if (frame.next < frame.end) {
        const std::int32_t child = node.children[frame.next++];
        visit(child);
      } else {
        leave(frame);
      }
    }
    return std::move(instances_);
  }

  const std::vector<std::int32_t>& unsupported() const { return unsupported_; }

 private:
  struct Frame {
    std::int32_t node = 0;
    std::size_t next = 0;
    std::size_t end = 0;
    State saved;
  };

  const WrlNode& node_of(std::int32_t id) const {
    return scene_.nodes[static_cast<std::size_t>(id)];
  }

  void visit(std::int32_t id) {
    if (++num_visits_ > kMaxVisits) {
      lexer_.fail(
          Errc::over_limit, "E_EXPANSION",
          "the scene uses its nodes again more than " + std::to_string(kMaxVisits) + " times",
          lexer_.size());
    }
    const WrlNode& node = node_of(id);
    switch (node.kind) {
      case WrlKind::coordinate:
        state_.coordinate = node.payload;
        return;
      case WrlKind::normal:
        state_.normal = node.payload;
        return;
      case WrlKind::shape_hints:
        state_.is_clockwise = node.is_clockwise;
        return;
      case WrlKind::face_set:
        draw(node);
        return;
      case WrlKind::unsupported:
        unsupported_.push_back(id);
        return;
      case WrlKind::other:
        return;
      default:
        enter(id);
    }
  }

  void enter(std::int32_t id) {
    if (static_cast<std::int64_t>(path_.size()) > 2 * std::int64_t{limits_.max_nesting}) {
      lexer_.fail(Errc::over_limit, "E_NESTING",
                  "nodes that use each other more than " + std::to_string(limits_.max_nesting) +
                      " levels deep",
                  lexer_.size());
    }
    const WrlNode& node = node_of(id);
    Frame frame{id, 0, node.children.size(), state_};
    if (node.kind == WrlKind::transform) apply(node);
    if (node.kind == WrlKind::lod) frame.end = std::min<std::size_t>(frame.end, 1);
    if (node.kind == WrlKind::switch_node && node.choice != -3) {
      const auto choice = static_cast<std::size_t>(std::max(node.choice, 0));
      const bool is_shown = node.choice >= 0 && choice < frame.end;
      frame.next = is_shown ? choice : frame.end;
      if (is_shown) frame.end = choice + 1;
    }
    path_.push_back(std::move(frame));
  }

  void leave(const Frame& frame) {
    switch (node_of(frame.node).kind) {
      case WrlKind::group:
      case WrlKind::lod:
        state_ = frame.saved;
        break;
      case WrlKind::transform_separator:
        state_.transform = frame.saved.transform;
        break;
      case WrlKind::transform:
        // In VRML 1 a transform acts on what follows it.
        if (!scene_.is_version_1) state_ = frame.saved;
        break;
      default:
        break;
    }
    path_.pop_back();
  }

  void apply(const WrlNode& node) {
    state_.transform =
        product(state_.transform, scene_.transforms[static_cast<std::size_t>(node.payload)]);
    if (!is_tame(state_.transform)) {
      lexer_.fail(Errc::malformed, "E_NUMBER_RANGE", "nested transforms grow beyond 1e100",
                  lexer_.size());
    }
  }

  void draw(const WrlNode& node) {
    if (node.payload < 0) return;
    Instance instance{state_.transform, node.payload, state_.coordinate, state_.normal,
                      node.is_clockwise || state_.is_clockwise};
    for (const std::int32_t child : node.children) {
      if (node_of(child).kind == WrlKind::coordinate) instance.points = node_of(child).payload;
      if (node_of(child).kind == WrlKind::normal) instance.normals = node_of(child).payload;
    }
    instances_.push_back(std::move(instance));
  }

  const WrlScene& scene_;
  const WrlLexer& lexer_;
  const ReadLimits& limits_;
  std::vector<Frame> path_;
  State state_;
  std::vector<Instance> instances_;
  std::vector<std::int32_t> unsupported_;
  std::int64_t num_visits_ = 0;
};

/// Joins instances into one mesh.
class Builder {
 public:
  Builder(const WrlScene& scene, WrlLexer& lexer, const ReadOptions& options)
      : scene_(scene), lexer_(lexer), options_(options) {}

  PolygonMesh build(const std::vector<Instance>& instances) {
    allocate(instances);
    for (const Instance& instance : instances) append(instance);
    return std::move(mesh_);
  }

 private:
  static Eigen::Index size_of(const WrlVectors& list) {
    return static_cast<Eigen::Index>(list.xyz.size() / 3);
  }
  const WrlFaces& faces_of(const Instance& i) const {
    return scene_.faces[static_cast<std::size_t>(i.faces)];
  }
  const WrlVectors& points_of(const Instance& i) const {
    static const WrlVectors none;
    return i.points < 0 ? none : scene_.vectors[static_cast<std::size_t>(i.points)];
  }
  bool has_normals(const Instance& i) const {
    return i.normals >= 0 && !faces_of(i).has_own_normal_order &&
           size_of(scene_.vectors[static_cast<std::size_t>(i.normals)]) == size_of(points_of(i));
  }

  void allocate(const std::vector<Instance>& instances) {
    const ReadLimits& limits = options_.limits;
    std::int64_t num_points = 0;
    std::int64_t num_faces = 0;
    std::int64_t num_corners = 0;
    bool all_have_normals = !instances.empty();
    bool all_triangles = true;
    // Shapes that are used again may need more room than the text that describes them.
    const std::int64_t room = kFreeBytes + 4 * static_cast<std::int64_t>(lexer_.size());
    for (const Instance& i : instances) {
      num_points += size_of(points_of(i));
      num_faces += faces_of(i).num_faces;
      num_corners += faces_of(i).num_corners;
      all_have_normals = all_have_normals && has_normals(i);
      all_triangles = all_triangles && is_triangles(faces_of(i));
      const std::int64_t bytes = num_points * (all_have_normals ? 48 : 24) +
                                 4 * (num_corners + (all_triangles ? 0 : num_faces));
      if (bytes > room) {
        lexer_.fail(Errc::over_limit, "E_EXPANSION",
                    "the scene draws its shapes so often that they need more than " +
                        std::to_string(room) + " bytes",
                    faces_of(i).byte);
      }
      check_limit(num_points, limits.max_vertices, "vertices", faces_of(i).byte);
      check_limit(num_faces, limits.max_faces, "faces", faces_of(i).byte);
    }
    if (num_corners > std::numeric_limits<std::int32_t>::max()) {
      check_limit(num_corners, std::numeric_limits<std::int32_t>::max(), "corners", 0);
    }
    mesh_.points.resize(num_points, 3);
    mesh_.normals.resize(all_have_normals ? num_points : 0, 3);
    mesh_.face_index.resize(num_corners);
    mesh_.face_offset.resize(all_triangles ? 0 : num_faces + 1);
    if (!all_triangles) mesh_.face_offset[0] = 0;
  }

  static bool is_triangles(const WrlFaces& faces) {
    if (faces.num_corners != 3 * faces.num_faces) return false;
    for (std::size_t i = 3; i < faces.index.size(); i += 4) {
      if (faces.index[i] != -1) return false;
    }
    return true;
  }

  void check_limit(std::int64_t size, std::int64_t limit, const char* what,
                   std::size_t byte) const {
    if (size > limit) {
      lexer_.fail(Errc::over_limit, "E_TOO_LARGE",
                  "more than " + std::to_string(limit) + " " + what, byte);
    }
  }

  void append(const Instance& instance) {
    const WrlVectors& points = points_of(instance);
    append_points(instance, points);
    if (mesh_.normals.rows() > 0) append_normals(instance);
    append_faces(instance, size_of(points));
    first_point_ += size_of(points);
  }

  void append_points(const Instance& instance, const WrlVectors& points) {
    for (Eigen::Index i = 0; i < size_of(points); ++i) {
      Eigen::Vector3d p(&points.xyz[static_cast<std::size_t>(3 * i)]);
      const bool is_finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      if (!is_finite && !options_.drop_nonfinite) {
        lexer_.fail(Errc::impossible, "E_NONFINITE",
                    "vertex " + std::to_string(first_point_ + i) + " is not finite",
                    byte_of_number(points.byte, 3 * i));
      }
      if (is_finite && !apply(instance.transform, p)) {
        lexer_.fail(Errc::malformed, "E_NUMBER_RANGE",
                    "vertex " + std::to_string(first_point_ + i) + " is too large to transform",
                    byte_of_number(points.byte, 3 * i));
      }
      mesh_.points.row(first_point_ + i) = p.transpose();
    }
  }

  void append_normals(const Instance& instance) {
    const WrlVectors& normals = scene_.vectors[static_cast<std::size_t>(instance.normals)];
    const Eigen::Matrix3d turn = cofactors(instance.transform.linear);
    for (Eigen::Index i = 0; i < size_of(normals); ++i) {
      const Eigen::Vector3d n(&normals.xyz[static_cast<std::size_t>(3 * i)]);
      mesh_.normals.row(first_point_ + i) = moved_normal(instance.transform, turn, n).transpose();
    }
  }

  void append_faces(const Instance& instance, Eigen::Index num_points) {
    const WrlFaces& faces = faces_of(instance);
    // A mirror turns every face over, and VRML's normals turn back with it.
    const bool is_mirror = instance.transform.linear.determinant() < 0.0;
    const bool is_turned = instance.is_clockwise != is_mirror;
    std::size_t first = 0;
    for (std::size_t i = 0; i < faces.index.size(); ++i) {
      if (faces.index[i] >= 0) {
        if (faces.index[i] >= num_points) fail_index(faces, i, num_points);
        continue;
      }
      for (std::size_t k = first; k < i; ++k) {
        const std::size_t from = is_turned && k > first ? i - (k - first) : k;
        mesh_.face_index[next_corner_++] =
            faces.index[from] + static_cast<std::int32_t>(first_point_);
      }
      ++next_face_;
      if (mesh_.face_offset.size() > 0) {
        mesh_.face_offset[next_face_] = static_cast<std::int32_t>(next_corner_);
      }
      first = i + 1;
    }
  }

  [[noreturn]] void fail_index(const WrlFaces& faces, std::size_t at, Eigen::Index num_points) {
    const std::int32_t index = faces.index[at];
    std::string message = "face " + std::to_string(next_face_) + " uses vertex " +
                          std::to_string(index) + ", but its coordinates have " +
                          std::to_string(num_points);
    if (num_points > 0) message += " (0..." + std::to_string(num_points - 1) + ")";
    // Empty faces are not kept, so the place is found by value, not by rank.
    lexer_.seek(faces.byte);
    std::size_t byte = faces.byte;
    while (true) {
      const WrlToken token = lexer_.next();
      if (token.kind == WrlTokenKind::open_bracket) continue;
      if (token.kind != WrlTokenKind::word) break;
      if (lexer_.integer(token) >= num_points) {
        byte = token.byte;
        break;
      }
    }
    lexer_.fail(Errc::malformed, "E_INDEX_RANGE", message, byte);
  }

  std::size_t byte_of_number(std::size_t byte, Eigen::Index rank) {
    lexer_.seek(byte);
    WrlToken token = lexer_.next();
    if (token.kind == WrlTokenKind::open_bracket) token = lexer_.next();
    for (; rank > 0; --rank) token = lexer_.next();
    return token.byte;
  }

  const WrlScene& scene_;
  WrlLexer& lexer_;
  const ReadOptions& options_;
  PolygonMesh mesh_;
  Eigen::Index first_point_ = 0;
  Eigen::Index next_corner_ = 0;
  Eigen::Index next_face_ = 0;
};

}  // namespace

PolygonMesh flatten_wrl_scene(const WrlScene& scene, WrlLexer& lexer, const ReadOptions& options,
                              WarningList& warnings) {
  Traversal traversal(scene, lexer, options.limits);
  const std::vector<Instance> instances = traversal.run();
  if (!traversal.unsupported().empty()) {
    warnings.add("W_UNSUPPORTED_NODE", "", "shapes other than IndexedFaceSet are left out",
                 static_cast<std::int64_t>(traversal.unsupported().size()));
  }
  for (const Instance& instance : instances) {
    const WrlFaces& faces = scene.faces[static_cast<std::size_t>(instance.faces)];
    if (faces.num_empty > 0) {
      warnings.add("W_EMPTY_FACE", "line " + std::to_string(lexer.line_of(faces.byte)),
                   "faces without a vertex are left out", faces.num_empty);
    }
  }
  return Builder(scene, lexer, options).build(instances);
}

}  // namespace dupin::detail
