#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"
#include "dupin/io/little_endian.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"
#include "dupin/mesh/range_grid.h"

namespace dupin::detail {
namespace {

constexpr double kInvalidCoordinate = -999999.0;
constexpr std::int64_t kRunStride = 1 << 14;

/// Checks rows * cols before anything is allocated for them.
std::int64_t checked_pixels(std::int64_t rows, std::int64_t cols, std::int64_t least_bytes,
                            std::int64_t bytes_left, const ReadLimits& limits,
                            const Location& where) {
  const std::int64_t most = std::max(limits.max_vertices, std::int64_t{1});
  const std::int64_t larger = std::max(rows, cols);
  // A side over the limit is enough: the product might overflow.
  const std::int64_t pixels = larger > most && std::min(rows, cols) > 0 ? larger : rows * cols;
  check_claim("vertices", pixels, limits.max_vertices, least_bytes, bytes_left, where);
  if (pixels > bytes_left / least_bytes + 1) {
    throw IoError(Errc::malformed, "E_TRUNCATED",
                  std::to_string(rows) + " x " + std::to_string(cols) + " pixels, and " +
                      std::to_string(bytes_left) + " bytes follow",
                  where);
  }
  return pixels;
}

/// The surface of a grid, and how many pixels that should have been valid were not.
void finish(RangeGrid&& grid, std::int64_t num_dropped, const ReadOptions& options,
            SurfaceFile& file) {
  if (num_dropped > 0) {
    file.warnings.add("W_INVALID_POINTS", "", "valid pixels without coordinates are left out",
                      num_dropped);
  }
  RangeGridOptions grid_options;
  grid_options.max_depth_jump = options.max_depth_jump;
  file.mesh = triangulate_range_grid(grid, grid_options);
}

/// FRGC's text picture. Layout: "R rows", "C columns", "pixels (flag X Y Z):", then R * C flags,
/// all X, all Y, all Z, row by row from the top, -999999 where the flag is 0 (as the readers of
/// pyvision and of the FRGC tools have it).
class AbsParser {
 public:
  AbsParser(ByteSpan bytes, const std::string& name, const ReadOptions& options,
            const RunControl& run)
      : limits_(own_limits(options.limits)),
        scanner_(bytes, name, limits_),
        name_(name),
        options_(options),
        run_(run),
        size_(static_cast<std::int64_t>(bytes.size())) {}

  SurfaceFile parse() {
    SurfaceFile file;
    file.format = "abs";
    RangeGrid grid;
    grid.rows = dimension("rows");
    grid.cols = dimension("columns");
    if (!scanner_.next_line()) truncated();
    if (scanner_.peek_word() != "pixels") scanner_.fail_syntax("expected 'pixels (flag X Y Z):'");
    scanner_.rest_of_line();
    const std::int64_t pixels =
        checked_pixels(grid.rows, grid.cols, 8, scanner_.bytes_left(), limits_, here());
    grid.is_valid.resize(static_cast<std::size_t>(pixels));
    for (std::uint8_t& flag : grid.is_valid) flag = value("a flag") != 0.0 ? 1 : 0;
    grid.points.resize(pixels, 3);
    std::int64_t num_dropped = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (std::int64_t i = 0; i < pixels; ++i) {
        const double x = value("a coordinate");
        std::uint8_t& flag = grid.is_valid[static_cast<std::size_t>(i)];
        grid.points(i, axis) = x;
        if (flag == 0 || (std::isfinite(x) && x != kInvalidCoordinate)) continue;
        if (!std::isfinite(x) && !options_.drop_nonfinite) fail_nonfinite(i, here());
        flag = 0;
        ++num_dropped;
      }
    }
    if (scanner_.at_line_end() ? scanner_.next_line() : true) {
      file.warnings.add("W_TRAILING_DATA", "line " + std::to_string(scanner_.line()),
                        "text after the last pixel is ignored");
    } else if (scanner_.is_unterminated()) {
      file.warnings.add("W_TRUNCATED_END", "line " + std::to_string(scanner_.line()),
                        "the last line has no line end; its last number may be cut");
    }
    finish(std::move(grid), num_dropped, options_, file);
    return file;
  }

 private:
  // A whole picture stands in one line, so the limit of a line is that of the file.
  static ReadLimits own_limits(ReadLimits limits) {
    limits.max_line_bytes = std::max(limits.max_line_bytes, limits.max_file_bytes);
    return limits;
  }

  [[noreturn]] void truncated() const {
    scanner_.fail(Errc::malformed, "E_TRUNCATED", "the file ends too early");
  }
  Location here() const { return {name_, scanner_.line(), -1}; }

