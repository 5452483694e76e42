#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <initializer_list>

#include "dupin/io/byte_loads.h"
#include "dupin/io/formats.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

constexpr std::int64_t kHeaderBytes = 84;
constexpr std::int64_t kFacetBytes = 50;
constexpr bool kSwap = std::endian::native == std::endian::big;

// Gives each place one number, in the order of first appearance. Places are equal when their bits
// are, with -0 as 0; so two facets never weld by tolerance, and reading what was written welds the
// same way again.
class Welder {
 public:
  std::int32_t add(double x, double y, double z) {
    if (2 * (points_.size() + 1) > static_cast<std::int64_t>(table_.size())) grow();
    // Adding zero turns -0 into 0 and leaves everything else.
    const std::array<double, 3> place{x + 0.0, y + 0.0, z + 0.0};
    std::size_t slot = hash(place.data()) & (table_.size() - 1);
    while (table_[slot] >= 0) {
      if (std::memcmp(points_.row(table_[slot]), place.data(), sizeof(place)) == 0) {
        return table_[slot];
      }
      slot = (slot + 1) & (table_.size() - 1);
    }
    table_[slot] = static_cast<std::int32_t>(points_.size());
    points_.add(place[0], place[1], place[2]);
    return table_[slot];
  }
  std::int64_t size() const { return points_.size(); }
  Points take() { return points_.take(); }

 private:
  static std::size_t hash(const double* place) {
    std::uint64_t bits[3];
    std::memcpy(bits, place, sizeof(bits));
    std::uint64_t h = bits[0] * 0x9E3779B97F4A7C15U;
    h = (h ^ (h >> 32U) ^ bits[1]) * 0xC2B2AE3D27D4EB4FU;
    h = (h ^ (h >> 29U) ^ bits[2]) * 0x165667B19E3779F9U;
    return static_cast<std::size_t>(h ^ (h >> 31U));
  }
  void grow() {
    table_.assign(std::max<std::size_t>(1024, 2 * table_.size()), -1);
    for (std::int64_t point = 0; point < points_.size(); ++point) {
      std::size_t slot = hash(points_.row(point)) & (table_.size() - 1);
      while (table_[slot] >= 0) slot = (slot + 1) & (table_.size() - 1);
      table_[slot] = static_cast<std::int32_t>(point);
    }
  }

  PointList points_;
  std::vector<std::int32_t> table_;
};

class StlReader {
 public:
  StlReader(ByteSpan bytes, const std::string& name, const ReadOptions& options,
            const RunControl& run)
      : bytes_(bytes), name_(name), options_(options), run_(run) {}

  SurfaceFile read_binary();
  SurfaceFile read_text();

 private:
  void add_corner(std::size_t corner, double x, double y, double z, const Location& location);
  void add_facet(const Location& location);
  std::string_view next_word(TextScanner& scanner, const char* what) const;
  bool take_keyword(TextScanner& scanner, std::initializer_list<std::string_view> expected);
  void read_facet(TextScanner& scanner);
  SurfaceFile finish(bool is_binary);

  ByteSpan bytes_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  SurfaceFile file_;
  Welder welder_;
  FaceList faces_;
  std::array<std::int32_t, 3> corners_{};
};

void StlReader::add_corner(std::size_t corner, double x, double y, double z,
                           const Location& location) {
  if (!is_finite(x, y, z) && !options_.drop_nonfinite) fail_nonfinite(welder_.size(), location);
  corners_[corner] = welder_.add(x, y, z);
  if (welder_.size() > std::min(options_.limits.max_vertices, kMaxIndex)) {
    fail_limit("vertices", options_.limits.max_vertices, location);
  }
}

void StlReader::add_facet(const Location& location) {
  if (faces_.num_faces() >= std::min(options_.limits.max_faces, kMaxIndex / 3)) {
    fail_limit("faces", options_.limits.max_faces, location);
  }
  faces_.add_triangle(corners_[0], corners_[1], corners_[2]);
  if (faces_.num_faces() % 65536 == 0) {
    check_run(run_, location.byte, static_cast<std::int64_t>(bytes_.size()));
  }
}

SurfaceFile StlReader::finish(bool is_binary) {
  file_.format = "stl";
  file_.is_binary = is_binary;
  file_.mesh.points = welder_.take();
  faces_.move_to(file_.mesh);
  return std::move(file_);
}

