#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dupin/io/npz.h"

namespace dupin::detail {

/// Bytes of `array` as .npy 1.0.
/// @throws InvalidArgument if `shape` and `values` disagree
std::string format_npy(const NpyArray& array);

/// The same of single-precision values of any shape, NaN allowed.
/// @throws InvalidArgument if `shape` and `values` disagree
std::string format_npy(const std::vector<Eigen::Index>& shape, std::span<const float> values);

/// Bytes of `arrays` as .npz: a zip of stored members NAME.npy dated 1980-01-01. Members, offsets
/// and archives of `zip64_from` bytes or more use the zip64 records (APPNOTE.TXT 4.3.14, 4.5.3);
/// the parameter exists so that a test needs no 4 GiB.
/// @throws InvalidArgument if a name is empty, repeated, longer than 255 bytes or holds a '/' or a
///   control character
std::string format_npz(const std::vector<NpyArray>& arrays,
                       std::uint64_t zip64_from = 0xFFFFFFFFULL);

/// The array in `bytes`. @throws IoError as read_npy()
NpyArray parse_npy(std::span<const std::uint8_t> bytes, const std::string& name,
                   const ReadLimits& limits);

}  // namespace dupin::detail
