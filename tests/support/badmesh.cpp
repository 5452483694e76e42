#include "tests/support/badmesh.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/data.h"

namespace dupin::test {

std::vector<BadMesh> generate_badmesh(const std::string& directory) {
  const std::string generator = shared_data("../badmesh/gen.py");
  if (generator.empty()) return {};
  const auto folder = std::filesystem::path(directory) / "badmesh";
  const std::string command =
      "python3 '" + generator + "' '" + folder.string() + "' --no-special > /dev/null";
  if (std::system(command.c_str()) != 0) return {};
  std::ifstream stream(folder / "manifest.json");
  const auto manifest = nlohmann::json::parse(stream);
  std::vector<BadMesh> result;
  for (const auto& entry : manifest.at("files")) {
    BadMesh mesh;
    mesh.file = (folder / entry.at("file").get<std::string>()).string();
    mesh.format = entry.at("format").get<std::string>();
    mesh.exit_code = entry.at("exit").get<int>();
    mesh.codes = entry.at("codes").get<std::vector<std::string>>();
    mesh.line = entry.value("line", 0L);
    if (entry.contains("expect")) {
      mesh.num_vertices = entry["expect"].value("v", -1L);
      mesh.num_faces = entry["expect"].value("f", -1L);
    }
    result.push_back(std::move(mesh));
  }
  return result;
}

}  // namespace dupin::test
