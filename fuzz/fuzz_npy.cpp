#include "dupin/io/npy_format.h"
#include "fuzz/fuzz_surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const dupin::NpyArray array = dupin::detail::parse_npy({data, size}, "input", {});
    dupin::fuzz::require(array.shape.size() == 1 || array.shape.size() == 2);
    // What was read can be written, and reads back the same.
    const std::string bytes = dupin::detail::format_npy(array);
    const dupin::NpyArray back = dupin::detail::parse_npy(
        {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "output", {});
    dupin::fuzz::require(back.shape == array.shape &&
                         dupin::fuzz::is_same(back.values, array.values));
  } catch (const dupin::Error& error) {
    dupin::fuzz::require(error.code().starts_with("E_"));
  }
  return 0;
}
