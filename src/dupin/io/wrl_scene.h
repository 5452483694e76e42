#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/base/warning.h"
#include "dupin/io/affine_map.h"
#include "dupin/io/read_options.h"
#include "dupin/io/wrl_lexer.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin::detail {

enum class WrlKind : std::uint8_t {
  other,       ///< parsed over, never drawn
  group,       ///< draws its children and keeps the state to itself
  open_group,  ///< VRML 1 Group: its children change the state of what follows
  transform_separator,
  switch_node,
  lod,
  transform,  ///< VRML 2: group with a transform; VRML 1: changes the state
  coordinate,
  normal,
  shape_hints,
  face_set,
  unsupported  ///< draws something that is not read: Sphere, IndexedLineSet, Inline ...
};

/// A node that matters for the surface.
struct WrlNode {
  WrlKind kind = WrlKind::other;
  std::vector<std::int32_t> children;
  std::int32_t payload = -1;  ///< index into the scene's lists, by kind
  std::int32_t choice = -1;   ///< of a Switch; -1: none, -3: all
  bool is_clockwise = false;  ///< ShapeHints, or ccw FALSE of a face set
};

/// Faces of one IndexedFaceSet, as coordIndex gives them.
struct WrlFaces {
  std::vector<std::int32_t> index;  ///< faces one after the other, each ended by -1
  std::size_t byte = 0;             ///< where the list starts in the file
  std::int64_t num_faces = 0;       ///< faces of at least one vertex
  std::int64_t num_corners = 0;
  std::int64_t num_empty = 0;         ///< faces without a vertex
  bool has_own_normal_order = false;  ///< normals are per face or have an index of their own
};

/// Three numbers a point or vector, and where the list starts in the file.
struct WrlVectors {
  std::vector<double> xyz;
  std::size_t byte = 0;
};

/// A file as a graph without cycles: children of a node come before it, or are inside it.
struct WrlScene {
  bool is_version_1 = false;
  std::vector<WrlNode> nodes;  ///< node 0 is the root
  std::vector<WrlVectors> vectors;
  std::vector<WrlFaces> faces;
  std::vector<AffineMap> transforms;
  WarningList warnings;
};

/// Parses `lexer` from the line after the header.
/// @throws IoError E_SYNTAX, E_TRUNCATED, E_NESTING, E_CYCLE, E_NUMBER_RANGE, E_INDEX_RANGE,
///   E_TOO_LARGE
WrlScene parse_wrl_scene(WrlLexer& lexer, bool is_version_1, const ReadLimits& limits);

/// All face sets of `scene` as one surface in the coordinates of the root, in drawing order.
/// @throws IoError E_INDEX_RANGE, E_NONFINITE, E_NESTING, E_EXPANSION (a scene that draws the same
///   shapes again and again), E_TOO_LARGE, E_NUMBER_RANGE
PolygonMesh flatten_wrl_scene(const WrlScene& scene, WrlLexer& lexer, const ReadOptions& options,
                              WarningList& warnings);

}  // namespace dupin::detail
