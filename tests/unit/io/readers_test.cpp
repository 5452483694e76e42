#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

SurfaceFile parse(const std::string& text, const std::string& name,
                  const ReadOptions& options = {}) {
  return parse_surface(test::bytes_of(text), name, options);
}

template <class T>
void put(std::string& bytes, T value, bool is_big = false) {
  char data[sizeof(T)];
  std::memcpy(data, &value, sizeof(T));
  if (is_big) std::reverse(data, data + sizeof(T));
  bytes.append(data, sizeof(T));
}

constexpr const char* kTriangleFaces = "element face 1\nproperty list uchar int vertex_indices\n";

// Every scalar type in every encoding, between properties that nobody asked for.
TEST(Ply, ReadsEveryScalarTypeInEveryEncoding) {
  const std::vector<std::string> types = {"char",  "uchar",  "short", "ushort", "int",   "uint",
                                          "float", "double", "int8",  "uint16", "uint8", "float64"};
  for (const std::string& type : types) {
    for (const bool is_big : {false, true}) {
      SCOPED_TRACE(type);
      std::string bytes = "ply\nformat binary_" + std::string(is_big ? "big" : "little") +
                          "_endian 1.0\nelement vertex 3\nproperty short skip\nproperty list uchar "
                          "short more\nproperty " +
                          type + " x\nproperty " + type + " y\nproperty " + type +
                          " z\nelement face 1\nproperty uchar flag\nproperty list uint ushort "
                          "vertex_index\nend_header\n";
      for (int v = 0; v < 3; ++v) {
        put(bytes, std::int16_t{-1}, is_big);
        put(bytes, static_cast<std::uint8_t>(v), is_big);
        for (int i = 0; i < v; ++i) put(bytes, std::int16_t{7}, is_big);
        for (int axis = 0; axis < 3; ++axis) {
          const int value = 10 * v + axis;
          if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") {
            put(bytes, static_cast<std::uint8_t>(value), is_big);
          } else if (type == "short" || type == "ushort" || type == "uint16") {
            put(bytes, static_cast<std::uint16_t>(value), is_big);
          } else if (type == "int" || type == "uint") {
            put(bytes, static_cast<std::uint32_t>(value), is_big);
          } else if (type == "float") {
            put(bytes, static_cast<float>(value), is_big);
          } else {
            put(bytes, static_cast<double>(value), is_big);
          }
        }
      }
      put(bytes, std::uint8_t{1}, is_big);
      put(bytes, std::uint32_t{3}, is_big);
      for (const int index : {2, 0, 1}) put(bytes, static_cast<std::uint16_t>(index), is_big);
      const SurfaceFile file = parse(bytes, "a.ply");
      EXPECT_TRUE(file.warnings.empty());
      for (int v = 0; v < 3; ++v) {
        for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(file.mesh.points(v, axis), 10 * v + axis);
      }
      EXPECT_EQ(file.mesh.face_index, Eigen::Vector3i(2, 0, 1));
    }
  }
}

// Each corner of a triangle is checked, in both encodings, one past the end and below zero.
TEST(Ply, ChecksEveryCorner) {
  for (int corner = 0; corner < 3; ++corner) {
    for (const std::int32_t wrong : {3, -1, 2147483647}) {
      std::int32_t indices[3] = {0, 1, 2};
      indices[corner] = wrong;
      const std::string rest = std::string(
                                   " 1.0\nelement vertex 3\nproperty float x\nproperty "
                                   "float y\nproperty float z\n") +
                               kTriangleFaces + "end_header\n";
      std::string binary = "ply\nformat binary_little_endian" + rest;
      for (int i = 0; i < 9; ++i) put(binary, static_cast<float>(i));
      put(binary, std::uint8_t{3});
      std::string text = "ply\nformat ascii" + rest + "0 0 0\n1 0 0\n0 1 0\n3";
      for (const std::int32_t index : indices) {
        put(binary, index);
        text += " " + std::to_string(index);
      }
      EXPECT_EQ(test::code_of(binary, "a.ply"), "E_INDEX_RANGE") << corner << " " << wrong;
      EXPECT_EQ(test::code_of(text + "\n", "a.ply"), "E_INDEX_RANGE") << corner << " " << wrong;
    }
  }
}

