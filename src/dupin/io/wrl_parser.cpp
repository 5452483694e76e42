#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "dupin/io/wrl_scene.h"

namespace dupin::detail {
namespace {

// A graph of more nodes costs more memory than the text that describes it.
constexpr std::size_t kMaxNodes = 250'000;

WrlKind kind_of(std::string_view type, bool is_version_1) {
  static const std::unordered_map<std::string_view, WrlKind> kinds = {
      {"Separator", WrlKind::group},
      {"Shape", WrlKind::group},
      {"Anchor", WrlKind::group},
      {"WWWAnchor", WrlKind::group},
      {"Billboard", WrlKind::group},
      {"Collision", WrlKind::group},
      {"TransformSeparator", WrlKind::transform_separator},
      {"Switch", WrlKind::switch_node},
      {"LOD", WrlKind::lod},
      {"Transform", WrlKind::transform},
      {"MatrixTransform", WrlKind::transform},
      {"Translation", WrlKind::transform},
      {"Rotation", WrlKind::transform},
      {"Scale", WrlKind::transform},
      {"Coordinate", WrlKind::coordinate},
      {"Coordinate3", WrlKind::coordinate},
      {"Normal", WrlKind::normal},
      {"ShapeHints", WrlKind::shape_hints},
      {"IndexedFaceSet", WrlKind::face_set},
      {"IndexedLineSet", WrlKind::unsupported},
      {"PointSet", WrlKind::unsupported},
      {"Box", WrlKind::unsupported},
      {"Cube", WrlKind::unsupported},
      {"Cone", WrlKind::unsupported},
      {"Cylinder", WrlKind::unsupported},
      {"Sphere", WrlKind::unsupported},
      {"ElevationGrid", WrlKind::unsupported},
      {"Extrusion", WrlKind::unsupported},
      {"Text", WrlKind::unsupported},
      {"AsciiText", WrlKind::unsupported},
      {"Inline", WrlKind::unsupported},
      {"WWWInline", WrlKind::unsupported}};
  if (type == "Group") return is_version_1 ? WrlKind::open_group : WrlKind::group;
  const auto found = kinds.find(type);
  return found == kinds.end() ? WrlKind::other : found->second;
}

/// Fields of a transform node, in the order of the fields of VRML 2.
struct TransformFields {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector4d rotation{0, 0, 1, 0};
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Vector4d scale_orientation{0, 0, 1, 0};
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  AffineMap matrix;
  bool has_matrix = false;
};

Eigen::Matrix3d rotation_of(const Eigen::Vector4d& axis_angle) {
  return rotation_about(axis_angle.head<3>(), axis_angle[3]);
}

/// p -> T C R SR S SR^-1 C^-1 p (ISO/IEC 14772-1, 6.52 Transform).
AffineMap transform_of(const TransformFields& fields) {
  if (fields.has_matrix) return fields.matrix;
  const Eigen::Matrix3d turn = rotation_of(fields.scale_orientation);
  AffineMap result;
  result.linear =
      rotation_of(fields.rotation) * (turn * fields.scale.asDiagonal() * turn.transpose()).eval();
  result.translation = fields.translation + fields.center - result.linear * fields.center;
  result.is_identity = fields.translation == Eigen::Vector3d::Zero() && fields.rotation[3] == 0.0 &&
                       fields.scale == Eigen::Vector3d::Ones();
  if (result.is_identity) return AffineMap{};
  return result;
}

class Parser {
 public:
  Parser(WrlLexer& lexer, bool is_version_1, const ReadLimits& limits)
      : lexer_(lexer), limits_(limits) {
    scene_.is_version_1 = is_version_1;
    scene_.nodes.emplace_back().kind = WrlKind::group;
  }

