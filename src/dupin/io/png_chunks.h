#pragma once

// What the frame of a PNG says: everything that can be judged before a pixel is unpacked.

#include <cstdint>
#include <span>
#include <string>

#include "dupin/base/warning.h"
#include "dupin/image/raster.h"
#include "dupin/io/read_options.h"

namespace dupin::detail {

/// A PNG whose chunks are whole, whose checksums match and whose header is legal and within limits.
struct PngFrame {
  int width = 0;
  int height = 0;
  int bits = 0;         ///< a channel: 1, 2, 4, 8, 16
  int colour_type = 0;  ///< as in the header: 0 grey, 2 RGB, 3 palette, 4 grey+alpha, 6 RGBA
  bool is_interlaced = false;
  std::size_t end = 0;   ///< bytes up to the last whole chunk
  bool has_end = false;  ///< the last whole chunk is IEND
  ColourSpace colour = {};
  WarningList warnings = {};  ///< W_TRUNCATED_END, W_TRAILING_DATA, W_COLOUR_PROFILE
};

/// Walks over the chunks of a PNG. Nothing is unpacked but a colour profile.
/// @throws IoError E_MAGIC, E_HEADER, E_TRUNCATED, E_CRC (Errc::malformed), E_IMAGE_TOO_LARGE,
///   E_EXPANSION (Errc::over_limit)
/// Cost: O(bytes), for the checksums.
PngFrame read_png_frame(std::span<const std::uint8_t> bytes, const std::string& name,
                        const ReadLimits& limits);

}  // namespace dupin::detail
