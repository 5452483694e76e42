#include <gtest/gtest.h>

#include <limits>

#include "tests/support/data.h"
#include "tests/unit/io/scans/scan_files.h"

namespace dupin {
namespace {

using test::code_of;
using test::parse;

// Three columns are coordinates; comments, blank lines and CR LF are no points.
TEST(Xyz, ReadsColumnsOfNumbers) {
  const SurfaceFile file = parse("# x y z\r\n1 2 3\r\n\r\n-1e-3 +.5 6e2\r\n", "a.xyz");
  EXPECT_EQ(file.format, "xyz");
  ASSERT_EQ(file.mesh.points.rows(), 2);
  EXPECT_EQ(file.mesh.points.row(1), Eigen::RowVector3d(-1e-3, 0.5, 600));
  EXPECT_EQ(file.mesh.num_faces(), 0);
  EXPECT_EQ(file.mesh.normals.rows(), 0);
}

// The last three of six columns or more are normals exactly if all of them are unit vectors.
TEST(Xyz, TellsNormalsFromColoursByTheirLength) {
  EXPECT_EQ(parse("1 2 3 0 0 1\n4 5 6 0.577 -0.577 0.577\n", "a.xyz").mesh.normals.rows(), 2);
  EXPECT_EQ(parse("1 2 3 9 9 9 0 0 1\n", "a.xyz").mesh.normals(0, 2), 1.0);
  EXPECT_EQ(parse("1 2 3 0 0 1\n4 5 6 255 0 0\n", "a.xyz").mesh.normals.rows(), 0);
  EXPECT_EQ(parse("1 2 3 0.5 1 0 0\n", "a.pts").mesh.normals.rows(), 1);
  EXPECT_EQ(parse("1 2 3 0.5 128 128 128\n", "a.pts").mesh.normals.rows(), 0);
}

// PTS announces its points, once for each scan; some programs leave the number out.
TEST(Pts, ReadsWithAndWithoutCounts) {
  EXPECT_EQ(parse("2\n1 2 3 -500 1 2 3\n4 5 6 7 8 9 10\n", "a.pts").mesh.points.rows(), 2);
  EXPECT_EQ(parse("1\n1 2 3\n2\n4 5 6\n7 8 9\n", "a.pts").mesh.points.rows(), 3);
  EXPECT_EQ(parse("1 2 3\n4 5 6\n", "a.pts").mesh.points.rows(), 2);
}

TEST(Xyz, NamesWhatIsWrongAndWhere) {
  EXPECT_EQ(code_of("1 2 3\n4 5\n", "a.xyz"), "E_SYNTAX");
  EXPECT_EQ(test::error_line("1 2 3\n4 5\n", "a.xyz"), 2);
  EXPECT_EQ(code_of("1,5 2 3\n", "a.xyz"), "E_DECIMAL_COMMA");
  EXPECT_EQ(code_of("1 2 nan\n", "a.xyz"), "E_NONFINITE");
  EXPECT_EQ(code_of("1 2 1e999\n", "a.xyz"), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of("3\n1 2 3\n4 5 6\n", "a.pts"), "E_TRUNCATED");
  EXPECT_EQ(code_of("1\n1 2 3\n4 5 6\n", "a.pts"), "E_SYNTAX");
  EXPECT_EQ(code_of("-1\n1 2 3\n", "a.pts"), "E_NUMBER_RANGE");
  EXPECT_EQ(code_of("4000000000\n1 2 3\n", "a.pts"), "E_COUNT_EXCEEDS_FILE");
  ReadOptions options;
  options.limits.max_vertices = 1;
  EXPECT_EQ(code_of("1 2 3\n4 5 6\n", "a.xyz", options), "E_TOO_LARGE");
}

const std::string kFields =
    "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
    "FIELDS rgb x y z normal_x normal_y normal_z\nSIZE 4 4 4 8 4 4 4\n"
    "TYPE U F F F F F F\nCOUNT 1 1 1 1 1 1 1\n"
    "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n";

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
const float kValues[3][6] = {{1.0F, 2.0F, 3.5F, 0.0F, 0.0F, 1.0F},
                             {kNan, kNan, kNan, kNan, kNan, kNan},
                             {-4.0F, 5.0F, 6.25F, 1.0F, 0.0F, 0.0F}};

std::string pcd_ascii() {
  return kFields + "DATA ascii\n7 1 2 3.5 0 0 1\n7 nan nan nan nan nan nan\n7 -4 5 6.25 1 0 0\n";
}

std::string pcd_binary() {
  std::string bytes = kFields + "DATA binary\n";
  for (const auto& row : kValues) {
    test::append_bits(bytes, 7, 4);
    for (int k = 0; k < 6; ++k) {
      if (k == 2) {
        test::append_double(bytes, static_cast<double>(row[k]));
      } else {
        test::append_float(bytes, row[k]);
      }
    }
  }
  return bytes;
}

/// LZF without any copy: runs of at most 32 literal bytes.
std::string literal_lzf(const std::string& data) {
  std::string packed;
  for (std::size_t at = 0; at < data.size(); at += 32) {
    const std::string run = data.substr(at, 32);
    packed.push_back(static_cast<char>(run.size() - 1));
    packed += run;
  }
  return packed;
}

std::string field_by_field() {
  std::string data;
  for (int i = 0; i < 3; ++i) test::append_bits(data, 7, 4);
  for (int k = 0; k < 6; ++k) {
    for (const auto& row : kValues) {
      if (k == 2) {
        test::append_double(data, static_cast<double>(row[k]));
      } else {
        test::append_float(data, row[k]);
      }
    }
  }
  return data;
}

std::string pcd_compressed(const std::string& packed, std::size_t expanded) {
  std::string bytes = kFields + "DATA binary_compressed\n";
  test::append_bits(bytes, packed.size(), 4);
  test::append_bits(bytes, expanded, 4);
  return bytes + packed;
}

// The three storages hold the same cloud; the point without coordinates is left out and counted.
TEST(Pcd, ThreeStoragesGiveTheSameCloud) {
  const SurfaceFile expected = parse(pcd_ascii(), "a.pcd");
  ASSERT_EQ(expected.mesh.points.rows(), 2);
  EXPECT_EQ(expected.mesh.points.row(1), Eigen::RowVector3d(-4, 5, 6.25));
  EXPECT_EQ(expected.mesh.normals.row(1), Eigen::RowVector3d(1, 0, 0));
  const std::string data = field_by_field();
  for (const std::string& text : {pcd_binary(), pcd_compressed(literal_lzf(data), data.size())}) {
    const SurfaceFile file = parse(text, "a.pcd");
    EXPECT_TRUE(test::equal_meshes(file.mesh, expected.mesh));
    EXPECT_TRUE(file.is_binary);
    ASSERT_EQ(file.warnings.all().size(), 1U);
    EXPECT_EQ(file.warnings.all()[0].code, "W_INVALID_POINTS");
    EXPECT_EQ(file.warnings.all()[0].count, 1);
  }
}

// A copy of LZF may overlap what it makes: "a" and a copy of 11 bytes at distance 1 is twelve "a".
TEST(Pcd, ExpandsOverlappingCopies) {
  const std::string header =
      "# .PCD v0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
      "DATA binary_compressed\n";
  std::string packed(
      "\x00"
      "a"
      "\xE0\x02\x00",
      5);
  std::string bytes = header;
  test::append_bits(bytes, packed.size(), 4);
  test::append_bits(bytes, 12, 4);
  const SurfaceFile file = parse(bytes + packed, "a.pcd");
  const double value = static_cast<double>(std::bit_cast<float>(0x61616161U));
  ASSERT_EQ(file.mesh.points.rows(), 1);
  EXPECT_EQ(file.mesh.points.row(0), Eigen::RowVector3d(value, value, value));
  packed[4] = 1;  // a distance beyond the start
  EXPECT_EQ(code_of(bytes + packed, "a.pcd"), "E_SYNTAX");
}

TEST(Pcd, NamesWhatIsWrong) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = pcd_ascii();
    text.replace(text.find(from), from.size(), to);
    return code_of(text, "a.pcd");
  };
  EXPECT_EQ(with("POINTS 3", "POINTS 4"), "E_HEADER");
  EXPECT_EQ(with("WIDTH 3", "WIDTH -3"), "E_NUMBER_RANGE");
  EXPECT_EQ(with("TYPE U F", "TYPE U X"), "E_SYNTAX");
  EXPECT_EQ(with("SIZE 4 4", "SIZE 4 3"), "E_HEADER");
  EXPECT_EQ(with("x y z", "x y w"), "E_HEADER");
  EXPECT_EQ(with("DATA ascii", "DATA text"), "E_HEADER");
  std::string huge = pcd_ascii();
  huge.replace(huge.find("WIDTH 3"), 7, "WIDTH 4000000000");
  huge.replace(huge.find("POINTS 3"), 8, "POINTS 4000000000");
  EXPECT_EQ(code_of(huge, "a.pcd"), "E_COUNT_EXCEEDS_FILE");
  EXPECT_EQ(code_of(pcd_binary().substr(0, pcd_binary().size() - 1), "a.pcd"), "E_TRUNCATED");
  const std::string data = field_by_field();
  EXPECT_EQ(code_of(pcd_compressed(literal_lzf(data), data.size() + 1), "a.pcd"), "E_HEADER");
}

