#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>

#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "tests/support/badmesh.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

// What is decided before the reader returns; the rest of the codes are the repair's.
const std::set<std::string> kReaderErrors = {
    "E_EMPTY",         "E_MAGIC",        "E_TRUNCATED",  "E_HEADER",      "E_SYNTAX",
    "E_DECIMAL_COMMA", "E_NUMBER_RANGE", "E_LIST_COUNT", "E_INDEX_RANGE", "E_COUNT_EXCEEDS_FILE",
    "E_LINE_TOO_LONG", "E_NONFINITE",    "E_NESTING",    "E_CYCLE",       "E_EXPANSION"};
const std::set<std::string> kReaderWarnings = {"W_BOM", "W_TRAILING_DATA", "W_ATTR_INDEX"};

class Corpus : public ::testing::Test {
 protected:
  void SetUp() override {
    for (test::BadMesh& mesh : test::generate_badmesh(folder_.path())) {
      const std::set<std::string> ours = {"ply", "obj", "off", "stl", "wrl", "gz"};
      if (ours.count(mesh.format) > 0) meshes_.push_back(std::move(mesh));
    }
    if (meshes_.empty()) GTEST_SKIP() << "the generator of bad meshes is not on this machine";
  }

  test::TemporaryFolder folder_;
  std::vector<test::BadMesh> meshes_;
};

// The manifest is the contract: each file is read, or refused with the stated code, exit status
// and line, and no warning appears that is not stated.
TEST_F(Corpus, EveryFileIsAnsweredAsTheManifestSays) {
  ASSERT_GE(meshes_.size(), 90U);
  for (const test::BadMesh& bad : meshes_) {
    SCOPED_TRACE(bad.file);
    std::string expected;
    for (const std::string& code : bad.codes) {
      if (kReaderErrors.count(code) > 0) expected = code;
    }
    try {
      const SurfaceFile file = read_surface(bad.file);
      EXPECT_EQ(expected, "") << "was read";
      EXPECT_TRUE(test::is_sound(file.mesh));
      if (bad.num_vertices >= 0) {
        EXPECT_EQ(file.mesh.points.rows(), bad.num_vertices);
      }
      if (bad.num_faces >= 0) {
        EXPECT_EQ(file.mesh.num_faces(), bad.num_faces);
      }
      for (const Warning& warning : file.warnings.all()) {
        // What a scene holds beside its surface is said, but no defect of the file.
        if (warning.code == "W_UNSUPPORTED_NODE") continue;
        EXPECT_EQ(std::count(bad.codes.begin(), bad.codes.end(), warning.code), 1) << warning.code;
      }
      for (const std::string& code : bad.codes) {
        if (kReaderWarnings.count(code) > 0) {
          EXPECT_TRUE(file.warnings.contains(code)) << code;
        }
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), expected) << error.diagnostic();
      EXPECT_EQ(static_cast<int>(error.errc()), bad.exit_code) << error.diagnostic();
      if (bad.line > 0) {
        EXPECT_EQ(error.location().line, bad.line) << error.diagnostic();
      }
    }
  }
}

// Contract 4h: refusing costs no time. 50 ms for the files of a few bytes that claim gigabytes.
TEST_F(Corpus, AClaimOfBillionsIsRefusedAtOnce) {
  int refused = 0;
  for (const test::BadMesh& bad : meshes_) {
    if (bad.codes != std::vector<std::string>{"E_COUNT_EXCEEDS_FILE"}) continue;
    SCOPED_TRACE(bad.file);
    // The least of several: on a busy machine any one may wait.
    auto least = std::chrono::steady_clock::duration::max();
    for (int attempt = 0; attempt < 10 && least >= std::chrono::milliseconds(50); ++attempt) {
      const auto start = std::chrono::steady_clock::now();
      EXPECT_THROW(read_surface(bad.file), IoError);
      least = std::min(least, std::chrono::steady_clock::now() - start);
    }
    EXPECT_LT(least, std::chrono::milliseconds(50));
    ++refused;
  }
  EXPECT_GE(refused, 6);
}

// All encodings of the control hold the same surface.
TEST_F(Corpus, TheControlsAgree) {
  const auto find = [&](const std::string& name) {
    for (const test::BadMesh& mesh : meshes_) {
      if (mesh.file.ends_with(name)) return read_surface(mesh.file).mesh;
    }
    ADD_FAILURE() << name << " is missing";
    return PolygonMesh();
  };
  const PolygonMesh text = find("c01_ok_ascii.ply");
  const PolygonMesh little = find("c02_ok_le.ply");
  EXPECT_TRUE(test::is_same_mesh(text, find("c04_ok.obj")));
  EXPECT_TRUE(test::is_same_mesh(text, find("c05_ok.off")));
  EXPECT_TRUE(test::is_same_mesh(text, find("m69_crlf.ply")));
  EXPECT_TRUE(test::is_same_mesh(text, find("m71_cr_only.ply")));
  EXPECT_TRUE(test::is_same_mesh(little, find("c03_ok_be.ply")));
  EXPECT_TRUE(test::is_same_mesh(little, find("m72_crlf_le.ply")));
  EXPECT_TRUE(text.face_index == little.face_index);
  EXPECT_TRUE(text.points.cast<float>() == little.points.cast<float>());
  EXPECT_EQ(find("c06_ok.stl").points.rows(), little.points.rows());
}

}  // namespace
}  // namespace dupin
