#pragma once

#include <string>
#include <vector>

namespace dupin::test {

/// One entry of the corpus of bad inputs: what a trustworthy reader answers.
struct BadMesh {
  std::string file;    ///< path on this machine
  std::string format;  ///< "ply", "obj", ...
  int exit_code = 0;
  std::vector<std::string> codes;
  long line = 0;  ///< 0: not stated
  long num_vertices = -1;
  long num_faces = -1;
};

/// Generates the corpus into a fresh folder below `directory`; empty when the generator is not on
/// this machine.
std::vector<BadMesh> generate_badmesh(const std::string& directory);

}  // namespace dupin::test
