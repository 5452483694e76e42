#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "context.h"
#include "dupin/warp/apply_template.h"

namespace dupin::cli {

/// What all pictures of one `dupin warp apply` share.
struct ApplyJob {
  const Context& context;
  PoseTemplate pose;
  ApplyOptions options;
  std::string directory;        ///< of the outputs
  double min_confidence = 0.5;  ///< below this a picture is doubtful
  bool has_page = false;        ///< each picture gets a strip for the page
  std::string template_digest;  ///< of all that decides the outputs but the picture
};

/// Names of the outputs for a picture, without folders.
struct ApplyOutputs {
  std::string project;
  std::string picture;
  std::string strip;
};
ApplyOutputs outputs_of(const std::string& image);

/// The template on one picture: writes the project, the warped picture and, for a page, the strip.
/// Never throws for what is wrong with the picture or an output: then the row says "failed" and
/// has the error. A row is the same for every number of threads.
/// @param before the row of an earlier run, or null: it is returned where nothing has changed
/// @throws Error(Errc::interrupted)
nlohmann::ordered_json apply_row(const ApplyJob& job, const std::string& image,
                                 const nlohmann::ordered_json& before, const RunControl& run);

/// Whether a row of an earlier report is as it was written.
bool is_intact(const nlohmann::ordered_json& row);

/// The page of all rows. @param command what makes it again
std::string apply_page(const ApplyJob& job, const nlohmann::ordered_json& rows,
                       const std::string& command);

}  // namespace dupin::cli
