#pragma once

#include <string>

#include "dupin/mesh/heal.h"

namespace dupin::test {

/// The first promise of HealedSurface that `healed` breaks for `input`, in words; "" when it keeps
/// all of them: finite, in range, positive areas, one disc or half-disc around each vertex, one
/// orientation, exact local coordinates, sound maps to the input, Euler's formula.
std::string broken_invariant(const PolygonMesh& input, const HealedSurface& healed);

/// The same for healing a second time: nothing changes and no warning is new or counts more.
std::string broken_idempotence(const HealedSurface& healed);

}  // namespace dupin::test
