#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/unit/io/scans/scan_files.h"

namespace dupin {
namespace {

using test::code_of;
using test::parse;

std::string glb(std::string json, const std::string& bin) {
  json.append((4 - json.size() % 4) % 4, ' ');
  std::string bytes = "glTF";
  test::append_bits(bytes, 2, 4);
  test::append_bits(bytes, 12 + 8 + json.size() + 8 + bin.size(), 4);
  test::append_bits(bytes, json.size(), 4);
  bytes += "JSON" + json;
  test::append_bits(bytes, bin.size(), 4);
  return bytes + std::string("BIN\0", 4) + bin;
}

/// Four points, then eight bytes of indices, then a sparse index and value.
std::string bin() {
  std::string bytes;
  for (const float x : {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F, 1.F, 1.F, 0.F}) {
    test::append_float(bytes, x);
  }
  for (const int i : {0, 1, 2, 3, 2, 1, 0, 0}) bytes.push_back(static_cast<char>(i));
  test::append_bits(bytes, 3, 4);
  for (const float x : {5.F, 6.F, 7.F}) test::append_float(bytes, x);
  return bytes;
}

std::string document(const std::string& primitive, const std::string& node = "",
                     const std::string& position_extra = "") {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)" +
         node + R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0})" + primitive +
         R"(}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3")" +
         position_extra +
         R"(},{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"},)"
         R"({"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}],)"
         R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":8},)"
         R"({"buffer":0,"byteOffset":56,"byteLength":16}],"buffers":[{"byteLength":72}]})";
}

std::vector<std::int32_t> faces_of(const std::string& bytes) {
  const PolygonMesh mesh = parse(bytes, "a.glb").mesh;
  return {mesh.face_index.begin(), mesh.face_index.end()};
}

using Faces = std::vector<std::int32_t>;

// Lists, strips and fans of the same four points (glTF 2.0, 3.7.2.1).
TEST(Glb, ReadsTrianglesStripsAndFans) {
  EXPECT_EQ(faces_of(glb(document(R"(,"indices":1)"), bin())), (Faces{0, 1, 2, 3, 2, 1}));
  EXPECT_EQ(faces_of(glb(document(R"(,"indices":2,"mode":5)"), bin())), (Faces{0, 1, 2, 1, 3, 2}));
  EXPECT_EQ(faces_of(glb(document(R"(,"indices":2,"mode":6)"), bin())), (Faces{1, 2, 0, 2, 3, 0}));
  EXPECT_EQ(faces_of(glb(document(R"(,"mode":5)"), bin())), (Faces{0, 1, 2, 1, 3, 2}));
}

// A file of points only is a cloud.
TEST(Glb, ReadsPointsWhereThereAreNoFaces) {
  const SurfaceFile file = parse(glb(document(R"(,"mode":0)"), bin()), "a.glb");
  EXPECT_EQ(file.mesh.points.rows(), 4);
  EXPECT_EQ(file.mesh.num_faces(), 0);
}

// p -> T R S p, or the matrix, column by column; a mirror turns faces over.
TEST(Glb, AppliesTheTransformsOfNodes) {
  const std::string trs =
      R"(,"translation":[10,0,0],"rotation":[0,0,0.70710678118654757,0.70710678118654757],"scale":[2,1,1])";
  const SurfaceFile file = parse(glb(document(R"(,"indices":1)", trs), bin()), "a.glb");
  EXPECT_LT((file.mesh.points.row(1) - Eigen::RowVector3d(10, 2, 0)).norm(), 1e-14);
  EXPECT_LT((file.mesh.points.row(2) - Eigen::RowVector3d(9, 0, 0)).norm(), 1e-14);
  const std::string mirror = R"(,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,3,1])";
  const SurfaceFile turned = parse(glb(document(R"(,"indices":1)", mirror), bin()), "a.glb");
  EXPECT_EQ(turned.mesh.points.row(1), Eigen::RowVector3d(-1, 0, 3));
  EXPECT_EQ(turned.mesh.face_index[1], 2);
}

