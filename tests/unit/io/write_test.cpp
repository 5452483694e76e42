#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/surface_io.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

PolygonMesh read_back(const SurfaceOutput& surface, SurfaceFormat format, const char* name) {
  const SurfaceFile file = parse_surface(test::bytes_of(format_surface(surface, format)), name);
  EXPECT_TRUE(file.warnings.empty());
  return file.mesh;
}

bool holds(const PolygonMesh& mesh, const SurfaceOutput& surface) {
  if (mesh.points.rows() != surface.points.rows()) return false;
  if (mesh.num_faces() != surface.triangles.rows()) return false;
  const auto size = static_cast<std::size_t>(surface.points.size());
  return mesh.face_offset.size() == 0 &&
         std::memcmp(mesh.points.data(), surface.points.data(), size * sizeof(double)) == 0 &&
         (mesh.face_index.size() == 0 ||
          std::memcmp(mesh.face_index.data(), surface.triangles.data(),
                      static_cast<std::size_t>(mesh.face_index.size()) * sizeof(std::int32_t)) ==
              0);
}

// Random doubles of every magnitude: any bits that are finite.
SurfaceOutput random_surface(std::uint64_t seed) {
  Rng random(seed);
  SurfaceOutput surface;
  surface.points.resize(1 + static_cast<Eigen::Index>(random.below(50)), 3);
  for (Eigen::Index i = 0; i < surface.points.size(); ++i) {
    const std::uint64_t bits = random.next();
    const bool is_finite = (bits >> 52U & 0x7FFU) != 0x7FFU;
    const double value = is_finite ? std::bit_cast<double>(bits) : -0.0;
    surface.points.data()[i] = random.below(2) == 0 ? value : random.normal();
  }
  surface.triangles.resize(static_cast<Eigen::Index>(random.below(80)), 3);
  const auto num_points = static_cast<std::uint64_t>(surface.points.rows());
  for (Eigen::Index i = 0; i < surface.triangles.size(); ++i) {
    surface.triangles.data()[i] = static_cast<std::int32_t>(random.below(num_points));
  }
  return surface;
}

// read(write(m)) = m to the last bit, for every finite double, in the formats that hold doubles.
TEST(WriteSurface, ReadingBackGivesTheSameBits) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const SurfaceOutput surface = random_surface(seed);
    SCOPED_TRACE(seed);
    EXPECT_TRUE(holds(read_back(surface, SurfaceFormat::ply_binary, "a.ply"), surface));
    EXPECT_TRUE(holds(read_back(surface, SurfaceFormat::ply_ascii, "a.ply"), surface));
    EXPECT_TRUE(holds(read_back(surface, SurfaceFormat::obj, "a.obj"), surface));
    EXPECT_TRUE(holds(read_back(surface, SurfaceFormat::off, "a.off"), surface));
  }
}

SurfaceOutput output_of(const PolygonMesh& mesh) {
  SurfaceOutput surface;
  surface.points = mesh.points;
  surface.triangles = Eigen::Map<const Triangles>(mesh.face_index.data(), mesh.num_faces(), 3);
  return surface;
}

// STL holds no numbering: vertices come back in the order in which faces name them. Once in this
// order, nothing changes any more, so welding is idempotent.
TEST(WriteSurface, StlWeldsToTheSameSurfaceAndStaysThere) {
  const SurfaceOutput surface = test::icosahedron();
  for (const SurfaceFormat format : {SurfaceFormat::stl_ascii, SurfaceFormat::stl_binary}) {
    const PolygonMesh once = read_back(surface, format, "a.stl");
    ASSERT_EQ(once.points.rows(), 12);
    ASSERT_EQ(once.num_faces(), 20);
    for (Eigen::Index i = 0; i < once.face_index.size(); ++i) {
      const Eigen::RowVector3d expected = surface.points.row(surface.triangles.data()[i]);
      const Eigen::RowVector3d actual = once.points.row(once.face_index[i]);
      if (format == SurfaceFormat::stl_ascii) {
        EXPECT_EQ(actual, expected);
      } else {
        EXPECT_EQ(actual.cast<float>(), expected.cast<float>());
      }
    }
    EXPECT_TRUE(test::is_same_mesh(read_back(output_of(once), format, "a.stl"), once));
  }
}

