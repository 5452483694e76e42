#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// The first byte of an ABS file is a digit; BNT has no magic, so everything else is tried as BNT.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const bool is_text = size > 0 && data[0] >= 0x30 && data[0] <= 0x39;
  return dupin::fuzz::check_reader(is_text ? dupin::detail::parse_abs : dupin::detail::parse_bnt,
                                   data, size);
}