// Sparse values stand in for those of the buffer.
TEST(Glb, ReadsSparseAccessors) {
  const std::string sparse =
      R"(,"sparse":{"count":1,"indices":{"bufferView":2,"componentType":5125},)"
      R"("values":{"bufferView":2,"byteOffset":4}})";
  const SurfaceFile file = parse(glb(document(R"(,"indices":1)", "", sparse), bin()), "a.glb");
  EXPECT_EQ(file.mesh.points.row(3), Eigen::RowVector3d(5, 6, 7));
  EXPECT_EQ(file.mesh.points.row(1), Eigen::RowVector3d(1, 0, 0));
  std::string wrong = bin();
  wrong[56] = 4;
  EXPECT_EQ(code_of(glb(document(R"(,"indices":1)", "", sparse), wrong), "a.glb"), "E_INDEX_RANGE");
}

// Normalized integers are fractions of their largest value.
TEST(Glb, ReadsNormalizedIntegers) {
  std::string json = document(R"(,"indices":1)", "", R"(,"normalized":true)");
  json.replace(json.find("5126"), 4, "5122");
  const SurfaceFile file = parse(glb(json, bin()), "a.glb");
  // The bytes of 1.0f are 00 00 80 3f: 0x3f80 = 16256.
  EXPECT_EQ(file.mesh.points(2, 1), 16256.0 / 32767.0);
}

TEST(Glb, NamesWhatIsWrong) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string json = document(R"(,"indices":1)");
    json.replace(json.find(from), from.size(), to);
    return code_of(glb(json, bin()), "a.glb");
  };
  EXPECT_EQ(with(R"("count":4)", R"("count":5)"), "E_INDEX_RANGE");
  EXPECT_EQ(with(R"("count":4)", R"("count":4000000000)"), "E_COUNT_EXCEEDS_FILE");
  EXPECT_EQ(with(R"("count":4)", R"("count":-4)"), "E_NUMBER_RANGE");
  EXPECT_EQ(with(R"("count":6)", R"("count":7)"), "E_HEADER");
  EXPECT_EQ(with(R"("byteLength":48)", R"("byteLength":480)"), "E_INDEX_RANGE");
  EXPECT_EQ(with(R"("byteOffset":48)", R"("byteOffset":68)"), "E_INDEX_RANGE");
  EXPECT_EQ(with(R"("VEC3")", R"("VEC2")"), "E_HEADER");
  EXPECT_EQ(with(R"("mesh":0)", R"("mesh":1)"), "E_INDEX_RANGE");
  EXPECT_EQ(with(R"("mesh":0)", R"("mesh":0,"children":[0])"), "E_CYCLE");
  EXPECT_EQ(with(R"({"byteLength":72})", R"({"byteLength":72,"uri":"a.bin"})"), "E_HEADER");
  EXPECT_EQ(with(R"({"byteLength":72})", R"({"byteLength":72,"uri":"data:,"})"), "E_HEADER");
  EXPECT_EQ(
      with(R"("scene":0)", R"("scene":0,"extensionsRequired":["KHR_draco_mesh_compression"])"),
      "E_HEADER");
  EXPECT_EQ(with(R"("scene":0)", R"("scene":0,,)"), "E_SYNTAX");
  EXPECT_EQ(with(R"("scene":0)", R"("scene":1e999)"), "E_SYNTAX");
  EXPECT_EQ(with(R"("scene":0)", "\"x\":" + std::string(100000, '[')), "E_NESTING");
  std::string wrong = bin();
  wrong[50] = 4;
  EXPECT_EQ(code_of(glb(document(R"(,"indices":1)"), wrong), "a.glb"), "E_INDEX_RANGE");
  wrong = bin();
  wrong[2] = static_cast<char>(0xC0);
  wrong[3] = 0x7F;
  EXPECT_EQ(code_of(glb(document(R"(,"indices":1)"), wrong), "a.glb"), "E_NONFINITE");
}

