#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// A surface as a file gives it: faces of any size, nothing repaired, any numbering.
/// Readers guarantee that every index is in [0, #V).
struct PolygonMesh {
  using Indices = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 1>;

  Points points;        ///< #V by 3 [mu]
  Points normals;       ///< #V by 3 as given, or 0 by 3
  Indices face_index;   ///< vertices of all faces, one face after the other
  Indices face_offset;  ///< #F + 1 starts in face_index; empty: every face is a triangle

  Eigen::Index num_faces() const {
    return face_offset.size() > 0 ? face_offset.size() - 1 : face_index.size() / 3;
  }

  /// The vertices of face `f` in order.
  std::span<const std::int32_t> face(Eigen::Index f) const {
    if (face_offset.size() == 0) return {face_index.data() + 3 * f, 3};
    return {face_index.data() + face_offset(f),
            static_cast<std::size_t>(face_offset(f + 1) - face_offset(f))};
  }
};

}  // namespace dupin
