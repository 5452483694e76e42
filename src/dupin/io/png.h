#pragma once

#include <string>

#include "dupin/image/image.h"

namespace dupin {

/// Bytes of `image` as PNG: 8 bits a channel, RGBA (RGB when every pixel is opaque), not
/// interlaced, sRGB chunk, no time and no text, so that equal images give equal bytes with one
/// zlib.
/// @throws InvalidArgument as validate(image). Cost: O(pixels).
std::string format_png(const Image& image);

/// Writes atomically (write_file_atomically in file.h); "-" writes standard output.
/// @throws InvalidArgument as validate(image); IoError E_WRITE (Errc::cannot_write)
void write_png(const std::string& path, const Image& image);

}  // namespace dupin
