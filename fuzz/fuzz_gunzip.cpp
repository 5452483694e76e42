#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// The output obeys the limits, or there is a coded error.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dupin::ReadLimits limits;
  limits.max_expanded_bytes = 1 << 22;
  try {
    const auto bytes = dupin::detail::gunzip({data, size}, "input", limits);
    dupin::fuzz::require(bytes.size() <= (std::size_t{1} << 22));
  } catch (const dupin::Error& error) {
    dupin::fuzz::require(error.code().starts_with("E_"));
  }
  return 0;
}