SurfaceFile StlReader::read_binary() {
  const auto size = static_cast<std::int64_t>(bytes_.size());
  const auto fail_truncated = [&](const std::string& where) {
    throw IoError(Errc::malformed, "E_TRUNCATED", "the file ends within " + where,
                  {name_, 0, size});
  };
  if (size < kHeaderBytes) fail_truncated("the header of " + std::to_string(kHeaderBytes));
  const std::int64_t count = load<std::uint32_t, kSwap>(bytes_.data() + 80);
  const std::int64_t left = size - kHeaderBytes;
  check_claim("faces", count, options_.limits.max_faces, kFacetBytes, left, {name_, 0, 80});
  if (left / kFacetBytes < count) {
    fail_truncated("face " + std::to_string(left / kFacetBytes) + " of " + std::to_string(count));
  }
  faces_.reserve_indices(std::min(3 * count, kMaxIndex));
  for (std::int64_t facet = 0; facet < count; ++facet) {
    const std::int64_t start = kHeaderBytes + facet * kFacetBytes;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint8_t* const at =
          bytes_.data() + static_cast<std::size_t>(start) + 12 * (corner + 1);
      add_corner(corner, load_real<float, kSwap>(at), load_real<float, kSwap>(at + 4),
                 load_real<float, kSwap>(at + 8), {name_, 0, at - bytes_.data()});
    }
    add_facet({name_, 0, start});
  }
  const std::int64_t rest = left - count * kFacetBytes;
  if (rest > 0) {
    file_.warnings.add("W_TRAILING_DATA", "byte " + std::to_string(size - rest),
                       std::to_string(rest) + " bytes after the last face were ignored");
  }
  return finish(true);
}

// Words may stand on any line: some writers put a whole facet on one.
std::string_view StlReader::next_word(TextScanner& scanner, const char* what) const {
  if (scanner.at_line_end() && !scanner.next_line()) {
    scanner.fail(Errc::malformed, "E_TRUNCATED",
                 std::string("expected ") + what + ", but the file ends here");
  }
  return scanner.word(what);
}

bool is_same_word(std::string_view word, std::string_view lower) {
  return std::equal(word.begin(), word.end(), lower.begin(), lower.end(), [](char a, char b) {
    return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b;
  });
}

// Takes the first of `expected`; false if it is the second one.
bool StlReader::take_keyword(TextScanner& scanner,
                             std::initializer_list<std::string_view> expected) {
  const std::string first(*expected.begin());
  const std::string_view word = next_word(scanner, first.c_str());
  for (const std::string_view& keyword : expected) {
    if (is_same_word(word, keyword)) return &keyword == expected.begin();
    if (scanner.bytes_left() <= 1 && keyword.starts_with(word)) {
      scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends within a word");
    }
  }
  if (word.find('\0') != std::string_view::npos) scanner.fail_syntax("NUL byte in a text file");
  scanner.fail_syntax("expected '" + first + "', found '" + escaped(word, 40) + "'");
}

void StlReader::read_facet(TextScanner& scanner) {
  take_keyword(scanner, {"normal"});
  // Normals are not used, and degenerate facets carry every spelling of NaN there.
  for (int axis = 0; axis < 3; ++axis) next_word(scanner, "a normal");
  take_keyword(scanner, {"outer"});
  take_keyword(scanner, {"loop"});
  for (std::size_t corner = 0; corner < 3; ++corner) {
    take_keyword(scanner, {"vertex"});
    double place[3];
    for (double& coordinate : place) {
      if (scanner.at_line_end() && !scanner.next_line()) scanner.fail_expected("a coordinate");
      coordinate = scanner.number("a coordinate");
    }
    add_corner(corner, place[0], place[1], place[2], {name_, scanner.line(), -1});
  }
  take_keyword(scanner, {"endloop"});
  take_keyword(scanner, {"endfacet"});
  add_facet({name_, scanner.line(), scanner.byte()});
}

SurfaceFile StlReader::read_text() {
  TextScanner scanner(bytes_, name_, options_.limits);
  scanner.element.name = "face";
  bool has_next = scanner.next_line();
  while (has_next) {
    take_keyword(scanner, {"solid"});
    scanner.rest_of_line();
    while (take_keyword(scanner, {"facet", "endsolid"})) {
      read_facet(scanner);
      scanner.element.index = faces_.num_faces();
    }
    scanner.rest_of_line();
    has_next = scanner.next_line();
  }
  return finish(false);
}

// Many exporters begin the header of a binary file with "solid" too. Text has no NUL.
bool is_binary_stl(ByteSpan bytes) {
  const auto size = static_cast<std::int64_t>(bytes.size());
  if (size >= kHeaderBytes) {
    const std::int64_t count = load<std::uint32_t, kSwap>(bytes.data() + 80);
    if (kHeaderBytes + count * kFacetBytes == size) return true;
  }
  std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                        std::min<std::size_t>(bytes.size(), 1024));
  if (text.find('\0') != std::string_view::npos) return true;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
  const std::string_view word = text.substr(0, 5);
  return !is_same_word(word, std::string_view("solid").substr(0, word.size()));
}

}  // namespace

SurfaceFile parse_stl(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  StlReader reader(bytes, name, options, run);
  return is_binary_stl(bytes) ? reader.read_binary() : reader.read_text();
}

}  // namespace dupin::detail
