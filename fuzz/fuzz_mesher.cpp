#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "dupin/base/error.h"
#include "dupin/warp/prepare_outline.h"
#include "dupin/warp/triangulate_outline.h"
#include "tests/support/mesh_promises.h"
#include "tests/support/outline_families.h"

// An outline from bytes, of small whole coordinates so that corners meet, lie on lines and on
// circles: refused with a code, or meshed with every promise kept.
namespace dupin::fuzz {
namespace {

class ByteStream {
 public:
  ByteStream(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  int next() { return at_ < size_ ? data_[at_++] : 0; }
  bool is_empty() const { return at_ >= size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

// Pixels of a small mask, or up to four loops of corners.
Outline outline_from(ByteStream& bytes) {
  const int kind = bytes.next();
  if (kind % 2 == 0) {
    const int width = 1 + bytes.next() % 16;
    std::vector<char> mask;
    while (!bytes.is_empty() && mask.size() < 256) {
      const int row = bytes.next();
      for (int bit = 0; bit < 8; ++bit) mask.push_back(static_cast<char>((row >> bit) & 1));
    }
    const int height = static_cast<int>(mask.size()) / width;
    mask.resize(static_cast<std::size_t>(width * height));
    return test::mask_outline(mask, width, height);
  }
  Outline outline;
  const double unit = kind % 4 == 1 ? 1.0 : 1.0 / 256.0;
  for (int l = 0; l < 1 + kind / 64; ++l) {
    std::vector<test::Corner> corners;
    const int count = 3 + bytes.next() % 30;
    for (int i = 0; i < count; ++i) {
      const double x = bytes.next() * unit;
      corners.emplace_back(x, bytes.next() * unit);
    }
    outline.loops.push_back(test::loop_of(corners));
    outline.component.push_back(0);
  }
  return outline;
}

}  // namespace
}  // namespace dupin::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dupin::fuzz::ByteStream bytes(data, size);
  const double spacing = 1.0 + bytes.next() / 8.0;
  dupin::Points2 pins(bytes.next() % 3, 2);
  for (Eigen::Index i = 0; i < pins.rows(); ++i) {
    pins(i, 0) = bytes.next() / 3.0;
    pins(i, 1) = bytes.next() / 2.0;
  }
  const dupin::Outline raw = dupin::fuzz::outline_from(bytes);
  try {
    dupin::OutlineOptions prepare;
    prepare.spacing_px = spacing;
    const dupin::Outline outline = dupin::prepare_outline(raw, prepare).outline;
    dupin::MeshingOptions options;
    options.spacing_px = spacing;
    options.max_triangles = 5000;
    const auto made = dupin::triangulate_outline(outline, pins, options);
    const std::string broken = dupin::test::broken_promise(outline, made);
    if (!broken.empty()) {
      std::fprintf(stderr, "broken promise: %s\n", broken.c_str());
      std::abort();
    }
  } catch (const dupin::Error& error) {
    if (error.errc() == dupin::Errc::internal) std::abort();
  }
  return 0;
}
