#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dupin/base/run_control.h"
#include "dupin/base/warning.h"
#include "dupin/image/image.h"
#include "dupin/image/raster.h"
#include "dupin/io/read_options.h"

namespace dupin {

class FileBytes;

/// A picture as read, and what there is to remark about its file.
struct PngFile {
  Raster raster;         ///< RGBA of 8 bits, or of 16 if the file has 16
  WarningList warnings;  ///< W_TRUNCATED_END, W_TRAILING_DATA, W_COLOUR_PROFILE, W_IMAGE_CHUNK
};

/// Reads a PNG of any colour type and depth, interlaced or not; "-" reads standard input. Grey
/// values are spread to three channels and 1, 2 and 4 bits to 8; palettes and transparent colours
/// are resolved; without them alpha is opaque. Colour chunks are carried along, text is skipped
/// without unpacking it.
///
/// Either the whole picture comes back or an error, never a part of it. The header is judged before
/// memory is taken, and memory only if the packed bytes can fill it. Peak: 4 bytes a pixel, 8 for
/// 16 bits, one more for interlaced palettes; or the mapped file, which is let go as it is read.
///
/// @throws IoError as FileBytes::open(); E_EMPTY, E_MAGIC, E_HEADER, E_TRUNCATED, E_CRC, E_FILTER,
///   E_PALETTE_INDEX, E_SYNTAX (Errc::malformed); E_IMAGE_TOO_LARGE, E_EXPANSION (Errc::over_limit)
/// @throws Error(Errc::interrupted) when cancelled
/// Cost: O(bytes + pixels).
PngFile read_png(const std::string& path, const ReadLimits& limits = {}, RunControl run = {});

/// The same of a file that is open already.
PngFile parse_png(const FileBytes& file, const std::string& name, const ReadLimits& limits = {},
                  const RunControl& run = {});

/// The same from memory; `name` is used in messages.
PngFile parse_png(std::span<const std::uint8_t> bytes, const std::string& name,
                  const ReadLimits& limits = {}, const RunControl& run = {});

/// Whether `bytes` begin as a PNG does.
bool is_png(std::span<const std::uint8_t> bytes);

/// Bytes of `image` as PNG: 8 bits a channel, RGBA (RGB when every pixel is opaque), not
/// interlaced, sRGB chunk, no time and no text, so that equal images give equal bytes with one
/// zlib.
/// @throws InvalidArgument as validate(image). Cost: O(pixels).
std::string format_png(const Image& image);

/// The same of 8 or 16 bits, with the colour chunks of `raster` instead of the sRGB chunk. Reading
/// it back gives `raster` again.
/// @throws InvalidArgument as validate(raster), or for a profile without a legal name
std::string format_png(const Raster& raster);

/// Writes atomically (write_file_atomically in file.h); "-" writes standard output.
/// @throws InvalidArgument as format_png(); IoError E_WRITE (Errc::cannot_write)
void write_png(const std::string& path, const Image& image);
void write_png(const std::string& path, const Raster& raster);

}  // namespace dupin
