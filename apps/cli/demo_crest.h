#pragma once

#include "demo_parts.h"

namespace dupin::cli {

/// Ridges and valleys of `subject`, clean and noisy. Returns its figures.
nlohmann::ordered_json add_crest_lines(HtmlReport& report, const std::filesystem::path& directory,
                                       const DemoSubject& subject, const DemoAnalysis& clean,
                                       Context& context);

}  // namespace dupin::cli
