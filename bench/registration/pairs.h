#pragma once

// The cases of bench/registration_quality.cpp: which surfaces, which pairs, and their files.

#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/scan_pair.h"

namespace dupin::bench {

struct NamedSurface {
  std::string name;
  Mesh mesh;
};

struct NamedPair {
  std::string name;     ///< unique, a legal file name
  std::string surface;  ///< of both parts, or "A-B" of different objects
  int overlap_percent = 0;
  int noise_percent = 0;
  test::ScanPair pair;
};

/// armadillo, bunny00, refined_elephant (.off, as Debian's libcgal-demo packs them) of `directory`
/// and a bumpy sphere of 16,000 vertices.
std::vector<NamedSurface> registration_surfaces(const std::string& directory);

/// Surfaces by overlap 30, 50, 70 % by noise 0, 20, 50 %: 36 pairs for four surfaces. `draw` makes
/// other cuts, poses and noise. With scale_range > 1 the moving part has a unit of its own.
std::vector<NamedPair> overlap_pairs(const std::vector<NamedSurface>& surfaces, double scale_range,
                                     std::uint64_t draw);

/// Parts of 70 % of two different objects each, of one diameter: the surfaces, bumpy spheres and
/// ellipsoids with other bumps, a torus. There is nothing to register.
std::vector<NamedPair> different_pairs(const std::vector<NamedSurface>& surfaces, std::size_t count,
                                       std::uint64_t draw);

/// Pairs of 70 % overlap without noise whose moving part is a mirror image.
std::vector<NamedPair> mirrored_pairs(const std::vector<NamedSurface>& surfaces,
                                      std::uint64_t draw);

/// NAME_moving.ply (a mesh), NAME_fixed.ply (bare points), NAME_fixed_mesh.ply, and pairs.json with
/// the truth of all: "T_fixed_moving" maps moving to fixed, 4 by 4, row by row.
void write_pairs(const std::string& directory, const std::vector<NamedPair>& pairs);

}  // namespace dupin::bench
