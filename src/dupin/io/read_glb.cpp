#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "dupin/io/affine_map.h"
#include "dupin/io/formats.h"
#include "dupin/io/glb_document.h"
#include "dupin/io/reader_tools.h"

namespace dupin::detail {
namespace {

using nlohmann::json;

constexpr std::int64_t kFreeBytes = std::int64_t{64} << 20;

/// Reads the triangles of the default scene of a binary glTF 2.0 file (Khronos glTF 2.0, section
/// 3); of a file without any, its points. Skins, morphs, cameras and materials are left out, other
/// files never opened.
class GlbParser {
 public:
  GlbParser(ByteSpan bytes, const std::string& name, const ReadOptions& options,
            const RunControl& run)
      : document_(bytes, name, options.limits),
        options_(options),
        run_(run),
        room_(kFreeBytes + 8 * static_cast<std::int64_t>(bytes.size())) {}

  SurfaceFile parse() {
    file_.format = "glb";
    file_.is_binary = true;
    check_extensions();
    if (document_.has_trailing_data()) {
      file_.warnings.add("W_TRAILING_DATA", "", "bytes after the glTF data are ignored");
    }
    wants_triangles_ = has_triangles();
    for (const std::int64_t root : roots()) push(root, AffineMap{});
    while (!path_.empty()) step();
    file_.mesh.points = points_.take();
    file_.mesh.normals.resize(0, 3);
    if (has_normals_ && normals_.size() == file_.mesh.points.rows()) {
      file_.mesh.normals = normals_.take();
    }
    faces_.move_to(file_.mesh);
    return std::move(file_);
  }

 private:
  struct Node {
    std::int64_t index = 0;
    AffineMap map;  ///< from the node to the world
    int depth = 0;
  };

  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message) const {
    document_.fail(errc, code, message);
  }

  void check_extensions() const {
    const auto required = document_.root().find("extensionsRequired");
    if (required == document_.root().end()) return;
    if (!required->is_array()) fail(Errc::malformed, "E_SYNTAX", "extensionsRequired is no list");
    for (const json& extension : *required) {
      const std::string key =
          extension.is_string() ? extension.get<std::string>() : std::string("?");
      // Quantized positions are plain accessors of integers; materials do not matter here.
      if (key == "KHR_mesh_quantization" || key == "KHR_texture_transform" ||
          key.starts_with("KHR_materials_")) {
        continue;
      }
      fail(Errc::malformed, "E_HEADER",
           "the file needs the extension '" + escaped(key, 60) + "', which is not read");
    }
  }

  const json& primitives_of(const json& mesh) const {
    const auto found = mesh.is_object() ? mesh.find("primitives") : mesh.end();
    if (!mesh.is_object() || found == mesh.end() || !found->is_array()) {
      fail(Errc::malformed, "E_SYNTAX", "a mesh without a list of primitives");
    }
    for (const json& primitive : *found) {
      if (!primitive.is_object()) fail(Errc::malformed, "E_SYNTAX", "a primitive is no object");
    }
    return *found;
  }

  bool has_triangles() const {
    const auto meshes = document_.root().find("meshes");
    if (meshes == document_.root().end() || !meshes->is_array()) return false;
    for (const json& mesh : *meshes) {
      for (const json& primitive : primitives_of(mesh)) {
        if (document_.whole(primitive, "mode", 4) >= 4) return true;
      }
    }
    return false;
  }

  std::vector<std::int64_t> index_list(const json& object, const char* key) const {
    std::vector<std::int64_t> result;
    const auto found = object.find(key);
    if (found == object.end()) return result;
    if (!found->is_array()) fail(Errc::malformed, "E_SYNTAX", std::string(key) + " is no list");
    for (const json& index : *found) {
      if (!index.is_number_unsigned() || index.get<std::uint64_t>() > kMaxIndex) {
        fail(Errc::malformed, "E_INDEX_RANGE", std::string(key) + " holds no index");
      }
      result.push_back(static_cast<std::int64_t>(index.get<std::uint64_t>()));
    }
    return result;
  }

  /// Nodes of the default scene, or, in a file without scenes, every node that is no child.
  std::vector<std::int64_t> roots() {
    const auto nodes = document_.root().find("nodes");
    const std::size_t num_nodes =
        nodes != document_.root().end() && nodes->is_array() ? nodes->size() : 0;
    is_visited_.assign(num_nodes, false);
    std::vector<std::int64_t> result;
    if (document_.root().contains("scenes")) {
      result = index_list(document_.item("scenes", document_.whole(document_.root(), "scene", 0)),
                          "nodes");
    } else {
      std::vector<bool> is_child(num_nodes, false);
      for (std::size_t i = 0; i < num_nodes; ++i) {
        const json& node = document_.item("nodes", static_cast<std::int64_t>(i));
        for (const std::int64_t child : index_list(node, "children")) {
          if (child < static_cast<std::int64_t>(num_nodes)) {
            is_child[static_cast<std::size_t>(child)] = true;
          }
        }
      }
      for (std::size_t i = 0; i < num_nodes; ++i) {
        if (!is_child[i]) result.push_back(static_cast<std::int64_t>(i));
      }
    }
    std::reverse(result.begin(), result.end());  // the path is a stack
    return result;
  }