// A thousand nodes that draw one mesh of a million points would need 24 GB.
TEST(Glb, RefusesScenesThatGrowWithoutBound) {
  std::string json = R"({"asset":{"version":"2.0"},"nodes":[)";
  for (int i = 0; i < 1000; ++i) json += i == 0 ? R"({"mesh":0})" : R"(,{"mesh":0})";
  json += R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
          R"("accessors":[{"componentType":5126,"count":999999,"type":"VEC3"}]})";
  EXPECT_EQ(code_of(glb(json, bin()), "a.glb"), "E_EXPANSION");
}

SurfaceOutput tetrahedron(double scale, const Eigen::RowVector3d& offset) {
  SurfaceOutput surface;
  surface.points.resize(4, 3);
  surface.points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  surface.points = (surface.points * scale).rowwise() + offset;
  surface.triangles.resize(4, 3);
  surface.triangles << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3;
  return surface;
}

// parse(format(s)) = s to the 24 bits of a float about the centre, at any scale and far from the
// origin: |error| <= 2^-24 of the extent, plus a rounding of the offset in double.
TEST(Glb, ReadsBackWhatItWrites) {
  for (const double scale : {1.0, 1e-30, 1e30, 1e-90, 1e90}) {
    for (const double far : {0.0, 1e7}) {
      SCOPED_TRACE(scale);
      const SurfaceOutput surface =
          tetrahedron(scale, Eigen::RowVector3d(far, -far, 2 * far) * scale);
      const SurfaceFile file = parse(format_surface(surface, SurfaceFormat::glb), "a.glb");
      ASSERT_EQ(file.mesh.points.rows(), 4);
      const double error = (file.mesh.points - surface.points).cwiseAbs().maxCoeff();
      EXPECT_LE(error, scale * (0x1p-24 + 4 * far * 0x1p-52));
      for (Eigen::Index i = 0; i < 12; ++i) {
        EXPECT_EQ(file.mesh.face_index[i], surface.triangles.data()[i]);
      }
      ASSERT_EQ(file.mesh.normals.rows(), 4);
      EXPECT_NEAR(file.mesh.normals.row(0).norm(), 1.0, 1e-6);
      EXPECT_LT(file.mesh.normals.row(0).sum(), -1.7);  // outward: -(1, 1, 1) / sqrt(3)
      EXPECT_TRUE(file.warnings.empty());
    }
  }
}

// Colours and lines are carried, equal surfaces give equal bytes, clouds stay clouds.
TEST(Glb, WritesColoursLinesAndClouds) {
  SurfaceOutput surface = tetrahedron(1.0, Eigen::RowVector3d::Zero());
  for (const char* name : {"red", "green", "blue"}) {
    surface.properties.push_back({name, Eigen::VectorXd::Constant(4, 255.0), true});
  }
  surface.lines.emplace_back(0, 3);
  const std::string bytes = format_surface(surface, SurfaceFormat::glb);
  EXPECT_NE(bytes.find("COLOR_0"), std::string::npos);
  EXPECT_NE(bytes.find("\"mode\":1"), std::string::npos);
  EXPECT_EQ(bytes.size() % 4, 0U);
  EXPECT_EQ(format_surface(surface, SurfaceFormat::glb), bytes);
  EXPECT_TRUE(parse(bytes, "a.glb").warnings.contains("W_UNSUPPORTED_NODE"));
  SurfaceOutput cloud = surface;
  cloud.triangles.resize(0, 3);
  EXPECT_EQ(parse(format_surface(cloud, SurfaceFormat::glb), "a.glb").mesh.points.rows(), 4);
  EXPECT_EQ(parse(format_surface({}, SurfaceFormat::glb), "a.glb").mesh.points.rows(), 0);
  surface.lines[0][1] = 4;
  EXPECT_THROW(format_surface(surface, SurfaceFormat::glb), InvalidArgument);
}

TEST(Glb, AnswersEveryPrefixAndDamagedBits) {
  const std::string whole = glb(document(R"(,"indices":1)", R"(,"scale":[2,2,2])"), bin());
  test::expect_prefixes_are_answered(whole, "a.glb");
  test::expect_flips_are_answered(whole, "a.glb", 3000);
}

}  // namespace
}  // namespace dupin
