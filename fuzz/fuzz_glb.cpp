#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return dupin::fuzz::check_reader(dupin::detail::parse_glb, data, size);
}
