#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "dupin/base/error.h"
#include "dupin/warp/project.h"

namespace {

void require(bool kept) {
  if (!kept) std::abort();
}

bool is_coded(const dupin::Error& error) { return error.code().starts_with("E_"); }

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// A text is refused with a code, or what it means can be written and means the same again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const dupin::WarpProject project = dupin::parse_project(text);
    const std::string canonical = dupin::format_project(project);
    require(dupin::parse_project(canonical) == project);
    require(dupin::format_project(dupin::parse_project(canonical)) == canonical);
  } catch (const dupin::IoError& error) {
    require(is_coded(error));
  }
  try {
    dupin::parse_loops(text);
  } catch (const dupin::IoError& error) {
    require(is_coded(error));
  }
  try {
    dupin::parse_pins(text);
  } catch (const dupin::IoError& error) {
    require(is_coded(error));
  }
  return 0;
}
