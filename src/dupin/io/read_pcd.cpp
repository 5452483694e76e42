#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"
#include "dupin/io/little_endian.h"
#include "dupin/io/lzf.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{1} << 16;
constexpr std::int64_t kMaxPointBytes = std::int64_t{1} << 16;
constexpr std::int64_t kRunStride = 1 << 14;
constexpr std::array<std::string_view, 6> kWanted = {"x",        "y",        "z",
                                                     "normal_x", "normal_y", "normal_z"};

struct Field {
  std::string name;
  int size = 4;
  char type = 'F';
  std::int64_t count = 1;
  std::int64_t offset = 0;  ///< in a point
};

enum class Storage { ascii, binary, compressed };

struct Header {
  std::vector<Field> fields;
  std::int64_t num_points = -1;
  std::int64_t point_bytes = 0;
  Storage storage = Storage::ascii;
  std::array<int, 6> wanted{-1, -1, -1, -1, -1, -1};  ///< field of each of kWanted
  std::size_t data = 0;                               ///< where the points start
  std::int64_t data_line = 1;
  bool has_normals() const {
    return std::all_of(wanted.begin() + 3, wanted.end(), [](int field) { return field >= 0; });
  }
};

/// The Point Cloud Library's PCD, versions .5 to .7. Points without finite coordinates are the
/// format's way to say "no measurement": they are left out and counted.
class PcdParser {
 public:
  PcdParser(ByteSpan bytes, const std::string& name, const ReadOptions& options,
            const RunControl& run)
      : bytes_(bytes), name_(name), options_(options), run_(run) {}

  SurfaceFile parse() {
    parse_header();
    file_.format = "pcd";
    file_.is_binary = header_.storage != Storage::ascii;
    switch (header_.storage) {
      case Storage::ascii:
        read_ascii();
        break;
      case Storage::binary:
        read_binary();
        break;
      case Storage::compressed:
        read_compressed();
        break;
    }
    if (num_invalid_ > 0) {
      file_.warnings.add("W_INVALID_POINTS", "point " + std::to_string(first_invalid_),
                         "points without finite coordinates are left out", num_invalid_);
    }
    file_.mesh.points = points_.take();
    file_.mesh.normals.resize(0, 3);
    if (header_.has_normals()) file_.mesh.normals = normals_.take();
    return std::move(file_);
  }

