#include <algorithm>
#include <array>

#include "dupin/io/formats.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

// Everything that the format knows and a surface does not need. Files that some of these name are
// never opened.
constexpr std::string_view kIgnored[] = {
    "o",     "g",    "s",        "l",        "p",          "usemtl",    "mtllib", "usemap",
    "vp",    "deg",  "bmat",     "step",     "cstype",     "curv",      "curv2",  "surf",
    "parm",  "trim", "hole",     "scrv",     "sp",         "end",       "con",    "mg",
    "bevel", "lod",  "c_interp", "d_interp", "shadow_obj", "trace_obj", "ctech",  "stech",
    "call",  "csh",  "maplib",   "xyzrgb",   "res",        "bzp",       "bsp",    "cdc"};

class ObjReader {
 public:
  ObjReader(ByteSpan bytes, const std::string& name, const ReadOptions& options,
            const RunControl& run)
      : scanner_(bytes, name, options.limits, {.comment = '#', .has_continuation = true}),
        name_(name),
        options_(options),
        run_(run),
        num_bytes_(static_cast<std::int64_t>(bytes.size())) {}

  SurfaceFile read();

 private:
  void read_vertex();
  void read_face();
  void read_attribute(std::int64_t count, const char* what);
  Location here() const { return {name_, scanner_.line(), -1}; }

  // The furthest vertex that a face named before it was there: legal if it comes later.
  struct Forward {
    std::int64_t vertex = -1;
    std::int64_t face = 0;
    std::int64_t line = 0;
  };

  TextScanner scanner_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  std::int64_t num_bytes_;
  PointList points_;
  FaceList faces_;
  SurfaceFile file_;
  Forward forward_;
  std::int64_t num_texture_ = 0;
  std::int64_t num_normals_ = 0;
};

SurfaceFile ObjReader::read() {
  for (std::uint32_t lines = 0; scanner_.next_line(); ++lines) {
    if ((lines & 0xFFFFU) == 0) check_run(run_, scanner_.byte(), num_bytes_);
    const std::string_view keyword = scanner_.word("a keyword");
    if (keyword == "v") {
      read_vertex();
    } else if (keyword == "f" || keyword == "fo") {
      read_face();
    } else if (keyword == "vt") {
      ++num_texture_;
    } else if (keyword == "vn") {
      ++num_normals_;
    } else if (std::find(std::begin(kIgnored), std::end(kIgnored), keyword) == std::end(kIgnored)) {
      if (keyword.find('\0') != std::string_view::npos) {
        scanner_.fail_syntax("NUL byte in a text file");
      }
      scanner_.fail_syntax("unknown keyword '" + escaped(keyword, 40) + "'");
    }
  }
  const std::int64_t num_vertices = points_.size();
  if (forward_.vertex >= num_vertices) {
    fail_index(forward_.face, forward_.vertex, num_vertices, {name_, forward_.line, -1});
  }
  if (scanner_.is_unterminated()) {
    file_.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner_.line()),
                       "the last line has no line end; its last number may be cut");
  }
  file_.format = "obj";
  file_.mesh.points = points_.take();
  faces_.move_to(file_.mesh);
  return std::move(file_);
}

void ObjReader::read_vertex() {
  double place[3];
  scanner_.numbers(place, 3, "a coordinate");
  const auto [x, y, z] = place;
  while (!scanner_.at_line_end()) scanner_.number("a weight or colour");
  if (!is_finite(x, y, z) && !options_.drop_nonfinite) fail_nonfinite(points_.size(), here());
  if (points_.size() >= std::min(options_.limits.max_vertices, kMaxIndex)) {
    fail_limit("vertices", options_.limits.max_vertices, here());
  }
  points_.add(x, y, z);
}

void ObjReader::read_attribute(std::int64_t count, const char* what) {
  const std::int64_t given = scanner_.index(what, '/');
  if (given != 0 && given <= count && given >= -count) return;
  file_.warnings.add("W_ATTR_INDEX", "line " + std::to_string(scanner_.line()),
                     "texture or normal indices out of range were ignored");
}

void ObjReader::read_face() {
  const std::int64_t face = faces_.num_faces();
  if (face >= std::min(options_.limits.max_faces, kMaxIndex)) {
    fail_limit("faces", options_.limits.max_faces, here());
  }
  std::int64_t num_corners = 0;
  for (; !scanner_.at_line_end(); ++num_corners) {
    if (num_corners == options_.limits.max_polygon) {
      fail_polygon(face, num_corners + 1, options_.limits, here());
    }
    const std::int64_t given = scanner_.index("a vertex index", '/');
    const std::int64_t num_vertices = points_.size();
    const std::int64_t vertex = given < 0 ? num_vertices + given : given - 1;
    // Seen as unsigned, everything below 0 is far above.
    if (static_cast<std::uint64_t>(vertex) >= static_cast<std::uint64_t>(num_vertices)) {
      if (given <= 0 || vertex >= kMaxIndex) {
        scanner_.fail(Errc::malformed, "E_INDEX_RANGE",
                      "face " + std::to_string(face) + " uses vertex " + std::to_string(given) +
                          ", but there are " + std::to_string(num_vertices) +
                          " vertices, counted from 1");
      }
      if (vertex > forward_.vertex) forward_ = {vertex, face, scanner_.line()};
    }
    faces_.add_index(static_cast<std::int32_t>(vertex));
    if (!scanner_.take('/')) continue;
    if (scanner_.take('/')) {
      read_attribute(num_normals_, "a normal index");
    } else {
      read_attribute(num_texture_, "a texture index");
      if (scanner_.take('/')) read_attribute(num_normals_, "a normal index");
    }
  }
  if (num_corners < 3) {
    scanner_.fail_syntax("a face of " + std::to_string(num_corners) + " vertices");
  }
  faces_.end_face();
}

}  // namespace

SurfaceFile parse_obj(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return ObjReader(bytes, name, options, run).read();
}

}  // namespace dupin::detail