// Plain lines of triangles are read many at a time; one odd line among them, of any kind and in any
// place, must be read or refused exactly as when every line is odd (two blanks between numbers).
TEST(Ply, OneOddLineAmongManyPlainOnesReadsAsAlways) {
  constexpr int kVertices = 1'000;
  constexpr int kLines = 40;
  const std::vector<std::string> odd = {
      "3  1 2 3",  "3\t1 2 3",        " 3 1 2 3",  "3 1 2 3 ",        "4 1 2 3 4",
      "3 1 2 3\r", "3 000000001 2 3", "3 +1 2 3",  "\n3 1 2 3",       "3 1 2 1000",
      "3 1 2 -1",  "3 1 2",           "3 1 2 3 4", "3 1 2 3x",        "3 1 2.5 3",
      "3x1 2 3",   "33 1 2 3",        "2 1 2",     "3 1 2 999999999", "3 1 2 4294967297"};
  const auto outcome = [&](int place, const std::string& line, const char* blank) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(kVertices) +
                       "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                       std::to_string(kLines) +
                       "\nproperty list uchar int vertex_indices\nend_header\n";
    for (int v = 0; v < kVertices; ++v) text += std::to_string(v) + " 0 1\n";
    for (int face = 0; face < kLines; ++face) {
      const int corner = 7 * face * face % (kVertices - 2);
      text += face == place ? line
                            : std::string("3") + blank + std::to_string(corner) + blank +
                                  std::to_string(corner + 1) + blank + std::to_string(corner + 2);
      text += "\n";
    }
    std::string said;
    try {
      const SurfaceFile file = parse(text, "a.ply");
      for (const std::int32_t vertex : file.mesh.face_index) said += std::to_string(vertex) + " ";
      for (const std::int32_t start : file.mesh.face_offset) said += std::to_string(start) + ",";
    } catch (const IoError& error) {
      said = error.code() + std::string(" line ") + std::to_string(error.location().line);
    }
    return said;
  };
  for (const std::string& line : odd) {
    for (const int place : {0, 1, 20, kLines - 1}) {
      SCOPED_TRACE(line + " as face " + std::to_string(place));
      EXPECT_EQ(outcome(place, line, " "), outcome(place, line, "  "));
    }
  }
}

TEST(Ply, KeepsNormalsAndZeroesThoseThatAreNotFinite) {
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float nx\nproperty float ny\nproperty "
      "float nz\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
      "0 0 1 4 5 6\nnan 0 1 7 8 9\n";
  const SurfaceFile file = parse(text, "a.ply");
  EXPECT_EQ(file.mesh.points.row(1), Eigen::RowVector3d(7, 8, 9));
  EXPECT_EQ(file.mesh.normals.row(0), Eigen::RowVector3d(0, 0, 1));
  EXPECT_EQ(file.mesh.normals.row(1), Eigen::RowVector3d(0, 0, 0));
  EXPECT_TRUE(file.warnings.contains("W_ATTR_NONFINITE"));
}

TEST(Ply, SaysWhereAFileIsCut) {
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty "
      "float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n4 5 6\n";
  try {
    parse(text, "a.ply");
    FAIL() << "was read";
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), "E_TRUNCATED");
    EXPECT_NE(std::string(error.what()).find("vertex 2 of 3"), std::string::npos) << error.what();
  }
}

// Polygons of mixed sizes after triangles: the offsets are filled in from the first face on.
TEST(Readers, PolygonsGetOffsets) {
  const std::string off =
      "OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 0\n3 0 1 2 255 0 0\n4 0 1 2 "
      "3\n3 1 4 2\n";
  const SurfaceFile file = parse(off, "a.off");
  ASSERT_EQ(file.mesh.face_offset.size(), 4);
  EXPECT_EQ(file.mesh.face_offset, Eigen::Vector4i(0, 3, 7, 10));
  EXPECT_EQ(file.mesh.face_index[6], 3);
  EXPECT_EQ(file.mesh.num_faces(), 3);
}

TEST(Off, ReadsTheVariantsOfTheHeader) {
  const std::string body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  for (const char* head : {"OFF\n3 1 0\n", "OFF 3 1 0\n", "OFF3 1 0\n", "OFF\n3 1\n",
                           "# note\nOFF # x\n\n3 1 0 # y\n", "\xEF\xBB\xBFOFF\r\n3 1 0\r\n"}) {
    EXPECT_EQ(parse(head + body, "a.off").mesh.num_faces(), 1) << head;
  }
  EXPECT_EQ(parse("COFF\n1 0 0\n1 2 3 255 0 0 255\n", "a.off").mesh.points(0, 2), 3.0);
  const PolygonMesh normals = parse("NOFF\n1 0 0\n1 2 3 0 0 1\n", "a.off").mesh;
  EXPECT_EQ(normals.normals.row(0), Eigen::RowVector3d(0, 0, 1));
  EXPECT_EQ(test::code_of("4OFF\n1 0 0\n1 2 3 1\n", "a.off"), "E_HEADER");
  EXPECT_EQ(test::code_of("OFF BINARY\n1 0 0\n", "a.off"), "E_HEADER");
  EXPECT_EQ(test::code_of("hello\n", "a.off"), "E_MAGIC");
}

