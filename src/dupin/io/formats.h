#pragma once

// One parse function a format. parse_surface() chooses by content; nobody else calls these.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/io/read_options.h"
#include "dupin/io/surface_io.h"

namespace dupin::detail {

using ByteSpan = std::span<const std::uint8_t>;

// Each parses `bytes`, names `name` in its errors, and throws as parse_surface().
SurfaceFile parse_ply(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_obj(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_off(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_stl(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_wrl(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_abs(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_bnt(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_xyz(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_pts(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_pcd(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);
SurfaceFile parse_glb(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run);

/// The content of a gzip file (all members).
/// @throws IoError E_EXPANSION over the limits on ratio and size, E_TRUNCATED, E_CRC, E_MAGIC
std::vector<std::uint8_t> gunzip(ByteSpan bytes, const std::string& name, const ReadLimits& limits);

/// glTF 2.0 binary of `surface`; little endian, one mesh, lines as a second primitive.
std::string format_glb(const SurfaceOutput& surface);

}  // namespace dupin::detail