  void push(std::int64_t index, const AffineMap& map, int depth = 0) {
    path_.push_back({index, map, depth});
  }

  void step() {
    const Node node = path_.back();
    path_.pop_back();
    const json& source = document_.item("nodes", node.index);
    if (is_visited_[static_cast<std::size_t>(node.index)]) {
      fail(Errc::malformed, "E_CYCLE",
           "node " + std::to_string(node.index) + " has two parents or is below itself");
    }
    is_visited_[static_cast<std::size_t>(node.index)] = true;
    if (node.depth > options_.limits.max_nesting) {
      fail(Errc::over_limit, "E_NESTING",
           "nodes nested deeper than " + std::to_string(options_.limits.max_nesting) + " levels");
    }
    const AffineMap map = product(node.map, local_map(source));
    if (!is_tame(map)) {
      fail(Errc::malformed, "E_NUMBER_RANGE", "transforms of nodes grow beyond 1e100");
    }
    if (source.contains("mesh")) {
      check_run(run_, 0, 0);
      add_mesh(document_.item("meshes", document_.whole(source, "mesh", -1)), map);
    }
    std::vector<std::int64_t> children = index_list(source, "children");
    for (auto child = children.rbegin(); child != children.rend(); ++child) {
      push(*child, map, node.depth + 1);
    }
  }

  AffineMap local_map(const json& node) const {
    AffineMap map;
    double matrix[16];
    if (document_.numbers(node, "matrix", matrix)) {
      map.is_identity = false;
      for (int col = 0; col < 3; ++col) {
        for (int row = 0; row < 3; ++row) map.linear(row, col) = matrix[4 * col + row];
        map.translation[col] = matrix[12 + col];
      }
      check_tame(map);
      return map;
    }
    double translation[3] = {0, 0, 0};
    double rotation[4] = {0, 0, 0, 1};
    double scale[3] = {1, 1, 1};
    const bool has_translation = document_.numbers(node, "translation", translation);
    const bool has_rotation = document_.numbers(node, "rotation", rotation);
    const bool has_scale = document_.numbers(node, "scale", scale);
    if (!has_translation && !has_rotation && !has_scale) return map;
    map.is_identity = false;
    map.translation = Eigen::Vector3d(translation);
    map.linear = Eigen::Vector3d(scale).asDiagonal();
    check_tame(map);
    if (has_rotation) map.linear = quaternion_rotation(rotation) * map.linear;
    return map;
  }

  void check_tame(const AffineMap& map) const {
    if (!is_tame(map)) {
      fail(Errc::malformed, "E_NUMBER_RANGE", "a transform holds a number beyond 1e100");
    }
  }

  /// Rotation of x i + y j + z k + w, of any length but zero.
  Eigen::Matrix3d quaternion_rotation(const double (&q)[4]) const {
    const Eigen::Vector4d raw(q);
    const double largest = raw.cwiseAbs().maxCoeff();
    if (!(largest > 0.0)) {
      fail(Errc::malformed, "E_NUMBER_RANGE", "a rotation by the zero quaternion");
    }
    const Eigen::Vector4d n = (raw / largest).normalized();
    return rotation_about(n.head<3>(), 2.0 * std::atan2(n.head<3>().norm(), n[3]));
  }

  void add_mesh(const json& mesh, const AffineMap& map) {
    // Primitives of a mesh often share their vertices.
    std::map<std::int64_t, std::pair<std::int64_t, std::int64_t>> first_vertex;
    for (const json& primitive : primitives_of(mesh)) {
      const std::int64_t mode = document_.whole(primitive, "mode", 4);
      if (mode > 6) fail(Errc::malformed, "E_HEADER", "a primitive of unknown mode");
      const bool is_wanted = wants_triangles_ ? mode >= 4 : mode == 0;
      if (!is_wanted) {
        file_.warnings.add("W_UNSUPPORTED_NODE", "", "points and lines beside faces are left out");
        continue;
      }
      const auto attributes = primitive.find("attributes");
      if (attributes == primitive.end() || !attributes->is_object()) {
        fail(Errc::malformed, "E_SYNTAX", "a primitive without attributes");
      }
      const std::int64_t position = document_.whole(*attributes, "POSITION", -1);
      if (position < 0) continue;  // the glTF way to leave geometry to an extension
      auto placed = first_vertex.find(position);
      if (placed == first_vertex.end()) {
        const std::int64_t first = points_.size();
        const std::int64_t count = add_vertices(*attributes, position, map);
        placed = first_vertex.emplace(position, std::make_pair(first, count)).first;
      }
      if (mode >= 4) add_faces(primitive, mode, map, placed->second.first, placed->second.second);
    }
  }