 private:
  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message,
                         std::size_t byte) const {
    throw IoError(errc, code, message, Location{name_, 0, static_cast<std::int64_t>(byte)});
  }

  /// The header ends with the line DATA; what follows may be binary.
  ByteSpan header_bytes() const {
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()),
                                std::min(bytes_.size(), kMaxHeaderBytes));
    std::size_t at = text.starts_with("DATA") ? 0 : text.find("\nDATA");
    if (at != std::string_view::npos) at = text.find('\n', at + 1);
    if (at == std::string_view::npos) {
      if (bytes_.size() < kMaxHeaderBytes) {
        fail(Errc::malformed, "E_TRUNCATED", "the file ends inside its header", bytes_.size());
      }
      fail(Errc::malformed, "E_HEADER", "no DATA line in the first 64 KiB", 0);
    }
    return bytes_.first(at + 1);
  }

  void parse_header() {
    const ByteSpan head = header_bytes();
    TextScanner scanner(head, name_, options_.limits, {.comment = '#'});
    std::int64_t width = -1;
    std::int64_t height = 1;
    std::array<bool, 3> has_list{};  // SIZE, TYPE, COUNT
    bool has_data = false;
    while (scanner.next_line()) {
      const std::string key(scanner.word("a keyword"));
      if (key == "FIELDS" || key == "COLUMNS") {
        header_.fields.clear();
        while (!scanner.at_line_end()) {
          header_.fields.emplace_back().name = std::string(scanner.word("a field"));
        }
      } else if (key == "SIZE" || key == "TYPE" || key == "COUNT") {
        has_list[key == "SIZE" ? 0 : key == "TYPE" ? 1 : 2] = true;
        for (Field& field : header_.fields) read_property(scanner, key, field);
        scanner.expect_line_end();
      } else if (key == "WIDTH") {
        width = scanner.count("the width");
      } else if (key == "HEIGHT") {
        height = scanner.count("the height");
      } else if (key == "POINTS") {
        header_.num_points = scanner.count("the number of points");
      } else if (key == "DATA") {
        read_storage(scanner);
        has_data = true;
      } else if (key != "VERSION" && key != "VIEWPOINT") {
        scanner.fail(Errc::malformed, "E_HEADER", "unknown keyword '" + escaped(key, 40) + "'");
      }
      header_.data_line = scanner.line() + 1;
    }
    header_.data = head.size();
    if (!has_data || !has_list[0] || !has_list[1]) {
      fail(Errc::malformed, "E_HEADER", "the header lacks SIZE, TYPE or DATA", 0);
    }
    settle_size(width, height);
    settle_fields();
  }

  static void read_property(TextScanner& scanner, const std::string& key, Field& field) {
    if (key == "TYPE") {
      const std::string_view type = scanner.word("a type");
      if (type != "F" && type != "I" && type != "U") scanner.fail_syntax("a type is F, I or U");
      field.type = type[0];
      return;
    }
    const std::int64_t value = scanner.count("a size or count");
    if (key == "COUNT") {
      if (value > kMaxPointBytes) {
        scanner.fail(Errc::malformed, "E_NUMBER_RANGE", "a field of that many numbers");
      }
      field.count = value;
      return;
    }
    if (value != 1 && value != 2 && value != 4 && value != 8) {
      scanner.fail(Errc::malformed, "E_HEADER", "a number has 1, 2, 4 or 8 bytes");
    }
    field.size = static_cast<int>(value);
  }

  void read_storage(TextScanner& scanner) {
    const std::string_view storage = scanner.word("ascii, binary or binary_compressed");
    if (storage == "ascii") {
      header_.storage = Storage::ascii;
    } else if (storage == "binary") {
      header_.storage = Storage::binary;
    } else if (storage == "binary_compressed") {
      header_.storage = Storage::compressed;
    } else {
      scanner.fail(
          Errc::malformed, "E_HEADER",
          "DATA is ascii, binary or binary_compressed, not '" + escaped(storage, 40) + "'");
    }
  }

  void settle_size(std::int64_t width, std::int64_t height) {
    constexpr std::int64_t most = std::int64_t{1} << 62;
    if (width >= 0 && height > 0 && width > most / height) {
      fail(Errc::over_limit, "E_COUNT_EXCEEDS_FILE", "WIDTH x HEIGHT is beyond any file", 0);
    }
    const std::int64_t area = width < 0 ? -1 : width * height;
    if (header_.num_points < 0) header_.num_points = area;
    if (header_.num_points < 0) fail(Errc::malformed, "E_HEADER", "neither POINTS nor WIDTH", 0);
    if (area >= 0 && area != header_.num_points) {
      fail(Errc::malformed, "E_HEADER",
           "WIDTH x HEIGHT is " + std::to_string(area) + ", POINTS " +
               std::to_string(header_.num_points),
           0);
    }
  }

  void settle_fields() {
    for (std::size_t i = 0; i < header_.fields.size(); ++i) {
      Field& field = header_.fields[i];
      if (field.type == 'F' && field.size < 4) {
        fail(Errc::malformed, "E_HEADER", "a float of less than 4 bytes", 0);
      }
      field.offset = header_.point_bytes;
      header_.point_bytes += field.size * field.count;
      if (header_.point_bytes > kMaxPointBytes) {
        fail(Errc::over_limit, "E_TOO_LARGE", "a point of more than 65536 bytes", 0);
      }
      const auto wanted = std::find(kWanted.begin(), kWanted.end(), field.name);
      if (wanted == kWanted.end() || field.count != 1) continue;
      int& slot = header_.wanted[static_cast<std::size_t>(wanted - kWanted.begin())];
      if (slot < 0) slot = static_cast<int>(i);
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (header_.wanted[static_cast<std::size_t>(axis)] < 0) {
        fail(Errc::malformed, "E_HEADER", "no single field x, y or z", 0);
      }
    }
  }

  void add(std::int64_t point, const std::array<double, 6>& values) {
    if (!is_finite(values[0], values[1], values[2])) {
      if (num_invalid_++ == 0) first_invalid_ = point;
      return;
    }
    points_.add(values[0], values[1], values[2]);
    if (!header_.has_normals()) return;
    if (is_finite(values[3], values[4], values[5])) {
      normals_.add(values[3], values[4], values[5]);
    } else {
      normals_.add(0.0, 0.0, 0.0);
    }
  }

  void claim(std::int64_t least_bytes) {
    const auto left = static_cast<std::int64_t>(bytes_.size() - header_.data);
    check_claim("vertices", header_.num_points, options_.limits.max_vertices, least_bytes, left,
                {name_, 0, static_cast<std::int64_t>(header_.data)});
  }

  void reserve() {
    points_.reserve(header_.num_points);
    if (header_.has_normals()) normals_.reserve(header_.num_points);
  }

  void read_ascii() {
    std::int64_t columns = 0;
    for (const Field& field : header_.fields) columns += field.count;
    claim(2 * columns);
    std::vector<int> slot_of_column;
    for (std::size_t i = 0; i < header_.fields.size(); ++i) {
      const auto wanted =
          std::find(header_.wanted.begin(), header_.wanted.end(), static_cast<int>(i));
      const int slot =
          wanted == header_.wanted.end() ? -1 : static_cast<int>(wanted - header_.wanted.begin());
      slot_of_column.insert(slot_of_column.end(), static_cast<std::size_t>(header_.fields[i].count),
                            slot);
    }
    TextScanner scanner(bytes_.subspan(header_.data), name_, options_.limits, {.comment = '#'},
                        header_.data_line, static_cast<std::int64_t>(header_.data));
    for (std::int64_t point = 0; point < header_.num_points; ++point) {
      if (!scanner.next_line()) {
        scanner.fail(Errc::malformed, "E_TRUNCATED",
                     "point " + std::to_string(point) + " of " +
                         std::to_string(header_.num_points) + " is missing");
      }
      if (point % kRunStride == 0) {
        check_run(run_, scanner.byte(), static_cast<std::int64_t>(bytes_.size()));
      }
      std::array<double, 6> values{};
      for (const int slot : slot_of_column) {
        const double value = scanner.number("a number");
        if (slot >= 0) values[static_cast<std::size_t>(slot)] = value;
      }
      scanner.expect_line_end();
      add(point, values);
    }
    if (scanner.next_line()) {
      trailing("line " + std::to_string(scanner.line()));
    } else if (scanner.is_unterminated() && header_.num_points > 0) {
      file_.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner.line()),
                         "the last line has no line end; its last number may be cut");
    }
  }

  void trailing(const std::string& where) {
    file_.warnings.add("W_TRAILING_DATA", where, "data after the last point are ignored");
  }

  static double load(const std::uint8_t* bytes, const Field& field) {
    const std::uint64_t bits = load_le(bytes, field.size);
    if (field.type == 'U') return static_cast<double>(bits);
    if (field.type == 'I') return static_cast<double>(signed_from_bits(bits, field.size));
    return field.size == 8 ? double_from_bits(bits)
                           : float_from_bits(static_cast<std::uint32_t>(bits));
  }

  /// Points whose field f of point p starts at start[f] + p * stride[f].
  template <typename Start, typename Stride>
  void read_points(const std::uint8_t* data, Start start, Stride stride) {
    reserve();
    for (std::int64_t point = 0; point < header_.num_points; ++point) {
      if (point % kRunStride == 0) check_run(run_, point, header_.num_points);
      std::array<double, 6> values{};
      for (std::size_t slot = 0; slot < values.size(); ++slot) {
        if (header_.wanted[slot] < 0) continue;
        const Field& field = header_.fields[static_cast<std::size_t>(header_.wanted[slot])];
        values[slot] = load(data + start(field) + point * stride(field), field);
      }
      add(point, values);
    }
  }

  void read_binary() {
    claim(header_.point_bytes);
    const auto left = static_cast<std::int64_t>(bytes_.size() - header_.data);
    const std::int64_t need = header_.num_points * header_.point_bytes;
    if (need > left) {
      fail(Errc::malformed, "E_TRUNCATED",
           "point " + std::to_string(left / header_.point_bytes) + " of " +
               std::to_string(header_.num_points) + " is cut",
           bytes_.size());
    }
    read_points(
        bytes_.data() + header_.data, [](const Field& field) { return field.offset; },
        [&](const Field&) { return header_.point_bytes; });
    if (left > need)
      trailing("byte " + std::to_string(bytes_.size() - static_cast<std::size_t>(left - need)));
  }

  /// uint32 compressed size, uint32 expanded size, LZF data; expanded: all values of the first
  /// field, all of the second, ...
  void read_compressed() {
    const std::size_t at = header_.data;
    if (bytes_.size() - at < 8) {
      fail(Errc::malformed, "E_TRUNCATED", "the file ends before its points", bytes_.size());
    }
    const auto packed = static_cast<std::int64_t>(load_le(bytes_.data() + at, 4));
    const auto expanded = static_cast<std::int64_t>(load_le(bytes_.data() + at + 4, 4));
    const auto left = static_cast<std::int64_t>(bytes_.size() - at - 8);
    // A copy of three bytes makes 264 at most, so LZF cannot expand more than 88 times.
    check_claim("vertices", header_.num_points, options_.limits.max_vertices, 1, 88 * left,
                {name_, 0, static_cast<std::int64_t>(at)});
    if (header_.num_points * header_.point_bytes != expanded) {
      fail(Errc::malformed, "E_HEADER",
           std::to_string(expanded) + " bytes are not " + std::to_string(header_.num_points) +
               " points of " + std::to_string(header_.point_bytes),
           at + 4);
    }
    if (packed > left) {
      fail(Errc::malformed, "E_TRUNCATED",
           std::to_string(packed) + " compressed bytes, and " + std::to_string(left) + " follow",
           bytes_.size());
    }
    if (expanded > 88 * packed) {
      fail(Errc::malformed, "E_SYNTAX", "LZF data cannot expand that much", at);
    }
    if (expanded > options_.limits.max_expanded_bytes ||
        expanded > std::max(std::int64_t{1} << 20, options_.limits.max_expansion_ratio * packed)) {
      fail(Errc::over_limit, "E_EXPANSION",
           std::to_string(packed) + " bytes expand to " + std::to_string(expanded), at);
    }
    std::vector<std::uint8_t> data;
    if (!expand_lzf(bytes_.subspan(at + 8, static_cast<std::size_t>(packed)),
                    static_cast<std::size_t>(expanded), data)) {
      fail(Errc::malformed, "E_SYNTAX", "damaged LZF data", at + 8);
    }
    read_points(
        data.data(), [&](const Field& field) { return field.offset * header_.num_points; },
        [](const Field& field) { return field.size * field.count; });
    if (left > packed) {
      trailing("byte " + std::to_string(at + 8 + static_cast<std::size_t>(packed)));
    }
  }

  ByteSpan bytes_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  Header header_;
  SurfaceFile file_;
  PointList points_;
  PointList normals_;
  std::int64_t num_invalid_ = 0;
  std::int64_t first_invalid_ = 0;
};

}  // namespace

SurfaceFile parse_pcd(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return PcdParser(bytes, name, options, run).parse();
}

}  // namespace dupin::detail
