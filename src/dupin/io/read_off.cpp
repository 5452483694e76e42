#include "dupin/io/formats.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

constexpr std::int64_t kRunStride = 1 << 16;

struct OffHeader {
  bool has_normals = false;
  std::int64_t num_vertices = 0;
  std::int64_t num_faces = 0;
};

// "[ST][C][N]OFF", then the counts on the same line, on the next, or (in ModelNet) glued to it.
OffHeader parse_off_header(TextScanner& scanner) {
  OffHeader header;
  if (!scanner.next_line()) scanner.fail(Errc::malformed, "E_TRUNCATED", "the file is blank");
  const std::string_view word = scanner.peek_word();
  const auto take_text = [&](std::string_view text) {
    if (!scanner.peek_word().starts_with(text)) return false;
    for (const char c : text) scanner.take(c);
    return true;
  };
  take_text("ST");
  take_text("C");
  header.has_normals = take_text("N");
  const bool is_projective = take_text("4");
  const bool is_general = take_text("n");
  if (!take_text("OFF")) {
    if (std::string_view("OFF").starts_with(word) && scanner.bytes_left() <= 3) {
      scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends within its first word");
    }
    scanner.fail(Errc::malformed, "E_MAGIC", "not an OFF file: it does not begin with 'OFF'");
  }
  if (is_projective || is_general) {
    scanner.fail(Errc::malformed, "E_HEADER", "points that are not of three coordinates");
  }
  if (scanner.peek_word() == "BINARY") {
    scanner.fail(Errc::malformed, "E_HEADER", "binary OFF is not supported");
  }
  if (scanner.at_line_end() && !scanner.next_line()) {
    scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends before the counts");
  }
  header.num_vertices = scanner.count("the count of vertices");
  header.num_faces = scanner.count("the count of faces");
  if (!scanner.at_line_end()) scanner.count("the count of edges");
  scanner.expect_line_end();
  return header;
}

void next_element(TextScanner& scanner, std::int64_t index, const RunControl& run,
                  std::int64_t num_bytes) {
  scanner.element.index = index;
  if (!scanner.next_line()) {
    scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends too early");
  }
  if (index % kRunStride == 0) check_run(run, scanner.byte(), num_bytes);
}

}  // namespace

SurfaceFile parse_off(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  TextScanner scanner(bytes, name, options.limits, {.comment = '#'});
  const auto num_bytes = static_cast<std::int64_t>(bytes.size());
  const OffHeader header = parse_off_header(scanner);
  // Three numbers and three ends a vertex; a size and an end a face.
  const Location counts{name, scanner.line(), -1};
  check_claim("vertices", header.num_vertices, options.limits.max_vertices, 6, scanner.bytes_left(),
              counts);
  check_claim("faces", header.num_faces, options.limits.max_faces, 2, scanner.bytes_left(), counts);

  SurfaceFile file;
  file.format = "off";
  PolygonMesh& mesh = file.mesh;
  const std::int64_t capacity = safe_capacity(header.num_vertices, 6, scanner.bytes_left());
  mesh.points.resize(capacity, 3);
  if (header.has_normals) mesh.normals.resize(capacity, 3);
  scanner.element = {"vertex", 0, header.num_vertices};
  for (std::int64_t vertex = 0; vertex < header.num_vertices; ++vertex) {
    next_element(scanner, vertex, run, num_bytes);
    double* const point = mesh.points.data() + 3 * vertex;
    for (int axis = 0; axis < 3; ++axis) point[axis] = scanner.number("a coordinate");
    if (!is_finite(point[0], point[1], point[2]) && !options.drop_nonfinite) {
      fail_nonfinite(vertex, {name, scanner.line(), -1});
    }
    if (header.has_normals) {
      double* const normal = mesh.normals.data() + 3 * vertex;
      for (int axis = 0; axis < 3; ++axis) normal[axis] = scanner.number("a normal");
      if (!is_finite(normal[0], normal[1], normal[2])) {
        std::fill(normal, normal + 3, 0.0);
        file.warnings.add("W_ATTR_NONFINITE", "vertex " + std::to_string(vertex),
                          "normals that are not finite were set to zero");
      }
    }
    while (!scanner.at_line_end()) scanner.number("a colour or texture coordinate");
  }

  FaceList faces;
  faces.reserve_indices(
      std::min(kMaxIndex, safe_capacity(3 * header.num_faces, 2, scanner.bytes_left())));
  scanner.element = {"face", 0, header.num_faces};
  for (std::int64_t face = 0; face < header.num_faces; ++face) {
    next_element(scanner, face, run, num_bytes);
    const std::int64_t size = scanner.index("the size of a face");
    if (size < 0) {
      scanner.fail(Errc::malformed, "E_LIST_COUNT", "a face of " + std::to_string(size));
    }
    if (size > options.limits.max_polygon) {
      check_claim("indices", size, options.limits.max_polygon, 2, scanner.bytes_left(),
                  {name, scanner.line(), -1});
      fail_polygon(face, size, options.limits, {name, scanner.line(), -1});
    }
    for (std::int64_t corner = 0; corner < size; ++corner) {
      const std::int64_t vertex = scanner.index("a vertex index");
      if (vertex < 0 || vertex >= header.num_vertices) {
        fail_index(face, vertex, header.num_vertices, {name, scanner.line(), -1});
      }
      faces.add_index(static_cast<std::int32_t>(vertex));
    }
    while (!scanner.at_line_end()) scanner.number("a colour");
    faces.end_face();
  }
  scanner.element = {};
  if (scanner.next_line()) {
    file.warnings.add("W_TRAILING_DATA", "line " + std::to_string(scanner.line()),
                      "text after the last face was ignored");
  } else if (scanner.is_unterminated()) {
    file.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner.line()),
                      "the last line has no line end; its last number may be cut");
  }
  faces.move_to(mesh);
  return file;
}

}  // namespace dupin::detail