  WrlScene parse() {
    while (true) {
      const WrlToken token = lexer_.next();
      if (token.kind == WrlTokenKind::end) break;
      step(token);
    }
    if (!open_.empty()) {
      lexer_.fail(Errc::malformed, "E_TRUNCATED", "the file ends inside the node that starts here",
                  open_.back().byte);
    }
    if (!has_node_) {
      lexer_.fail(Errc::malformed, "E_TRUNCATED", "no node follows the header", lexer_.size());
    }
    return std::move(scene_);
  }

 private:
  /// A node or list whose closing bracket has not come yet.
  struct Open {
    bool is_list = false;
    WrlKind kind = WrlKind::other;
    std::int32_t node = -1;  ///< -1: not kept
    std::string_view name;   ///< by DEF
    std::size_t serial = 0;  ///< of that DEF
    std::size_t byte = 0;
    TransformFields fields;
  };
  /// What a DEF name stands for.
  struct Definition {
    std::int32_t node = -1;
    std::size_t serial = 0;
    bool is_open = true;
  };

  void step(const WrlToken& token) {
    switch (token.kind) {
      case WrlTokenKind::word:
        if (open_.empty() || !open_.back().is_list) {
          read_word(token);
        } else {
          read_list_word(token);
        }
        return;
      case WrlTokenKind::open_bracket:
        if (open_.empty()) lexer_.fail_expected("a node", token);
        open_list(token);
        return;
      case WrlTokenKind::close_bracket:
        if (open_.empty() || !open_.back().is_list) lexer_.fail_expected("a field or node", token);
        open_.pop_back();
        return;
      case WrlTokenKind::close_brace:
        if (open_.empty() || open_.back().is_list) lexer_.fail_expected("a node", token);
        close_node();
        return;
      case WrlTokenKind::open_brace:
        lexer_.fail_expected("the type of a node", token);
      case WrlTokenKind::string:
        if (open_.empty()) lexer_.fail_expected("a node", token);
        return;
      case WrlTokenKind::end:
        return;
    }
  }

  void open_list(const WrlToken& token) {
    Open open;
    open.is_list = true;
    open.byte = token.byte;
    push(std::move(open));
  }

  void push(Open open) {
    // A list and the node around it are one level of the scene.
    std::int64_t depth = 1;
    for (const Open& level : open_) depth += level.is_list ? 0 : 1;
    if ((!open.is_list && depth > limits_.max_nesting) ||
        static_cast<std::int64_t>(open_.size()) >= 2 * std::int64_t{limits_.max_nesting}) {
      lexer_.fail(Errc::over_limit, "E_NESTING",
                  "nodes nested deeper than " + std::to_string(limits_.max_nesting) + " levels",
                  open.byte);
    }
    open_.push_back(std::move(open));
  }

  /// In a list, words are nodes or values of a field that nobody asked for.
  void read_list_word(const WrlToken& token) {
    if (!read_node_word(token) && lexer_.peek().kind == WrlTokenKind::open_brace) {
      open_node(token, {});
    }
  }

  void read_word(const WrlToken& token) {
    if (read_node_word(token)) return;
    if (lexer_.peek().kind == WrlTokenKind::open_brace) {
      open_node(token, {});
      return;
    }
    if (open_.empty()) {
      if (lexer_.peek().kind == WrlTokenKind::end) lexer_.fail_expected("'{'", lexer_.peek());
      lexer_.fail_expected("a node", token);
    }
    field_ = token.text;
    if (open_.back().node >= 0) read_field(token);
  }

  /// DEF, USE, ROUTE and prototypes; false for any other word.
  bool read_node_word(const WrlToken& token) {
    if (token.text == "DEF") {
      const WrlToken name = expect_word("a name");
      const WrlToken type = expect_word("the type of a node");
      if (lexer_.peek().kind != WrlTokenKind::open_brace) {
        lexer_.fail_expected("'{'", lexer_.peek());
      }
      open_node(type, name.text);
    } else if (token.text == "USE") {
      use(expect_word("a name"));
    } else if (token.text == "ROUTE") {
      for (const char* what : {"a source", "TO", "a target"}) expect_word(what);
    } else if (token.text == "PROTO" || token.text == "EXTERNPROTO") {
      expect_word("a name");
      skip_balanced(WrlTokenKind::open_bracket);
      if (token.text == "PROTO") {
        skip_balanced(WrlTokenKind::open_brace);
      } else {
        skip_urls();
      }
      has_node_ = true;
    } else {
      return false;
    }
    return true;
  }

