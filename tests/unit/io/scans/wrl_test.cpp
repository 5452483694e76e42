#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "tests/support/data.h"
#include "tests/unit/io/scans/scan_files.h"

namespace dupin {
namespace {

using test::code_of;
using test::parse;

const std::string kHead2 = "#VRML V2.0 utf8\n";
const std::string kHead1 = "#VRML V1.0 ascii\n";
// A triangle and a quad, with commas, comments and both forms of white space.
const std::string kFaces =
    "IndexedFaceSet { coord Coordinate { point [ 0 0 0, 1 0 0, # a comment {[\n"
    "1 1 0, 0 1 0,\t2 0 0 ] }\n coordIndex [ 0, 1, 2, 3, -1, 1 4 2 -1 ] }";
const std::string kShape =
    "Shape { appearance Appearance { material Material { } }\n geometry " + kFaces + " }";

Eigen::RowVector3d point(const SurfaceFile& file, Eigen::Index i) {
  return file.mesh.points.row(i);
}

void expect_point(const SurfaceFile& file, Eigen::Index i, double x, double y, double z) {
  EXPECT_LT((point(file, i) - Eigen::RowVector3d(x, y, z)).norm(), 1e-14)
      << "point " << i << ": " << point(file, i);
}

// Faces of any size keep their order and their corners.
TEST(Wrl, ReadsMixedTrianglesAndQuads) {
  const SurfaceFile file = parse(kHead2 + kShape, "a.wrl");
  EXPECT_EQ(file.format, "wrl");
  EXPECT_TRUE(file.warnings.empty());
  ASSERT_EQ(file.mesh.points.rows(), 5);
  ASSERT_EQ(file.mesh.num_faces(), 2);
  const PolygonMesh::Indices expected = (PolygonMesh::Indices(7) << 0, 1, 2, 3, 1, 4, 2).finished();
  EXPECT_EQ(file.mesh.face_index, expected);
  EXPECT_EQ(file.mesh.face_offset[1], 4);
}

// Shapes follow each other: the second one's indices count from its own points.
TEST(Wrl, JoinsShapesInOrder) {
  const SurfaceFile file = parse(kHead2 + kShape + "\n" + kShape, "a.wrl");
  ASSERT_EQ(file.mesh.points.rows(), 10);
  ASSERT_EQ(file.mesh.num_faces(), 4);
  EXPECT_EQ(file.mesh.face_index[7], 5);
}

// ISO 14772-1, Transform: p -> T C R SR S SR^-1 C^-1 p. With centre c, R a quarter turn about z and
// scale (2, 1, 1): c + R S (p - c) + t.
TEST(Wrl, AppliesTransformsAboutTheirCentre) {
  const SurfaceFile file = parse(
      kHead2 + "Transform { center 1 0 0 translation 0 0 5 rotation 0 0 3 1.5707963267948966 " +
          "scale 2 1 1 children [ " + kShape + " ] }",
      "a.wrl");
  expect_point(file, 0, 1, -2, 5);
  expect_point(file, 1, 1, 0, 5);
  expect_point(file, 3, 0, -2, 5);
}

// A stretch along the diagonal: (1, 0) -> (1.5, 0.5) for a factor of 2 along (1, 1) / sqrt(2).
TEST(Wrl, AppliesScaleOrientation) {
  const SurfaceFile file = parse(kHead2 +
                                     "Transform { scale 2 1 1 scaleOrientation 0 0 1 "
                                     "0.78539816339744831 children " +
                                     kShape + " }",
                                 "a.wrl");
  expect_point(file, 1, 1.5, 0.5, 0);
}

// Nested transforms act from the inside out, and end with their node.
TEST(Wrl, EndsATransformWithItsNode) {
  const SurfaceFile file =
      parse(kHead2 +
                "Transform { scale 2 2 2 children Transform { translation 1 0 0 "
                "children [ " +
                kShape + " ] } } " + kShape,
            "a.wrl");
  expect_point(file, 0, 2, 0, 0);
  expect_point(file, 1, 4, 0, 0);
  expect_point(file, 6, 1, 0, 0);
}

// VRML 1: coordinates, transforms and hints act on what follows, until their Separator ends.
TEST(Wrl, CarriesTheStateOfVersion1) {
  const std::string text = kHead1 +
                           "Separator { Coordinate3 { point [ 0 0 0, 1 0 0, 0 1 0 ] }\n"
                           " Separator { Translation { translation 0 0 7 }\n"
                           "  MatrixTransform { matrix 2 0 0 0  0 2 0 0  0 0 2 0  5 0 0 1 }\n"
                           "  IndexedFaceSet { coordIndex [ 0, 1, 2, -1 ] } }\n"
                           " Transform { translation 1 0 0 scaleFactor 3 3 3 }\n"
                           " ShapeHints { vertexOrdering CLOCKWISE }\n"
                           " IndexedFaceSet { coordIndex [ 0, 1, 2 ] } }\n";
  const SurfaceFile file = parse(text, "a.wrl");
  ASSERT_EQ(file.mesh.points.rows(), 6);
  expect_point(file, 0, 5, 0, 7);
  expect_point(file, 1, 7, 0, 7);
  expect_point(file, 4, 4, 0, 0);
  EXPECT_EQ(file.mesh.face_index[1], 1);
  EXPECT_EQ(file.mesh.face_index[4], 5);  // turned over
}

// ccw FALSE turns faces over; a mirror turns them once more.
TEST(Wrl, TurnsClockwiseFacesAndMirrors) {
  std::string clockwise = kShape;
  clockwise.insert(clockwise.find("coordIndex"), "ccw FALSE ");
  const std::string mirror = "Transform { scale -1 1 1 children ";
  const auto face = [](const std::string& text) {
    return parse(kHead2 + text, "a.wrl").mesh.face_index.head(4).eval();
  };
  const Eigen::Vector4i kept(0, 1, 2, 3);
  const Eigen::Vector4i turned(0, 3, 2, 1);
  EXPECT_EQ(face(kShape), kept);
  EXPECT_EQ(face(clockwise), turned);
  EXPECT_EQ(face(mirror + kShape + "}"), turned);
  EXPECT_EQ(face(mirror + clockwise + "}"), kept);
}

// USE draws the node again where it stands.
TEST(Wrl, DrawsNamedNodesAgain) {
  const SurfaceFile file = parse(
      kHead2 + "DEF it " + kShape + " Transform { translation 0 0 9 children USE it }", "a.wrl");
  ASSERT_EQ(file.mesh.points.rows(), 10);
  expect_point(file, 6, 1, 0, 9);
}

// Normals come along when there is one for each point, and turn with the surface.
TEST(Wrl, KeepsNormalsThatBelongToPoints) {
  std::string shape = kShape;
  shape.insert(shape.find("coordIndex"),
               "normal Normal { vector [ 0 0 1, 0 0 1, 0 0 1, 0 0 1, 1 0 0 ] } ");
  EXPECT_EQ(parse(kHead2 + shape, "a.wrl").mesh.normals.rows(), 5);
  const SurfaceFile turned = parse(
      kHead2 + "Transform { rotation 0 1 0 1.5707963267948966 scale 4 1 1 children " + shape + "}",
      "a.wrl");
  ASSERT_EQ(turned.mesh.normals.rows(), 5);
  EXPECT_LT((turned.mesh.normals.row(0) - Eigen::RowVector3d(1, 0, 0)).norm(), 1e-14);
  EXPECT_LT((turned.mesh.normals.row(4) - Eigen::RowVector3d(0, 0, -1)).norm(), 1e-14);
  shape.insert(shape.find("coordIndex"), "normalPerVertex FALSE ");
  EXPECT_EQ(parse(kHead2 + shape, "a.wrl").mesh.normals.rows(), 0);
}

// What is not a surface is stepped over, whatever it holds; prototypes are not instantiated.
TEST(Wrl, StepsOverWhatItDoesNotKnow) {
  const std::string text =
      kHead2 +
      "PROTO P [ field SFNode x NULL exposedField MFFloat y [ 1 2 ] ] { Group { children [ " +
      kShape + " ] } }\nEXTERNPROTO Q [ ] \"http://localhost/x.wrl\"\n" + "P { x " + kShape +
      " }\nViewpoint { description \"a } quote \\\" and ]\" }\n" +
      "Script { url [ \"a\", \"b\" ] field SFBool on TRUE }\n" + kShape +
      "\nROUTE a.b TO c.d\nSwitch { choice [ " + kShape + " ] }\n" +
      "Switch { whichChoice 1 choice [ Group { } " + kShape + " ] }\n" + "Collision { proxy " +
      kShape + " children [ ] }\nLOD { level [ " + kShape + kShape + " ] }";
  const SurfaceFile file = parse(text, "a.wrl");
  EXPECT_EQ(file.mesh.points.rows(), 15);
  EXPECT_TRUE(file.warnings.empty());
}

// Other geometry is left out and counted; an Inline file is never opened.
TEST(Wrl, CountsWhatItLeavesOut) {
  const SurfaceFile file =
      parse(kHead2 + "Inline { url \"file:///etc/passwd\" } Shape { geometry Sphere { radius 2 } }",
            "a.wrl");
  EXPECT_EQ(file.mesh.points.rows(), 0);
  EXPECT_EQ(file.mesh.num_faces(), 0);
  ASSERT_EQ(file.warnings.all().size(), 1U);
  EXPECT_EQ(file.warnings.all()[0].code, "W_UNSUPPORTED_NODE");
  EXPECT_EQ(file.warnings.all()[0].count, 2);
}

TEST(Wrl, NamesWhatIsWrongAndWhere) {
  EXPECT_EQ(code_of(kHead2 + "DEF A Group { children [ USE A ] }", "a.wrl"), "E_CYCLE");
  EXPECT_EQ(code_of(kHead2 + "Group { children [ 1 ] ", "a.wrl"), "E_TRUNCATED");
  EXPECT_EQ(code_of(kHead2 + "Group { ] }", "a.wrl"), "E_SYNTAX");
  EXPECT_EQ(code_of(kHead2 + "}", "a.wrl"), "E_SYNTAX");
  EXPECT_EQ(code_of(kHead2, "a.wrl"), "E_TRUNCATED");
  EXPECT_EQ(code_of("#VRML V3.0 utf8\n" + kShape, "a.wrl"), "E_HEADER");
  std::string text = kHead2 + kShape;
  text.replace(text.find("-1, 1 4"), 7, "-1,\n1 5");
  EXPECT_EQ(code_of(text, "a.wrl"), "E_INDEX_RANGE");
  EXPECT_EQ(test::error_line(text, "a.wrl"), 6);
  for (const auto& [bad, code] : std::vector<std::pair<std::string, std::string>>{
           {"-2", "E_INDEX_RANGE"}, {"4294967297", "E_INDEX_RANGE"}, {"1.5", "E_SYNTAX"}}) {
    std::string damaged = kHead2 + kShape;
    damaged.replace(damaged.find("-1, 1 4") + 6, 1, bad);
    EXPECT_EQ(code_of(damaged, "a.wrl"), code) << bad;
  }
  for (const auto& [bad, code] :
       std::vector<std::pair<std::string, std::string>>{{"nan", "E_NONFINITE"},
                                                        {"1e400", "E_NUMBER_RANGE"},
                                                        {"-1.#IND", "E_SYNTAX"},
                                                        {"x", "E_SYNTAX"},
                                                        {"", "E_SYNTAX"}}) {
    std::string damaged = kHead2 + kShape;
    damaged.replace(damaged.find("1 1 0"), 1, bad);
    EXPECT_EQ(code_of(damaged, "a.wrl"), code) << bad;
    EXPECT_EQ(test::error_line(damaged, "a.wrl"), bad.empty() ? 3 : 4) << bad;
  }
}

// 100,000 open groups are refused at the 65th, not on the stack.
TEST(Wrl, RefusesDeepNestingAtOnce) {
  std::string text = kHead2;
  for (int i = 0; i < 100000; ++i) text += "Group { children [ ";
  // The least of several: on a busy machine any one may wait.
  auto least = std::chrono::steady_clock::duration::max();
  for (int attempt = 0; attempt < 5 && least >= std::chrono::milliseconds(200); ++attempt) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_EQ(code_of(text, "a.wrl"), "E_NESTING");
    EXPECT_EQ(code_of(kHead2 + "Group { x " + std::string(100000, '['), "a.wrl"), "E_NESTING");
    least = std::min(least, std::chrono::steady_clock::now() - start);
  }
  EXPECT_LT(least, std::chrono::milliseconds(200));
  std::string deep = kHead2;
  for (int i = 0; i < 61; ++i) deep += "Group { children [ ";
  deep += kShape;
  for (int i = 0; i < 61; ++i) deep += "] }";
  EXPECT_EQ(code_of(deep, "a.wrl"), "");
}

// Sixty doublings by USE would draw 2^60 shapes.
TEST(Wrl, RefusesScenesThatGrowWithoutBound) {
  std::string text = kHead2 + "DEF g0 " + kShape + "\n";
  for (int i = 1; i < 60; ++i) {
    const std::string last = "USE g" + std::to_string(i - 1) + " ";
    text += "DEF g" + std::to_string(i) + " Group { children [ " + last + last + "] }\n";
  }
  EXPECT_EQ(code_of(text, "a.wrl"), "E_EXPANSION");
}

TEST(Wrl, AnswersEveryPrefixAndDamagedBits) {
  const std::string whole = kHead2 + "Transform { scale 1 2 3 children [ " + kShape + " ] }\n";
  test::expect_prefixes_are_answered(whole, "a.wrl");
  test::expect_flips_are_answered(whole, "a.wrl", 3000);
}

// Files that other programs wrote: a robot of many shapes and transforms, a bridge of lines only.
TEST(Wrl, ReadsFilesOfOtherPrograms) {
  DUPIN_REQUIRE_SHARED(robot, "parsers/bot2.wrl");
  DUPIN_REQUIRE_SHARED(bridge, "parsers/bridge.wrl");
  const SurfaceFile file = read_surface(robot);
  EXPECT_GT(file.mesh.points.rows(), 300);
  EXPECT_GT(file.mesh.num_faces(), 300);
  test::expect_sound(file.mesh);
  const SurfaceFile lines = read_surface(bridge);
  EXPECT_EQ(lines.mesh.num_faces(), 0);
  EXPECT_TRUE(lines.warnings.contains("W_UNSUPPORTED_NODE"));
}

}  // namespace
}  // namespace dupin
