#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dupin/mesh/polygon_mesh.h"

namespace dupin {

/// Marks every triangle whose three places, in any order, are those of an earlier one. `place`
/// names the place of each vertex (see find_coincident()). Cost: O(V + F log valence).
std::vector<std::uint8_t> find_repeated_triangles(
    const std::vector<std::array<std::int32_t, 3>>& triangles,
    const std::vector<std::int32_t>& place);

/// Marks every face of more than three corners that goes round the places of an earlier one, from
/// any corner on, in either direction. Once cut along different diagonals they could not be told as
/// equal. Cost: O(corners + F log F).
std::vector<std::uint8_t> find_repeated_polygons(const PolygonMesh& mesh,
                                                 const std::vector<std::int32_t>& place);

}  // namespace dupin