  WrlToken expect_word(const char* what) {
    const WrlToken token = lexer_.next();
    if (token.kind != WrlTokenKind::word) lexer_.fail_expected(what, token);
    return token;
  }

  void skip_balanced(WrlTokenKind opening) {
    WrlToken token = lexer_.next();
    if (token.kind != opening) {
      lexer_.fail_expected(opening == WrlTokenKind::open_brace ? "'{'" : "'['", token);
    }
    std::int64_t braces = opening == WrlTokenKind::open_brace ? 1 : 0;
    std::int64_t brackets = 1 - braces;
    while (braces > 0 || brackets > 0) {
      token = lexer_.next();
      if (token.kind == WrlTokenKind::end) lexer_.fail_expected("the end of a prototype", token);
      if (token.kind == WrlTokenKind::open_brace) ++braces;
      if (token.kind == WrlTokenKind::close_brace) --braces;
      if (token.kind == WrlTokenKind::open_bracket) ++brackets;
      if (token.kind == WrlTokenKind::close_bracket) --brackets;
      if (braces < 0 || brackets < 0) lexer_.fail_expected("the end of a prototype", token);
    }
  }

  void skip_urls() {
    if (lexer_.peek().kind == WrlTokenKind::open_bracket) {
      skip_balanced(WrlTokenKind::open_bracket);
      return;
    }
    const WrlToken token = lexer_.next();
    if (token.kind != WrlTokenKind::string) lexer_.fail_expected("an address", token);
  }

  std::int32_t nearest_node() const {
    for (auto level = open_.rbegin(); level != open_.rend(); ++level) {
      if (!level->is_list) return level->node;
    }
    return 0;
  }

  void link(std::int32_t child) {
    const std::int32_t parent = nearest_node();
    // The proxy of a Collision is what is bumped into, not what is seen.
    if (parent >= 0 && field_ != "proxy") {
      scene_.nodes[static_cast<std::size_t>(parent)].children.push_back(child);
      check_size(++num_links_);
    }
  }

  void check_size(std::size_t size) const {
    if (size > kMaxNodes) {
      lexer_.fail(Errc::over_limit, "E_TOO_LARGE",
                  "more than " + std::to_string(kMaxNodes) + " nodes", lexer_.size());
    }
  }

  void open_node(const WrlToken& type, std::string_view name) {
    lexer_.next();  // the brace
    has_node_ = true;
    Open open;
    open.kind = kind_of(type.text, scene_.is_version_1);
    open.name = name;
    open.byte = type.byte;
    if (open.kind != WrlKind::other) {
      check_size(scene_.nodes.size() + 1);
      open.node = static_cast<std::int32_t>(scene_.nodes.size());
      scene_.nodes.emplace_back().kind = open.kind;
      link(open.node);
    }
    if (!name.empty()) {
      check_size(names_.size() + 1);
      open.serial = ++num_definitions_;
      names_[name] = {open.node, open.serial, true};
    }
    field_ = {};
    push(std::move(open));
  }

  void close_node() {
    const Open& closed = open_.back();
    if (closed.kind == WrlKind::transform) {
      scene_.nodes[static_cast<std::size_t>(closed.node)].payload =
          static_cast<std::int32_t>(scene_.transforms.size());
      scene_.transforms.push_back(transform_of(closed.fields));
    }
    if (!closed.name.empty()) {
      Definition& definition = names_[closed.name];
      if (definition.serial == closed.serial) definition.is_open = false;
    }
    open_.pop_back();
    field_ = {};
  }