TEST(Pcd, AnswersEveryPrefixAndDamagedBits) {
  const std::string data = field_by_field();
  for (const std::string& text :
       {pcd_ascii(), pcd_binary(), pcd_compressed(literal_lzf(data), data.size())}) {
    test::expect_prefixes_are_answered(text, "a.pcd");
    test::expect_flips_are_answered(text, "a.pcd", 2000);
  }
}

// Two views of a bunny in two versions of the format, and a milk carton.
TEST(Pcd, ReadsFilesOfOtherPrograms) {
  DUPIN_REQUIRE_SHARED(bun0, "registration/bunny_views/bun0.pcd");
  DUPIN_REQUIRE_SHARED(bun4, "registration/bunny_views/bun4.pcd");
  DUPIN_REQUIRE_SHARED(milk, "registration/bunny_views/milk.pcd");
  const SurfaceFile first = read_surface(bun0);
  EXPECT_EQ(first.mesh.points.rows(), 397);
  EXPECT_EQ(first.mesh.normals.rows(), 397);
  EXPECT_EQ(first.mesh.points.row(0), Eigen::RowVector3d(0.0054215998, 0.11349, 0.040748999));
  EXPECT_EQ(read_surface(bun4).mesh.points.rows(), 361);
  EXPECT_EQ(read_surface(milk).mesh.points.rows(), 13704);
}

}  // namespace
}  // namespace dupin