  std::int64_t dimension(const char* what) {
    if (!scanner_.next_line()) truncated();
    const std::int64_t size = scanner_.count(what);
    if (scanner_.word(what) != what) {
      scanner_.fail_syntax(std::string("expected a number and '") + what + "'");
    }
    scanner_.expect_line_end();
    return size;
  }

  double value(const char* what) {
    if (++num_values_ % kRunStride == 0) check_run(run_, scanner_.byte(), size_);
    while (scanner_.at_line_end()) {
      if (!scanner_.next_line()) truncated();
    }
    return scanner_.number(what);
  }

  ReadLimits limits_;
  TextScanner scanner_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  std::int64_t size_;
  std::int64_t num_values_ = 0;
};

}  // namespace

SurfaceFile parse_abs(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  return AbsParser(bytes, name, options, run).parse();
}

// Bosphorus' binary picture, little endian: uint16 rows, uint16 columns, float64 zmin, uint16 n, n
// bytes of the colour picture's name, uint32 count, then count float64: all x, all y, all z, all
// picture columns, all picture rows; zmin stands in the background (read_bntfile.m, A. Savran,
// 2008, which comes with the database). Row by row, from the bottom; count is 5 * rows * columns,
// but not in every file: then the pixels have no known neighbours and are a point cloud.
SurfaceFile parse_bnt(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  const auto at = [&](std::size_t byte) {
    return Location{name, 0, static_cast<std::int64_t>(byte)};
  };
  const auto need = [&](std::size_t end, const char* what) {
    if (end > bytes.size()) {
      throw IoError(Errc::malformed, "E_TRUNCATED", std::string("the file ends inside ") + what,
                    at(bytes.size()));
    }
  };
  constexpr std::size_t name_at = 14;
  need(name_at, "its header");
  SurfaceFile file;
  file.format = "bnt";
  file.is_binary = true;
  RangeGrid grid;
  grid.rows = static_cast<Eigen::Index>(load_le(bytes.data(), 2));
  grid.cols = static_cast<Eigen::Index>(load_le(bytes.data() + 2, 2));
  const double background = double_from_bits(load_le(bytes.data() + 4, 8));
  const std::size_t count_at = name_at + load_le(bytes.data() + 12, 2);
  need(count_at + 4, "its header");
  const auto count = static_cast<std::int64_t>(load_le(bytes.data() + count_at, 4));
  const std::size_t data_at = count_at + 4;
  if (count % 5 != 0) {
    throw IoError(Errc::malformed, "E_HEADER",
                  std::to_string(count) + " values are not five for each pixel", at(count_at));
  }
  const std::int64_t pixels = count / 5;
  const auto left = static_cast<std::int64_t>(bytes.size() - data_at);
  check_claim("vertices", pixels, options.limits.max_vertices, 40, left, at(count_at));
  need(data_at + static_cast<std::size_t>(count) * 8, "its pixels");
  if (left > count * 8) {
    file.warnings.add("W_TRAILING_DATA",
                      "byte " + std::to_string(static_cast<std::int64_t>(data_at) + count * 8),
                      "bytes after the last pixel are ignored");
  }
  if (pixels != grid.rows * grid.cols) {
    file.warnings.add("W_GRID_SIZE", "byte 0",
                      std::to_string(grid.rows) + " x " + std::to_string(grid.cols) + " is not " +
                          std::to_string(pixels) + " pixels: they are read as a point cloud");
    grid.rows = pixels;
    grid.cols = pixels == 0 ? 0 : 1;
  }
  grid.points.resize(pixels, 3);
  grid.is_valid.assign(static_cast<std::size_t>(pixels), 1);
  std::int64_t num_dropped = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t start = data_at + static_cast<std::size_t>(axis * pixels) * 8;
    for (std::int64_t i = 0; i < pixels; ++i) {
      const std::size_t byte = start + static_cast<std::size_t>(i) * 8;
      const double x = double_from_bits(load_le(bytes.data() + byte, 8));
      std::uint8_t& flag = grid.is_valid[static_cast<std::size_t>(i)];
      grid.points(i, axis) = x;
      if (flag == 0) continue;
      if (x == background) {
        flag = 0;
      } else if (!std::isfinite(x)) {
        if (!options.drop_nonfinite) fail_nonfinite(i, at(byte));
        flag = 0;
        ++num_dropped;
      }
      if (i % kRunStride == 0) check_run(run, axis * pixels + i, 3 * pixels);
    }
  }
  finish(std::move(grid), num_dropped, options, file);
  return file;
}

}  // namespace dupin::detail