  void use(const WrlToken& name) {
    const auto found = names_.find(name.text);
    has_node_ = true;
    if (found == names_.end()) {
      scene_.warnings.add("W_UNKNOWN_NAME", "line " + std::to_string(lexer_.line_of(name.byte)),
                          "USE of a name that no DEF gives: nothing is drawn there");
      return;
    }
    if (found->second.is_open) {
      lexer_.fail(Errc::malformed, "E_CYCLE",
                  "node '" + escaped(name.text, 40) + "' is used inside itself", name.byte);
    }
    if (found->second.node >= 0) link(found->second.node);
    field_ = {};
  }

  void read_field(const WrlToken& word) {
    const auto node = static_cast<std::size_t>(open_.back().node);
    const std::string_view field = word.text;
    switch (open_.back().kind) {
      case WrlKind::coordinate:
        if (field == "point") read_vectors(node);
        return;
      case WrlKind::normal:
        if (field == "vector") read_vectors(node);
        return;
      case WrlKind::face_set:
        read_face_set_field(field, node);
        return;
      case WrlKind::transform:
        read_transform_field(field, open_.back().fields);
        return;
      case WrlKind::switch_node:
        if (field == "whichChoice" || field == "whichChild") {
          const WrlToken token = lexer_.next();
          scene_.nodes[node].choice = static_cast<std::int32_t>(
              std::clamp<std::int64_t>(lexer_.integer(token), -4, 1 << 30));
        }
        return;
      case WrlKind::shape_hints:
        if (field == "vertexOrdering") {
          scene_.nodes[node].is_clockwise = expect_word("an ordering").text == "CLOCKWISE";
        }
        return;
      default:
        return;
    }
  }

  template <int N>
  void read_numbers(Eigen::Matrix<double, N, 1>& values) {
    for (int i = 0; i < N; ++i) {
      const WrlToken token = lexer_.next();
      values[i] = lexer_.number(token);
      check_transform_number(values[i], token.byte);
    }
  }

  // Keeps products of a few of them far from overflow.
  void check_transform_number(double value, std::size_t byte) const {
    if (!(std::abs(value) <= 1e100)) {
      lexer_.fail(Errc::malformed, "E_NUMBER_RANGE", "a transform holds a number beyond 1e100",
                  byte);
    }
  }

  void read_transform_field(std::string_view field, TransformFields& fields) {
    if (field == "translation") {
      read_numbers<3>(fields.translation);
    } else if (field == "rotation") {
      read_numbers<4>(fields.rotation);
    } else if (field == "scale" || field == "scaleFactor") {
      read_numbers<3>(fields.scale);
    } else if (field == "scaleOrientation") {
      read_numbers<4>(fields.scale_orientation);
    } else if (field == "center") {
      read_numbers<3>(fields.center);
    } else if (field == "matrix") {
      // Row vectors from the left: the last row is the translation.
      Eigen::Matrix<double, 16, 1> m;
      read_numbers<16>(m);
      fields.has_matrix = true;
      fields.matrix.is_identity = false;
      for (int row = 0; row < 3; ++row) {
        for (int col = 0; col < 3; ++col) fields.matrix.linear(row, col) = m[4 * col + row];
        fields.matrix.translation[row] = m[12 + row];
      }
    }
  }

