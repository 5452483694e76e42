#pragma once

#include <optional>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/registration/register_all.h"
#include "surface_input.h"

namespace dupin::cli {

/// What `dupin register-all` found.
struct Assembly {
  std::vector<std::string> names;
  std::vector<LoadedSurface> scans;
  std::vector<Points> normals;  ///< of each scan, for clouds
  RegisterAllResult result;
  std::vector<std::optional<Pose>> poses;  ///< between the inputs
  double unit = 1.0;                       ///< of the frame, input length of a local one
  double seconds = 0.0;
};

/// The page of `dupin register-all --report`: the same bytes for the same inputs and options.
std::string assembly_page(const Assembly& assembly, const std::string& command,
                          const RunControl& run);

}  // namespace dupin::cli