  void spend(std::int64_t bytes) {
    spent_ += bytes;
    if (spent_ > room_) {
      fail(Errc::over_limit, "E_EXPANSION",
           "the scene draws its meshes so often that they need more than " + std::to_string(room_) +
               " bytes");
    }
  }

  std::int64_t add_vertices(const json& attributes, std::int64_t position, const AffineMap& map) {
    const std::int64_t most = std::min(options_.limits.max_vertices, kMaxIndex) - points_.size();
    const GlbAccessor source = document_.accessor(position, 3, most);
    spend(source.count * 24);
    const std::vector<double> xyz = document_.values(source);
    for (std::int64_t i = 0; i < source.count; ++i) {
      Eigen::Vector3d p(&xyz[static_cast<std::size_t>(3 * i)]);
      const bool finite = is_finite(p[0], p[1], p[2]);
      if (!finite && !options_.drop_nonfinite) fail_nonfinite(points_.size(), {});
      if (finite && !apply(map, p)) {
        fail(Errc::malformed, "E_NUMBER_RANGE", "a vertex is too large to transform");
      }
      points_.add(p[0], p[1], p[2]);
    }
    add_normals(attributes, source.count, map);
    return source.count;
  }

  void add_normals(const json& attributes, std::int64_t count, const AffineMap& map) {
    if (!has_normals_ || !attributes.contains("NORMAL")) {
      has_normals_ = false;
      return;
    }
    const GlbAccessor source =
        document_.accessor(document_.whole(attributes, "NORMAL", -1), 3, count);
    if (source.count != count) {
      fail(Errc::malformed, "E_INDEX_RANGE", "not one normal for each vertex");
    }
    spend(count * 24);
    const std::vector<double> xyz = document_.values(source);
    const Eigen::Matrix3d turn = cofactors(map.linear);
    for (std::int64_t i = 0; i < count; ++i) {
      const Eigen::Vector3d n =
          moved_normal(map, turn, Eigen::Vector3d(&xyz[static_cast<std::size_t>(3 * i)]));
      normals_.add(n[0], n[1], n[2]);
    }
  }

  void add_faces(const json& primitive, std::int64_t mode, const AffineMap& map, std::int64_t first,
                 std::int64_t count) {
    std::vector<std::uint32_t> corners;
    if (primitive.contains("indices")) {
      const GlbAccessor source = document_.accessor(document_.whole(primitive, "indices", -1), 1,
                                                    3 * options_.limits.max_faces);
      spend(source.count * 4);
      corners = document_.indices(source);
    } else {
      spend(count * 4);
      corners.resize(static_cast<std::size_t>(count));
      for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<std::uint32_t>(i);
    }
    if (mode == 4 && corners.size() % 3 != 0) {
      fail(Errc::malformed, "E_HEADER", "the indices of triangles are not three for each");
    }
    // A mirror turns every face over.
    const bool is_mirror = mirrors(map);
    const std::size_t num_faces =
        mode == 4 ? corners.size() / 3 : corners.size() - std::min<std::size_t>(corners.size(), 2);
    if (mode != 4) spend(static_cast<std::int64_t>(num_faces) * 8);
    for (std::size_t f = 0; f < num_faces; ++f) {
      std::size_t a = mode == 4 ? 3 * f : f;
      std::size_t b = a + 1;
      std::size_t c = a + 2;
      if (mode == 5 && f % 2 == 1) std::swap(b, c);
      if (mode == 6) {
        a = f + 1;
        b = f + 2;
        c = 0;
      }
      if (is_mirror) std::swap(b, c);
      if (faces_.num_faces() >= options_.limits.max_faces) {
        fail_limit("faces", options_.limits.max_faces, {});
      }
      faces_.add_triangle(vertex(corners[a], first, count), vertex(corners[b], first, count),
                          vertex(corners[c], first, count));
    }
  }

  static bool mirrors(const AffineMap& map) {
    const Eigen::Matrix3d turn = cofactors(map.linear);
    // Expansion of the determinant along a row.
    return map.linear.row(0).dot(turn.row(0)) < 0.0;
  }

  std::int32_t vertex(std::uint32_t index, std::int64_t first, std::int64_t count) const {
    if (index >= count) {
      fail(Errc::malformed, "E_INDEX_RANGE",
           "face " + std::to_string(faces_.num_faces()) + " uses vertex " + std::to_string(index) +
               ", but its primitive has " + std::to_string(count));
    }
    return static_cast<std::int32_t>(first + static_cast<std::int64_t>(index));
  }

  GlbDocument document_;
  const ReadOptions& options_;
  const RunControl& run_;
  SurfaceFile file_;
  PointList points_;
  PointList normals_;
  FaceList faces_;
  std::vector<Node> path_;
  std::vector<bool> is_visited_;
  std::int64_t room_;
  std::int64_t spent_ = 0;
  bool has_normals_ = true;
  bool wants_triangles_ = true;
};

}  // namespace

SurfaceFile parse_glb(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return GlbParser(bytes, name, options, run).parse();
}

}  // namespace dupin::detail
