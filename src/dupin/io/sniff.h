#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace dupin::detail {

/// What `bytes` are if they are no surface: "gzip", "a PNG image", ...; empty if nothing is known.
std::string foreign_format(std::span<const std::uint8_t> bytes);

/// The surface format that the content shows: a name as in SurfaceFile::format, or empty.
std::string format_by_content(std::span<const std::uint8_t> bytes);

/// Lower-case extension of `name` without its point, of "a.ply.gz" as of "a.ply".
std::string surface_extension(const std::string& name);

bool ends_with_gz(const std::string& name);

}  // namespace dupin::detail
