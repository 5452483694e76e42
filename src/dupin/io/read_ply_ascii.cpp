// The ascii body of a PLY file.
#include <algorithm>

#include "dupin/io/ply_body.h"

namespace dupin::detail {
namespace {

constexpr std::int64_t kLeastTriangleLine = 8;  // "3 0 1 2\n"

}  // namespace

void PlyBody::next_ascii(TextScanner& scanner, std::int64_t index) {
  scanner.element.index = index;
  if (!scanner.next_line()) {
    scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends too early");
  }
  if (index % kPlyRunStride == 0) {
    check_run(run_, scanner.byte(), static_cast<std::int64_t>(bytes_.size()));
  }
}

std::int64_t PlyBody::ascii_list_count(TextScanner& scanner, std::int64_t bytes_each) {
  const std::int64_t count = scanner.index("the size of a list");
  if (count < 0) {
    scanner.fail(Errc::malformed, "E_LIST_COUNT", "a list of " + std::to_string(count));
  }
  if (count > options_.limits.max_polygon && count > scanner.bytes_left() / bytes_each) {
    scanner.fail(Errc::over_limit, "E_COUNT_EXCEEDS_FILE",
                 "a list claims " + std::to_string(count) + " values");
  }
  return count;
}

void PlyBody::read_ascii() {
  TextScanner scanner(bytes_.subspan(at_), name_, options_.limits, {}, header_.first_line,
                      static_cast<std::int64_t>(at_));
  for (const PlyElement& element : header_.elements) {
    allocate(element, element.least_ascii_bytes(), scanner.bytes_left(), {name_, element.line, -1});
    scanner.element = {element.name.c_str(), 0, element.count};
    if (element.name == "vertex") {
      read_ascii_vertices(scanner, element);
    } else if (element.name == "face") {
      read_ascii_faces(scanner, element);
    } else {
      skip_ascii(scanner, element);
    }
  }
  scanner.element = {};
  if (scanner.next_line()) {
    file_.warnings.add("W_TRAILING_DATA", "line " + std::to_string(scanner.line()),
                       "text after the last element was ignored");
  } else if (scanner.is_unterminated() && !header_.elements.empty()) {
    file_.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner.line()),
                       "the last line has no line end; its last number may be cut");
  }
}

void PlyBody::read_ascii_vertices(TextScanner& scanner, const PlyElement& element) {
  const std::vector<PlyRole> roles = roles_of(element);
  const bool starts_with_place =
      roles.size() >= 3 && roles[0].slot == 0 && roles[1].slot == 1 && roles[2].slot == 2;
  for (std::int64_t vertex = 0; vertex < element.count; ++vertex) {
    next_ascii(scanner, vertex);
    double values[kPlySlots] = {};
    std::size_t next_role = 0;
    if (starts_with_place) {
      scanner.numbers(values, 3, "a number");
      next_role = 3;
    }
    for (; next_role < roles.size(); ++next_role) {
      const PlyRole& role = roles[next_role];
      if (role.is_list) {
        for (std::int64_t n = ascii_list_count(scanner, 2); n > 0; --n) scanner.number("a value");
        continue;
      }
      const double value = scanner.number("a number");
      if (role.slot >= 0) values[role.slot] = value;
    }
    scanner.expect_line_end();
    if (!is_finite(values[0], values[1], values[2]) && !options_.drop_nonfinite) {
      fail_nonfinite(vertex, {name_, scanner.line(), -1});
    }
    store(vertex, values);
  }
}

void PlyBody::read_ascii_faces(TextScanner& scanner, const PlyElement& element) {
  const std::vector<PlyRole> roles = roles_of(element);
  const bool may_be_plain = roles.size() == 1 && roles[0].is_index_list;
  for (std::int64_t face = 0; face < element.count; ++face) {
    if (may_be_plain && faces_.has_only_triangles()) {
      face += take_triangles(scanner, element.count - face);
    }
    if (face == element.count) break;
    next_ascii(scanner, face);
    for (const PlyRole& role : roles) {
      if (!role.is_list) {
        scanner.number("a number");
        continue;
      }
      std::int64_t count = ascii_list_count(scanner, 2);
      if (!role.is_index_list) {
        for (; count > 0; --count) scanner.number("a value");
        continue;
      }
      if (count > options_.limits.max_polygon) {
        fail_polygon(face, count, options_.limits, {name_, scanner.line(), -1});
      }
      if (count == 3) {
        std::int64_t corners[3];
        scanner.indices(corners, 3, "a vertex index");
        const auto most = static_cast<std::uint64_t>(num_vertices_);
        for (const std::int64_t vertex : corners) {
          if (static_cast<std::uint64_t>(vertex) >= most) {
            fail_index(face, vertex, num_vertices_, {name_, scanner.line(), -1});
          }
        }
        faces_.add_triangle(static_cast<std::int32_t>(corners[0]),
                            static_cast<std::int32_t>(corners[1]),
                            static_cast<std::int32_t>(corners[2]));
        continue;
      }
      for (; count > 0; --count) {
        const std::int64_t vertex = scanner.index("a vertex index");
        if (vertex < 0 || vertex >= num_vertices_) {
          fail_index(face, vertex, num_vertices_, {name_, scanner.line(), -1});
        }
        faces_.add_index(static_cast<std::int32_t>(vertex));
      }
      faces_.end_face();
    }
    scanner.expect_line_end();
  }
}

// Plain lines of triangles, nearly all that there are in most files, a run at a time.
std::int64_t PlyBody::take_triangles(TextScanner& scanner, std::int64_t count) {
  std::int64_t all = 0;
  while (all < count) {
    check_run(run_, scanner.byte(), static_cast<std::int64_t>(bytes_.size()));
    const std::int64_t room =
        std::min({count - all, kPlyRunStride, scanner.bytes_left() / kLeastTriangleLine});
    const std::int64_t taken = scanner.triangle_lines(faces_.triangles(room), room, num_vertices_);
    faces_.keep_triangles(taken);
    all += taken;
    if (taken < room || room == 0) break;
  }
  return all;
}

void PlyBody::skip_ascii(TextScanner& scanner, const PlyElement& element) {
  for (std::int64_t index = 0; index < element.count; ++index) {
    next_ascii(scanner, index);
    for (const PlyProperty& property : element.properties) {
      std::int64_t count = property.is_list ? ascii_list_count(scanner, 2) : 1;
      for (; count > 0; --count) scanner.number("a value");
    }
    scanner.expect_line_end();
  }
}

}  // namespace dupin::detail
