#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// PCD by its first bytes; anything else as XYZ and as PTS.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0 && (data[0] == 0x23 || data[0] == 0x56)) {
    return dupin::fuzz::check_reader(dupin::detail::parse_pcd, data, size);
  }
  dupin::fuzz::check_reader(dupin::detail::parse_xyz, data, size);
  return dupin::fuzz::check_reader(dupin::detail::parse_pts, data, size);
}
