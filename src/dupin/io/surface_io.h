#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/warning.h"
#include "dupin/io/read_options.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin {

/// A surface or point cloud as read. Indices and coordinates are those of the file.
struct SurfaceFile {
  PolygonMesh mesh;  ///< no faces: a point cloud
  std::string
      format;  ///< "ply", "obj", "off", "stl", "wrl", "abs", "bnt", "xyz", "pts", "pcd", "glb"
  bool is_binary = false;
  WarningList warnings;  ///< W_BOM, W_TRAILING_DATA, W_ATTR_INDEX, ...
};

/// Reads a surface from a file; "-" reads standard input. The content decides the format; the
/// extension, or ReadOptions::stdin_format, only between formats whose content looks alike (text of
/// bare numbers). Gzip is unpacked where the name ends in .gz, and from standard input.
///
/// Guarantees (contract G1-G3): regular files only (opened without blocking), memory at most 64 MB
/// + 8 times the size of a binary file or 4 times that of a text, no allocation sized by a number
/// that the file merely claims, floats parsed exactly as std::from_chars, never the locale, no
/// other file opened.
///
/// @throws IoError with code, line or byte: E_NOT_FOUND, E_OPEN, E_PERMISSION, E_NOT_A_FILE,
/// E_EMPTY, E_MAGIC,
///   E_TRUNCATED, E_HEADER, E_SYNTAX, E_DECIMAL_COMMA, E_NUMBER_RANGE, E_LIST_COUNT, E_INDEX_RANGE,
///   E_COUNT_EXCEEDS_FILE, E_LINE_TOO_LONG, E_NESTING, E_CYCLE, E_EXPANSION, E_TOO_LARGE,
///   E_NONFINITE (Errc::impossible; see ReadOptions::drop_nonfinite)
SurfaceFile read_surface(const std::string& path, const ReadOptions& options = {},
                         RunControl run = {});

/// The same from memory; `name` is used in messages and for its extension.
SurfaceFile parse_surface(std::span<const std::uint8_t> bytes, const std::string& name,
                          const ReadOptions& options = {}, RunControl run = {});

/// One per-vertex value that a surface file can carry (PLY only): "property <type> <name>".
struct VertexProperty {
  std::string name;        ///< PLY property name, e.g. "k1"
  Eigen::VectorXd values;  ///< #V; NaN is refused
  bool as_uchar = false;   ///< written as uchar (colours), otherwise as double (float when single)
};

/// A surface to be written. Faces empty: a point cloud.
struct SurfaceOutput {
  Points points;        ///< #V by 3
  Triangles triangles;  ///< #F by 3
  std::vector<VertexProperty> properties;
  std::vector<Eigen::Vector2i> lines;  ///< segments (OBJ "l", PLY element edge, GLB lines)
};

enum class SurfaceFormat { ply_binary, ply_ascii, obj, off, stl_binary, stl_ascii, glb };

/// Format by extension (.ply, .obj, .off, .stl, .glb).
/// @throws InvalidArgument for any other extension
SurfaceFormat surface_format_of(const std::string& path);

/// Bytes of `surface` in `format`. Text numbers are the shortest that read back to the same bits.
/// @throws InvalidArgument if a value is not finite, an index is out of range, or the format cannot
/// hold it
std::string format_surface(const SurfaceOutput& surface, SurfaceFormat format);

/// Writes atomically (write_file_atomically in file.h); "-" writes standard output.
/// @throws IoError E_WRITE (Errc::cannot_write)
void write_surface(const std::string& path, const SurfaceOutput& surface, SurfaceFormat format);

}  // namespace dupin
