#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/io/surface_io.h"

namespace dupin::test {

inline std::span<const std::uint8_t> as_bytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

inline SurfaceFile parse(const std::string& text, const std::string& name,
                         const ReadOptions& options = {}) {
  return parse_surface(as_bytes(text), name, options);
}

/// The code of the error that parsing `text` gives; "" if there is none.
inline std::string code_of(const std::string& text, const std::string& name,
                           const ReadOptions& options = {}) {
  try {
    parse(text, name, options);
  } catch (const Error& error) {
    return error.code();
  }
  return {};
}

/// The line that the error of parsing `text` names; 0 if there is none.
inline std::int64_t error_line(const std::string& text, const std::string& name) {
  try {
    parse(text, name);
  } catch (const Error& error) {
    return error.location().line;
  }
  return 0;
}

inline void append_bits(std::string& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>((value >> (8 * i)) & 0xFF));
}
inline void append_double(std::string& bytes, double value) {
  append_bits(bytes, std::bit_cast<std::uint64_t>(value), 8);
}
inline void append_float(std::string& bytes, float value) {
  append_bits(bytes, std::bit_cast<std::uint32_t>(value), 4);
}

inline bool equal_meshes(const PolygonMesh& a, const PolygonMesh& b) {
  return a.points.rows() == b.points.rows() && a.points == b.points &&
         a.normals.rows() == b.normals.rows() && a.normals == b.normals &&
         a.face_index.size() == b.face_index.size() && a.face_index == b.face_index &&
         a.face_offset.size() == b.face_offset.size() && a.face_offset == b.face_offset;
}

/// What readers guarantee of every mesh they give.
inline void expect_sound(const PolygonMesh& mesh) {
  for (Eigen::Index i = 0; i < mesh.points.size(); ++i) {
    ASSERT_TRUE(std::isfinite(mesh.points.data()[i]));
  }
  for (Eigen::Index i = 0; i < mesh.face_index.size(); ++i) {
    ASSERT_GE(mesh.face_index[i], 0);
    ASSERT_LT(mesh.face_index[i], mesh.points.rows());
  }
  ASSERT_TRUE(mesh.normals.rows() == 0 || mesh.normals.rows() == mesh.points.rows());
}

/// Every prefix of `whole` gives the same mesh, a warning that its end may be cut, or a coded
/// error.
inline void expect_prefixes_are_answered(const std::string& whole, const std::string& name) {
  const SurfaceFile expected = parse(whole, name);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    SCOPED_TRACE(size);
    try {
      const SurfaceFile actual = parse(whole.substr(0, size), name);
      ASSERT_TRUE(equal_meshes(actual.mesh, expected.mesh) ||
                  actual.warnings.contains("W_TRUNCATED_END"));
    } catch (const IoError& error) {
      ASSERT_TRUE(error.errc() == Errc::malformed || error.errc() == Errc::over_limit)
          << error.diagnostic();
    }
  }
}

/// Files with a few damaged bits give a sound mesh or a coded error; some of each.
inline void expect_flips_are_answered(const std::string& whole, const std::string& name,
                                      int num_flips) {
  Rng rng(7);
  int num_read = 0;
  for (int i = 0; i < num_flips; ++i) {
    SCOPED_TRACE(i);
    std::string damaged = whole;
    for (std::uint64_t k = rng.below(3) + 1; k > 0; --k) {
      char& byte = damaged[rng.below(damaged.size())];
      byte = static_cast<char>(byte ^ static_cast<char>(1 << rng.below(8)));
    }
    try {
      expect_sound(parse(damaged, name).mesh);
      ++num_read;
    } catch (const Error& error) {
      ASSERT_TRUE(error.code().starts_with("E_")) << error.diagnostic();
      ASSERT_NE(error.errc(), Errc::internal) << error.diagnostic();
    }
  }
  EXPECT_GT(num_read, 0);
  EXPECT_LT(num_read, num_flips);
}

}  // namespace dupin::test