TEST(WriteSurface, StlTakesMinusZeroForZero) {
  SurfaceOutput surface;
  surface.points.resize(4, 3);
  surface.points << 0.0, 0, 0, 1, 0, 0, 0, 1, 0, -0.0, -0.0, 0.0;
  surface.triangles.resize(2, 3);
  surface.triangles << 0, 1, 2, 3, 2, 1;
  for (const SurfaceFormat format : {SurfaceFormat::stl_ascii, SurfaceFormat::stl_binary}) {
    const PolygonMesh mesh = read_back(surface, format, "a.stl");
    EXPECT_EQ(mesh.points.rows(), 3);
    EXPECT_FALSE(std::signbit(mesh.points(0, 0)));
  }
}

// Properties and edges are extra columns and elements: the surface reads back as without them.
TEST(WriteSurface, PlyCarriesPropertiesAndLines) {
  SurfaceOutput surface = test::icosahedron();
  surface.properties.push_back({"k1", Eigen::VectorXd::LinSpaced(12, -1.0, 1.0 / 3.0), false});
  surface.properties.push_back({"red", Eigen::VectorXd::LinSpaced(12, 0.0, 255.0), true});
  surface.lines = {{0, 11}, {5, 1}};
  for (const SurfaceFormat format : {SurfaceFormat::ply_ascii, SurfaceFormat::ply_binary}) {
    const std::string text = format_surface(surface, format);
    EXPECT_NE(text.find("property double k1\nproperty uchar red\n"), std::string::npos);
    EXPECT_NE(text.find("element edge 2\n"), std::string::npos);
    EXPECT_TRUE(holds(read_back(surface, format, "a.ply"), surface));
  }
  const std::string text = format_surface(surface, SurfaceFormat::ply_ascii);
  EXPECT_NE(text.find(" -1 0\n"), std::string::npos);
  EXPECT_TRUE(text.ends_with("0 11\n5 1\n"));
  surface.properties.clear();
  EXPECT_TRUE(format_surface(surface, SurfaceFormat::obj).ends_with("l 1 12\nl 6 2\n"));
}

TEST(WriteSurface, RefusesWhatCannotBeWritten) {
  const SurfaceOutput good = test::icosahedron();
  const auto refuses = [](const SurfaceOutput& surface, SurfaceFormat format) {
    EXPECT_THROW(format_surface(surface, format), InvalidArgument);
  };
  SurfaceOutput bad = good;
  bad.points(3, 1) = std::numeric_limits<double>::quiet_NaN();
  refuses(bad, SurfaceFormat::ply_binary);
  bad = good;
  bad.triangles(19, 2) = 12;
  refuses(bad, SurfaceFormat::obj);
  bad.triangles(19, 2) = -1;
  refuses(bad, SurfaceFormat::obj);
  bad = good;
  bad.lines = {{0, 12}};
  refuses(bad, SurfaceFormat::obj);
  bad.lines = {{0, 1}};
  refuses(bad, SurfaceFormat::off);
  refuses(bad, SurfaceFormat::stl_binary);
  bad = good;
  bad.points(0, 0) = 1e300;
  refuses(bad, SurfaceFormat::stl_binary);
  bad = good;
  bad.triangles.resize(0, 3);
  refuses(bad, SurfaceFormat::stl_ascii);
  bad = good;
  bad.properties.push_back({"k1", Eigen::VectorXd::Zero(11), false});
  refuses(bad, SurfaceFormat::ply_ascii);
  bad.properties[0].values = Eigen::VectorXd::Constant(12, 256.0);
  bad.properties[0].as_uchar = true;
  refuses(bad, SurfaceFormat::ply_ascii);
  bad.properties[0].as_uchar = false;
  refuses(bad, SurfaceFormat::obj);
  bad.properties[0].name = "two words";
  refuses(bad, SurfaceFormat::ply_ascii);
  bad.properties[0].name = "x";
  refuses(bad, SurfaceFormat::ply_ascii);
  bad.properties[0].values[0] = std::numeric_limits<double>::quiet_NaN();
  bad.properties[0].name = "k1";
  refuses(bad, SurfaceFormat::ply_ascii);
}

TEST(WriteSurface, TheExtensionNamesTheFormat) {
  EXPECT_EQ(surface_format_of("a/b.PLY"), SurfaceFormat::ply_binary);
  EXPECT_EQ(surface_format_of("b.obj"), SurfaceFormat::obj);
  EXPECT_EQ(surface_format_of("b.x.off"), SurfaceFormat::off);
  EXPECT_EQ(surface_format_of("b.stl"), SurfaceFormat::stl_binary);
  EXPECT_EQ(surface_format_of("b.glb"), SurfaceFormat::glb);
  for (const char* name : {"b", "b.txt", "b.ply.gz", "ply", "a.ply/b", ""}) {
    EXPECT_THROW(surface_format_of(name), InvalidArgument) << name;
  }
}

}  // namespace
}  // namespace dupin