  void read_vectors(std::size_t node) {
    WrlVectors list;
    list.byte = lexer_.peek().byte;
    const bool is_bracketed = take(WrlTokenKind::open_bracket);
    while (!(is_bracketed ? take(WrlTokenKind::close_bracket) : list.xyz.size() == 3)) {
      const WrlToken token = lexer_.next();
      list.xyz.push_back(lexer_.number(token));
      if (static_cast<std::int64_t>(list.xyz.size()) > 3 * limits_.max_vertices) {
        too_many("vertices", limits_.max_vertices, token.byte);
      }
    }
    if (list.xyz.size() % 3 != 0) {
      lexer_.fail(Errc::malformed, "E_SYNTAX",
                  "the list that starts here has " + std::to_string(list.xyz.size()) +
                      " numbers, not three for each point",
                  list.byte);
    }
    scene_.nodes[node].payload = static_cast<std::int32_t>(scene_.vectors.size());
    scene_.vectors.push_back(std::move(list));
  }

  void read_face_set_field(std::string_view field, std::size_t node) {
    if (field == "coordIndex") {
      read_faces(node);
    } else if (field == "ccw") {
      scene_.nodes[node].is_clockwise = expect_word("TRUE or FALSE").text == "FALSE";
    } else if (field == "normalPerVertex") {
      if (expect_word("TRUE or FALSE").text == "FALSE") faces_of(node).has_own_normal_order = true;
    } else if (field == "normalIndex") {
      faces_of(node).has_own_normal_order = true;
    }
  }

  WrlFaces& faces_of(std::size_t node) {
    if (scene_.nodes[node].payload < 0) {
      scene_.nodes[node].payload = static_cast<std::int32_t>(scene_.faces.size());
      scene_.faces.emplace_back();
    }
    return scene_.faces[static_cast<std::size_t>(scene_.nodes[node].payload)];
  }

  void read_faces(std::size_t node) {
    const bool has_own_normal_order = faces_of(node).has_own_normal_order;
    WrlFaces list;
    list.has_own_normal_order = has_own_normal_order;
    list.byte = lexer_.peek().byte;
    const bool is_bracketed = take(WrlTokenKind::open_bracket);
    std::int64_t corners = 0;
    const auto end_face = [&] {
      ++(corners > 0 ? list.num_faces : list.num_empty);
      if (corners > 0) list.index.push_back(-1);
      corners = 0;
    };
    while (!(is_bracketed ? take(WrlTokenKind::close_bracket) : corners > 0)) {
      const WrlToken token = lexer_.next();
      const std::int64_t index = lexer_.integer(token);
      if (index == -1) {
        end_face();
      } else if (index < 0 || index > std::numeric_limits<std::int32_t>::max()) {
        lexer_.fail(Errc::malformed, "E_INDEX_RANGE",
                    "face " + std::to_string(list.num_faces) + " uses vertex " +
                        std::string(escaped(token.text, 40)),
                    token.byte);
      } else {
        list.index.push_back(static_cast<std::int32_t>(index));
        ++list.num_corners;
        if (++corners > limits_.max_polygon) {
          too_many("vertices in a face", limits_.max_polygon, token.byte);
        }
      }
      if (list.num_faces > limits_.max_faces) too_many("faces", limits_.max_faces, token.byte);
    }
    if (corners > 0) end_face();
    faces_of(node) = std::move(list);
  }

  bool take(WrlTokenKind kind) {
    if (lexer_.peek().kind != kind) return false;
    lexer_.next();
    return true;
  }

  [[noreturn]] void too_many(const char* what, std::int64_t limit, std::size_t byte) const {
    lexer_.fail(Errc::over_limit, "E_TOO_LARGE", "more than " + std::to_string(limit) + " " + what,
                byte);
  }

  WrlLexer& lexer_;
  const ReadLimits& limits_;
  WrlScene scene_;
  std::vector<Open> open_;
  std::unordered_map<std::string_view, Definition> names_;
  std::string_view field_;  // last word that was not a node
  std::size_t num_definitions_ = 0;
  std::size_t num_links_ = 0;
  bool has_node_ = false;
};

}  // namespace

WrlScene parse_wrl_scene(WrlLexer& lexer, bool is_version_1, const ReadLimits& limits) {
  return Parser(lexer, is_version_1, limits).parse();
}

}  // namespace dupin::detail
