#include <gtest/gtest.h>
#include <zlib.h>

#include <limits>

#include "dupin/mesh/range_grid.h"
#include "tests/unit/io/scans/scan_files.h"

namespace dupin {
namespace {

RangeGrid make_grid(Eigen::Index rows, Eigen::Index cols,
                    const std::function<double(Eigen::Index, Eigen::Index)>& depth) {
  RangeGrid grid{rows, cols, Points(rows * cols, 3), {}};
  grid.is_valid.assign(static_cast<std::size_t>(rows * cols), 1);
  for (Eigen::Index r = 0; r < rows; ++r) {
    for (Eigen::Index c = 0; c < cols; ++c) {
      // Rows run down, as in a picture.
      grid.points.row(r * cols + c) << static_cast<double>(c), -static_cast<double>(r), depth(r, c);
    }
  }
  return grid;
}

double twice_projected_area(const PolygonMesh& mesh, Eigen::Index face) {
  const auto p = [&](int k) { return mesh.points.row(mesh.face_index[3 * face + k]).eval(); };
  const Eigen::RowVector3d u = p(1) - p(0);
  const Eigen::RowVector3d v = p(2) - p(0);
  return u.x() * v.y() - u.y() * v.x();
}

// R x C valid pixels make 2 (R - 1)(C - 1) triangles that tile the rectangle, all facing +z.
TEST(RangeGrid, TilesTheRectangleFacingTheScanner) {
  const PolygonMesh mesh = triangulate_range_grid(make_grid(4, 6, [](auto, auto) { return 0.0; }));
  ASSERT_EQ(mesh.points.rows(), 24);
  ASSERT_EQ(mesh.num_faces(), 30);
  double area = 0.0;
  for (Eigen::Index f = 0; f < 30; ++f) {
    EXPECT_GT(twice_projected_area(mesh, f), 0.0);
    area += 0.5 * twice_projected_area(mesh, f);
  }
  EXPECT_EQ(area, 15.0);
}

// Turning the order of the rows or columns around changes the numbering, never the side.
TEST(RangeGrid, FacesTheScannerWhateverTheOrderOfTheRows) {
  RangeGrid grid = make_grid(3, 3, [](auto r, auto c) { return 0.1 * static_cast<double>(r + c); });
  grid.points.col(1) *= -1.0;
  const PolygonMesh mesh = triangulate_range_grid(grid);
  ASSERT_EQ(mesh.num_faces(), 8);
  for (Eigen::Index f = 0; f < 8; ++f) EXPECT_GT(twice_projected_area(mesh, f), 0.0);
}

// A step of 4 edges is a slope, a step of 6 is a jump (the limit is 5 median edges).
TEST(RangeGrid, CutsAtDepthJumps) {
  const auto step = [](double height) {
    return make_grid(10, 10, [=](auto, auto c) { return c < 5 ? 0.0 : height; });
  };
  EXPECT_EQ(triangulate_range_grid(step(4.0)).num_faces(), 162);
  EXPECT_EQ(triangulate_range_grid(step(6.0)).num_faces(), 144);
  EXPECT_EQ(triangulate_range_grid(step(6.0), {.max_depth_jump = 7.0}).num_faces(), 162);
  EXPECT_EQ(triangulate_range_grid(step(6.0)).points.rows(), 100);
}

// The shorter diagonal of a bent cell is the one between its two equal depths.
TEST(RangeGrid, SplitsCellsAlongTheShorterDiagonal) {
  RangeGrid grid = make_grid(2, 2, [](auto r, auto c) { return r == 0 && c == 0 ? 1.0 : 0.0; });
  const PolygonMesh mesh = triangulate_range_grid(grid);
  ASSERT_EQ(mesh.num_faces(), 2);
  for (Eigen::Index f = 0; f < 2; ++f) {
    const auto corners = mesh.face_index.segment<3>(3 * f);
    EXPECT_TRUE((corners.array() == 1).any() && (corners.array() == 2).any());
  }
}

// Invalid pixels get no number; a cell with three valid ones is one triangle.
TEST(RangeGrid, NumbersTheValidPixelsInRowOrder) {
  RangeGrid grid = make_grid(3, 3, [](auto, auto) { return 0.0; });
  grid.is_valid[4] = 0;
  grid.points.row(4).setConstant(std::numeric_limits<double>::quiet_NaN());
  const PolygonMesh mesh = triangulate_range_grid(grid);
  ASSERT_EQ(mesh.points.rows(), 8);
  EXPECT_EQ(mesh.points(4, 0), 2.0);
  EXPECT_EQ(mesh.num_faces(), 4);
}

// Lengths scale: the same triangles from 1e-200 to 1e200.
TEST(RangeGrid, IsEquivariantUnderUniformScaling) {
  RangeGrid grid = make_grid(
      5, 5, [](auto r, auto c) { return r * c > 6 ? 9.0 : 0.1 * static_cast<double>(c); });
  const PolygonMesh expected = triangulate_range_grid(grid);
  for (const double s : {0x1p-660, 0x1p-10, 0x1p660}) {
    RangeGrid scaled = grid;
    scaled.points *= s;
    EXPECT_EQ(triangulate_range_grid(scaled).face_index, expected.face_index);
  }
}

TEST(RangeGrid, RefusesWhatIsNoGrid) {
  RangeGrid grid = make_grid(2, 2, [](auto, auto) { return 0.0; });
  EXPECT_THROW(triangulate_range_grid(grid, {.max_depth_jump = -1.0}), InvalidArgument);
  grid.points(3, 2) = std::numeric_limits<double>::infinity();
  EXPECT_THROW(triangulate_range_grid(grid), InvalidArgument);
  grid.is_valid.pop_back();
  EXPECT_THROW(triangulate_range_grid(grid), InvalidArgument);
  EXPECT_EQ(triangulate_range_grid({}).num_faces(), 0);
}

constexpr double kInvalid = -999999.0;

std::string abs_text(const RangeGrid& grid) {
  std::string text = std::to_string(grid.rows) + " rows\n" + std::to_string(grid.cols) +
                     " columns\npixels (flag X Y Z):\n";
  for (const auto flag : grid.is_valid) text += flag != 0 ? "1 " : "0 ";
  for (int k = 0; k < 3; ++k) {
    text += "\n";
    for (Eigen::Index i = 0; i < grid.points.rows(); ++i) {
      const bool valid = grid.is_valid[static_cast<std::size_t>(i)] != 0;
      text += std::to_string(valid ? grid.points(i, k) : kInvalid) + " ";
    }
  }
  return text + "\n";
}

constexpr double kBackground = -1e9;

std::string bnt_bytes(const RangeGrid& grid) {
  std::string bytes;
  const std::string image = "bs000_N_N_0.png";
  test::append_bits(bytes, static_cast<std::uint64_t>(grid.rows), 2);
  test::append_bits(bytes, static_cast<std::uint64_t>(grid.cols), 2);
  test::append_double(bytes, kBackground);
  test::append_bits(bytes, image.size(), 2);
  bytes += image;
  test::append_bits(bytes, 5 * grid.is_valid.size(), 4);
  for (int k = 0; k < 5; ++k) {
    for (Eigen::Index i = 0; i < grid.points.rows(); ++i) {
      const bool valid = grid.is_valid[static_cast<std::size_t>(i)] != 0;
      test::append_double(bytes, !valid ? kBackground : k < 3 ? grid.points(i, k) : 0.5);
    }
  }
  return bytes;
}

RangeGrid sample() {
  RangeGrid grid = make_grid(4, 5, [](auto r, auto c) {
    return 0.25 * static_cast<double>(r * r) - 0.125 * static_cast<double>(c);
  });
  grid.is_valid[7] = grid.is_valid[0] = 0;
  return grid;
}

// Both formats hold the same picture, so both give its triangulation, bit for bit.
TEST(RangeFiles, AbsAndBntGiveTheGridTheyHold) {
  const PolygonMesh expected = triangulate_range_grid(sample());
  for (const auto& [text, name] : {std::pair{abs_text(sample()), std::string("a.abs")},
                                   std::pair{bnt_bytes(sample()), std::string("a.bnt")}}) {
    const SurfaceFile file = test::parse(text, name);
    EXPECT_EQ("a." + file.format, name);
    EXPECT_TRUE(file.warnings.empty());
    EXPECT_TRUE(test::equal_meshes(file.mesh, expected)) << name;
  }
}

std::string gzipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&stream, text.size()) + 64, '\0');
  std::string copy = text;
  stream.next_in = reinterpret_cast<Bytef*>(copy.data());
  stream.avail_in = static_cast<uInt>(copy.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

// The database ships its pictures packed; a packed file under another name is a mistake.
TEST(RangeFiles, ReadsPackedPictures) {
  const std::string packed = gzipped(abs_text(sample()));
  EXPECT_TRUE(test::equal_meshes(test::parse(packed, "02463d546.abs.gz").mesh,
                                 triangulate_range_grid(sample())));
  EXPECT_EQ(test::code_of(packed, "a.abs"), "E_MAGIC");
  EXPECT_EQ(test::code_of(packed.substr(0, packed.size() / 2), "a.abs.gz"), "E_TRUNCATED");
}

// A flag without coordinates is a measurement that is missing: dropped, and counted.
TEST(RangeFiles, DropsPixelsWithoutCoordinates) {
  std::string text = abs_text(sample());
  text.replace(text.find("0 1"), 1, "1");
  const SurfaceFile file = test::parse(text, "a.abs");
  ASSERT_EQ(file.warnings.all().size(), 1U);
  EXPECT_EQ(file.warnings.all()[0].code, "W_INVALID_POINTS");
  EXPECT_EQ(file.warnings.all()[0].count, 1);
  EXPECT_EQ(file.mesh.points.rows(), 18);
}

TEST(RangeFiles, NamesWhatIsWrong) {
  EXPECT_EQ(test::code_of("4000000000 rows\n3 columns\npixels (flag X Y Z):\n1 1", "a.abs"),
            "E_COUNT_EXCEEDS_FILE");
  EXPECT_EQ(test::code_of("-4 rows\n3 columns\npixels (flag X Y Z):\n1 1", "a.abs"),
            "E_NUMBER_RANGE");
  EXPECT_EQ(test::code_of("4 rows\n3 lines\n", "a.abs"), "E_SYNTAX");
  std::string text = abs_text(sample());
  text.replace(text.find("0.250000"), 8, "nan     ");
  EXPECT_EQ(test::code_of(text, "a.abs"), "E_NONFINITE");
  ReadOptions lenient;
  lenient.drop_nonfinite = true;
  EXPECT_EQ(test::parse(text, "a.abs", lenient).mesh.points.rows(), 17);
  std::string bytes = bnt_bytes(sample());
  bytes[29] = 3;  // the count of values
  EXPECT_EQ(test::code_of(bytes, "a.bnt"), "E_HEADER");
}

// Pixels without known neighbours are a point cloud, and it is said.
TEST(RangeFiles, ReadsAPictureOfUnknownShapeAsACloud) {
  std::string bytes = bnt_bytes(sample());
  bytes[0] = 3;
  const SurfaceFile file = test::parse(bytes, "a.bnt");
  EXPECT_EQ(file.mesh.points.rows(), 18);
  EXPECT_EQ(file.mesh.num_faces(), 0);
  EXPECT_TRUE(file.warnings.contains("W_GRID_SIZE"));
}

TEST(RangeFiles, AnswersEveryPrefixAndDamagedBits) {
  for (const auto& [text, name] : {std::pair{abs_text(sample()), std::string("a.abs")},
                                   std::pair{bnt_bytes(sample()), std::string("a.bnt")}}) {
    SCOPED_TRACE(name);
    test::expect_prefixes_are_answered(text, name);
    test::expect_flips_are_answered(text, name, 2000);
  }
}

}  // namespace
}  // namespace dupin