TEST(Obj, IndicesMayLookForwardButNotPastTheEnd) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_EQ(parse("f 1 2 3\n" + vertices, "a.obj").mesh.num_faces(), 1);
  EXPECT_EQ(test::code_of("f 1 2 4\n" + vertices, "a.obj"), "E_INDEX_RANGE");
  EXPECT_EQ(test::code_of(vertices + "f 1 2 -4\n", "a.obj"), "E_INDEX_RANGE");
  EXPECT_EQ(test::code_of(vertices + "f 1 2 0\n", "a.obj"), "E_INDEX_RANGE");
  EXPECT_EQ(test::code_of(vertices + "f 1 2 99999999999999999999\n", "a.obj"), "E_INDEX_RANGE");
  EXPECT_EQ(test::code_of(vertices + "f 1 2 -9223372036854775808\n", "a.obj"), "E_INDEX_RANGE");
  EXPECT_EQ(test::code_of(vertices + "f 1 2\n", "a.obj"), "E_SYNTAX");
  EXPECT_EQ(test::code_of(vertices + "hello 1\n", "a.obj"), "E_SYNTAX");
}

TEST(Obj, TakesEveryFormOfACorner) {
  const std::string text =
      "# comment\nmtllib ../../etc/passwd\no name\ng a b\ns off\nusemtl m\nv 0 0 0 1.0\nv 1 0 0 "
      "0.5 0.5 0.5\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1 2 3\nf 1/1 2/1 3/-1\nf 1//1 2//1 3//-1\nf "
      "1/1/1 2/1/1 3/1/1\nl 1 2\n";
  const SurfaceFile file = parse(text, "a.obj");
  EXPECT_EQ(file.mesh.num_faces(), 4);
  EXPECT_TRUE(file.warnings.empty());
  const SurfaceFile bad = parse(text + "f 1/2/1 2/1/0 3/1/1\n", "a.obj");
  EXPECT_EQ(bad.warnings.all().at(0).count, 2);
}

TEST(Stl, KeywordsIgnoreCaseAndLinesDoNotMatter) {
  const std::string facet =
      "FACET NORMAL nan -nan(ind) 1.#QNAN OUTER LOOP VERTEX 0 0 0 VERTEX 1 0 0\nVERTEX 0 1 0\n"
      "ENDLOOP ENDFACET ";
  const SurfaceFile file = parse(
      "SOLID two words\n" + facet + facet + "\nENDSOLID two words\nsolid\n" + facet + "endsolid\n",
      "a.stl");
  EXPECT_EQ(file.mesh.num_faces(), 3);
  EXPECT_EQ(file.mesh.points.rows(), 3);
  EXPECT_FALSE(file.is_binary);
}

// Content first, extension second.
TEST(Readers, TheContentDecidesTheFormat) {
  const SurfaceOutput surface = test::icosahedron();
  const std::pair<SurfaceFormat, std::string> kinds[] = {
      {SurfaceFormat::ply_binary, "ply"}, {SurfaceFormat::ply_ascii, "ply"},
      {SurfaceFormat::obj, "obj"},        {SurfaceFormat::off, "off"},
      {SurfaceFormat::stl_binary, "stl"}, {SurfaceFormat::stl_ascii, "stl"}};
  for (const auto& [format, name] : kinds) {
    for (const char* wrong : {"a.ply", "a.obj", "a.off", "a.stl", "a", "-"}) {
      EXPECT_EQ(parse(format_surface(surface, format), wrong).format, name) << wrong;
    }
  }
  EXPECT_EQ(test::code_of("hello world\n", "a.txt"), "E_MAGIC");
  EXPECT_EQ(test::code_of("\x1f\x8b\x08", "a.ply"), "E_MAGIC");
  EXPECT_EQ(test::code_of("", "a.ply"), "E_EMPTY");
}

