#pragma once

#include "demo_parts.h"

namespace dupin::cli {

/// Two partial scans of a rugged body brought together blind, and a mirror image that is refused.
/// Returns its figures.
nlohmann::ordered_json add_registration(HtmlReport& report, const std::filesystem::path& directory,
                                        Context& context);

}  // namespace dupin::cli
