#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

constexpr std::size_t kMinColumns = 3;
constexpr std::size_t kMaxColumns = 16;
constexpr std::int64_t kRunStride = 1 << 12;
// Half a unit in the third decimal of each component, the coarsest normals seen in the wild.
constexpr double kUnitTolerance = 5e-3;

/// Lines of numbers: x y z, then intensity, colours or a normal. XYZ has no header; PTS starts each
/// scan with the number of its points. Both occur with and without it.
class PointParser {
 public:
  PointParser(ByteSpan bytes, const std::string& name, const ReadOptions& options,
              const RunControl& run)
      : scanner_(bytes, name, options.limits, {.comment = '#'}),
        name_(name),
        options_(options),
        run_(run),
        size_(static_cast<std::int64_t>(bytes.size())) {}

  SurfaceFile parse(const char* format) {
    SurfaceFile file;
    file.format = format;
    while (scanner_.next_line()) {
      if (scanner_.line() % kRunStride == 0) check_run(run_, scanner_.byte(), size_);
      read_line();
    }
    if (left_ > 0) {
      scanner_.fail(Errc::malformed, "E_TRUNCATED",
                    std::to_string(left_) + " more points were announced");
    }
    if (scanner_.has_bom()) {
      file.warnings.add("W_BOM", "byte 0", "the byte order mark at the start is skipped");
    }
    if (scanner_.is_unterminated()) {
      file.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner_.line()),
                        "the last line has no line end; its last number may be cut");
    }
    file.mesh.points = points_.take();
    file.mesh.normals.resize(0, 3);
    if (columns_ >= 6 && has_unit_normals_ && normals_.size() == file.mesh.points.rows()) {
      file.mesh.normals = normals_.take();
    }
    return file;
  }

 private:
  Location here() const { return {name_, scanner_.line(), -1}; }

  void read_line() {
    std::array<double, kMaxColumns> row{};
    std::size_t columns = 0;
    while (!scanner_.at_line_end()) {
      if (columns == kMaxColumns) scanner_.fail_syntax("more than 16 columns");
      row[columns++] = scanner_.number("a coordinate");
    }
    if (columns == 1) {
      read_count(row[0]);
      return;
    }
    if (columns < kMinColumns || (columns_ != 0 && columns != columns_)) {
      scanner_.fail_syntax("expected " +
                           (columns_ == 0 ? std::string("at least 3") : std::to_string(columns_)) +
                           " columns, found " + std::to_string(columns));
    }
    if (is_counted_ && left_ == 0) scanner_.fail_syntax("more points than announced");
    if (columns_ == 0) start(columns);
    if (!is_finite(row[0], row[1], row[2]) && !options_.drop_nonfinite) {
      fail_nonfinite(points_.size(), here());
    }
    if (points_.size() >= std::min(options_.limits.max_vertices, kMaxIndex)) {
      fail_limit("vertices", options_.limits.max_vertices, here());
    }
    points_.add(row[0], row[1], row[2]);
    if (columns >= 6 && has_unit_normals_) add_normal(&row[columns - 3]);
    --left_;
  }

  void start(std::size_t columns) {
    columns_ = columns;
    // One line tells how long the others are, about; a number and its blank take two bytes.
    const auto least = static_cast<std::int64_t>(2 * columns);
    points_.reserve(std::min(size_ / least + 1, options_.limits.max_vertices));
  }

  void read_count(double count) {
    if (left_ > 0) {
      scanner_.fail_syntax("a lone number where " + std::to_string(left_) +
                           " more points are expected");
    }
    if (columns_ != 0 && !is_counted_) scanner_.fail_syntax("a lone number among points");
    if (!(count >= 0.0) || count != std::floor(count) || count > 9e15) {
      scanner_.fail(Errc::malformed, "E_NUMBER_RANGE",
                    "the number of points is not a whole number");
    }
    is_counted_ = true;
    left_ = static_cast<std::int64_t>(count);
    check_claim("vertices", left_, options_.limits.max_vertices, 6, scanner_.bytes_left(), here());
  }

  /// The last three columns are a normal if they are a unit vector in every line.
  void add_normal(const double* n) {
    const bool is_small = std::abs(n[0]) <= 2.0 && std::abs(n[1]) <= 2.0 && std::abs(n[2]) <= 2.0;
    has_unit_normals_ = is_small && std::abs(std::hypot(n[0], n[1], n[2]) - 1.0) <= kUnitTolerance;
    if (has_unit_normals_) {
      normals_.add(n[0], n[1], n[2]);
    } else {
      normals_.take();
    }
  }

  TextScanner scanner_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  std::int64_t size_;
  PointList points_;
  PointList normals_;
  std::size_t columns_ = 0;
  std::int64_t left_ = 0;
  bool is_counted_ = false;
  bool has_unit_normals_ = true;
};

}  // namespace

SurfaceFile parse_xyz(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return PointParser(bytes, name, options, run).parse("xyz");
}

SurfaceFile parse_pts(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return PointParser(bytes, name, options, run).parse("pts");
}

}  // namespace dupin::detail
