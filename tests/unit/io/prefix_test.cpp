#include <gtest/gtest.h>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/surface_io.h"
#include "tests/support/badmesh.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

struct Control {
  std::string name;
  std::string bytes;
};

std::vector<Control> built_controls() {
  const SurfaceOutput surface = test::icosahedron();
  return {{"a.ply", format_surface(surface, SurfaceFormat::ply_ascii)},
          {"b.ply", format_surface(surface, SurfaceFormat::ply_binary)},
          {"c.obj", format_surface(surface, SurfaceFormat::obj)},
          {"d.off", format_surface(surface, SurfaceFormat::off)},
          {"e.stl", format_surface(surface, SurfaceFormat::stl_binary)},
          {"f.stl", format_surface(surface, SurfaceFormat::stl_ascii)}};
}

std::vector<Control> corpus_controls(const std::string& folder) {
  std::vector<Control> controls;
  for (const test::BadMesh& mesh : test::generate_badmesh(folder)) {
    const std::string name = std::filesystem::path(mesh.file).filename().string();
    if (name.starts_with("c0")) {
      controls.push_back({name, test::slurp(mesh.file)});
    }
  }
  return controls;
}

// OBJ states no counts: a file that ends with a line is whole, so the expected mesh is that of the
// lines which are complete.
std::string complete_lines(const std::string& text) { return text.substr(0, text.rfind('\n') + 1); }

// Whatever part of a file arrives, the answer is the mesh, or a coded error. Where the last number
// of a text has no line end, nobody can know whether it was cut: then a warning says so.
void check_every_prefix(const Control& control) {
  SCOPED_TRACE(control.name);
  const SurfaceFile whole = parse_surface(test::bytes_of(control.bytes), control.name);
  EXPECT_TRUE(whole.warnings.empty());
  const bool is_obj = control.name.ends_with(".obj");
  int num_read = 0;
  for (std::size_t size = 0; size < control.bytes.size(); ++size) {
    const std::string prefix = control.bytes.substr(0, size);
    try {
      const SurfaceFile file = parse_surface(test::bytes_of(prefix), control.name);
      ++num_read;
      ASSERT_TRUE(test::is_sound(file.mesh)) << "prefix of " << size;
      if (file.warnings.contains("W_TRUNCATED_END")) continue;
      const PolygonMesh expected =
          is_obj ? parse_surface(test::bytes_of(complete_lines(prefix)), control.name).mesh
                 : whole.mesh;
      ASSERT_TRUE(test::is_same_mesh(file.mesh, expected)) << "prefix of " << size;
    } catch (const Error& error) {
      ASSERT_TRUE(error.code().starts_with("E_"));
      ASSERT_EQ(error.errc(), Errc::malformed) << error.diagnostic();
      if (size > 8 && !is_obj) {
        ASSERT_EQ(error.code(), "E_TRUNCATED") << error.diagnostic() << " of " << size;
      }
    }
  }
  // Only the end of the last line of a counted format may be missing.
  if (!is_obj) {
    EXPECT_LE(num_read, 16);
  }
}

TEST(Prefix, EveryPrefixOfABuiltControlIsEqualOrRefused) {
  for (const Control& control : built_controls()) check_every_prefix(control);
}

TEST(Prefix, EveryPrefixOfACorpusControlIsEqualOrRefused) {
  const test::TemporaryFolder folder;
  const std::vector<Control> controls = corpus_controls(folder.path());
  if (controls.empty()) GTEST_SKIP() << "the generator of bad meshes is not on this machine";
  EXPECT_EQ(controls.size(), 7U);
  for (const Control& control : controls) check_every_prefix(control);
}

// A flipped bit may change a coordinate, never the soundness of what is returned.
TEST(Prefix, AFlippedBitGivesASoundMeshOrACodedError) {
  Rng random(20);
  for (const Control& control : built_controls()) {
    SCOPED_TRACE(control.name);
    int refused = 0;
    for (int trial = 0; trial < 4000; ++trial) {
      std::string bytes = control.bytes;
      const auto at = static_cast<std::size_t>(random.below(bytes.size()));
      const auto bit = static_cast<unsigned>(random.below(8));
      bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << bit));
      try {
        const SurfaceFile file = parse_surface(test::bytes_of(bytes), control.name);
        ASSERT_TRUE(test::is_sound(file.mesh)) << "byte " << at << " bit " << bit;
      } catch (const Error& error) {
        ++refused;
        ASSERT_TRUE(error.code().starts_with("E_"));
      }
    }
    EXPECT_GT(refused, 0);
  }
}

}  // namespace
}  // namespace dupin
