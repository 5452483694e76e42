#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "dupin/base/error.h"
#include "dupin/mesh/heal.h"
#include "fuzz/snapped_surface.h"
#include "tests/support/heal_invariants.h"

// heal() refuses a snapped surface with a code or keeps every promise, also the second time.
namespace dupin::fuzz {
namespace {

void require_kept(const std::string& broken) {
  if (broken.empty()) return;
  std::fprintf(stderr, "broken promise: %s\n", broken.c_str());
  std::abort();
}

}  // namespace
}  // namespace dupin::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dupin::fuzz::Bytes bytes(data, size);
  const dupin::PolygonMesh input = dupin::fuzz::snapped_surface(bytes);
  try {
    const dupin::HealedSurface healed = dupin::heal(input);
    dupin::fuzz::require_kept(dupin::test::broken_invariant(input, healed));
    dupin::fuzz::require_kept(dupin::test::broken_idempotence(healed));
  } catch (const dupin::AnalysisError&) {
    return 0;
  }
  return 0;
}
