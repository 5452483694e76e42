#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "context.h"
#include "dupin/base/warning.h"
#include "dupin/io/file.h"

namespace dupin::cli {

/// What `dupin check` says of a picture: its format, and the shape that its alpha channel shows.
struct ImageJudgement {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  int bit_depth = 8;
  bool has_profile = false;
  std::int64_t num_parts = 0;
  std::int64_t num_holes = 0;
  double area = 0.0;  ///< enclosed by the outline [px^2]
  WarningList warnings;
};

/// Reads the bytes of a PNG and follows the outline of all its parts. Says nothing yet.
/// @throws as parse_png() and shape_from_image(); Error(Errc::interrupted) when cancelled
ImageJudgement judge_image(const Context& context, const FileBytes& file, const std::string& name);

nlohmann::ordered_json to_json(const ImageJudgement& judgement, const std::string& file);
void tell(const Context& context, const ImageJudgement& judgement, const std::string& file);

}  // namespace dupin::cli