TEST(Readers, NonfinitePointsAreKeptOnlyWhenAskedFor) {
  ReadOptions drop;
  drop.drop_nonfinite = true;
  const std::string obj = "v 0 0 nan\nv 1 0 0\nv -inf 1 0\nf 1 2 3\n";
  EXPECT_EQ(test::code_of(obj, "a.obj"), "E_NONFINITE");
  const SurfaceFile file = parse(obj, "a.obj", drop);
  EXPECT_TRUE(std::isnan(file.mesh.points(0, 2)));
  EXPECT_TRUE(std::isinf(file.mesh.points(2, 0)));
  // A signalling NaN: converting it would trap.
  std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float "
      "x\nproperty float y\nproperty float z\nend_header\n";
  for (const std::uint32_t bits : {0U, 0U, 0U, 0U, 0x7F800001U, 0U}) put(ply, bits);
  EXPECT_EQ(test::code_of(ply, "a.ply"), "E_NONFINITE");
  EXPECT_TRUE(std::isnan(parse(ply, "a.ply", drop).mesh.points(1, 1)));
}

TEST(Readers, LimitsAreKept) {
  const SurfaceOutput surface = test::icosahedron();
  ReadOptions vertices;
  vertices.limits.max_vertices = 11;
  ReadOptions faces;
  faces.limits.max_faces = 19;
  for (const SurfaceFormat format :
       {SurfaceFormat::ply_binary, SurfaceFormat::ply_ascii, SurfaceFormat::obj, SurfaceFormat::off,
        SurfaceFormat::stl_binary, SurfaceFormat::stl_ascii}) {
    const std::string text = format_surface(surface, format);
    EXPECT_EQ(test::code_of(text, "a", vertices), "E_TOO_LARGE");
    EXPECT_EQ(test::code_of(text, "a", faces), "E_TOO_LARGE");
  }
  ReadOptions polygons;
  polygons.limits.max_polygon = 3;
  EXPECT_EQ(test::code_of("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n", "a", polygons),
            "E_TOO_LARGE");
  EXPECT_EQ(test::code_of("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", "a", polygons),
            "E_TOO_LARGE");
}

TEST(Readers, ACancelledRunStops) {
  const RunControl run = RunControl::create();
  run.cancel();
  for (const SurfaceFormat format : {SurfaceFormat::ply_binary, SurfaceFormat::ply_ascii,
                                     SurfaceFormat::obj, SurfaceFormat::off}) {
    const std::string text = format_surface(test::icosahedron(), format);
    try {
      parse_surface(test::bytes_of(text), "a", {}, run);
      ADD_FAILURE() << "was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.errc(), Errc::interrupted);
    }
  }
}

// Contract G2 with the numbers of 4h: the whole child lives in 256 MB more than it started with,
// whatever a file of a few bytes claims, up to just below the limits.
TEST(Readers, MemoryFollowsTheFileAndNotItsClaims) {
  std::vector<std::pair<std::string, std::string>> claims;
  for (const char* count : {"19999999", "39999999", "4000000000"}) {
    for (const char* encoding : {"ascii", "binary_little_endian"}) {
      claims.emplace_back("a.ply", "ply\nformat " + std::string(encoding) +
                                       " 1.0\nelement vertex " + count +
                                       "\nproperty double x\nproperty double y\nproperty double "
                                       "z\n" +
                                       kTriangleFaces + "end_header\n0 0 0\n");
      claims.emplace_back("a.ply", "ply\nformat " + std::string(encoding) +
                                       " 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar "
                                       "y\nproperty uchar z\nelement face " +
                                       count +
                                       "\nproperty list uchar int vertex_indices\nend_header\n0 0 "
                                       "0\n");
    }
    claims.emplace_back("a.off", std::string("OFF\n") + count + " " + count + " 0\n0 0 0\n");
  }
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    struct rlimit limit {};
    std::ifstream statm("/proc/self/statm");
    rlim_t pages = 0;
    statm >> pages;
    limit.rlim_cur = limit.rlim_max =
        pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + (rlim_t{256} << 20U);
#ifndef __SANITIZE_ADDRESS__
    ::setrlimit(RLIMIT_AS, &limit);
#endif
    int status = 0;
    for (const auto& [name, text] : claims) {
      try {
        parse(text, name);
        status = 1;
      } catch (const Error&) {
      } catch (const std::exception&) {
        status = 2;  // std::bad_alloc: memory was taken by a claim
      }
    }
    ::_exit(status);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace dupin
