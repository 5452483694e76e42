#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>

#include "dupin/base/error.h"
#include "dupin/io/formats.h"

namespace dupin::fuzz {

// Not assert(): it must hold in every build.
inline void require(bool holds) {
  if (!holds) std::abort();
}

using Parse = SurfaceFile (*)(detail::ByteSpan, const std::string&, const ReadOptions&,
                              const RunControl&);

inline std::optional<SurfaceFile> try_parse(Parse parse, detail::ByteSpan bytes,
                                            std::string* code = nullptr) {
  try {
    return parse(bytes, "input", {}, {});
  } catch (const Error& error) {
    require(error.code().starts_with("E_"));
    if (code != nullptr) *code = error.diagnostic();
    return std::nullopt;
  }
}

template <class A>
bool is_same(const A& a, const A& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         (a.size() == 0 ||
          std::memcmp(a.data(), b.data(),
                      static_cast<std::size_t>(a.size()) * sizeof(typename A::Scalar)) == 0);
}

inline bool is_same(const PolygonMesh& a, const PolygonMesh& b) {
  return is_same(a.points, b.points) && is_same(a.normals, b.normals) &&
         is_same(a.face_index, b.face_index) && is_same(a.face_offset, b.face_offset);
}

/// Aborts unless all indices are in range, all points finite and the offsets in order.
inline void require_sound(const PolygonMesh& mesh) {
  for (Eigen::Index i = 0; i < mesh.points.size(); ++i) {
    require(std::isfinite(mesh.points.data()[i]));
  }
  for (Eigen::Index i = 0; i < mesh.face_index.size(); ++i) {
    require(mesh.face_index[i] >= 0 && mesh.face_index[i] < mesh.points.rows());
  }
  require(mesh.normals.rows() == 0 || mesh.normals.rows() == mesh.points.rows());
  if (mesh.face_offset.size() == 0) {
    require(mesh.face_index.size() % 3 == 0);
    return;
  }
  require(mesh.face_offset[0] == 0);
  for (Eigen::Index i = 1; i < mesh.face_offset.size(); ++i) {
    require(mesh.face_offset[i] >= mesh.face_offset[i - 1]);
  }
  require(mesh.face_offset[mesh.face_offset.size() - 1] == mesh.face_index.size());
}

/// Sound or refused with a code, and the same a second time.
inline int check_reader(Parse parse, const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string first_code;
  std::string second_code;
  const auto first = try_parse(parse, {data, size}, &first_code);
  const auto second = try_parse(parse, {data, size}, &second_code);
  require(first.has_value() == second.has_value() && first_code == second_code);
  if (!first) return 0;
  require_sound(first->mesh);
  require(is_same(first->mesh, second->mesh));
  require(first->warnings.all().size() == second->warnings.all().size());
  return 0;
}

}  // namespace dupin::fuzz
