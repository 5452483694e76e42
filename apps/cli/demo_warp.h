#pragma once

#include "demo_parts.h"

namespace dupin::cli {

/// Three drawn garments, each before, with its mesh and pins, and after, beside what straight
/// distances make of the same pins. Returns their figures.
nlohmann::ordered_json add_warps(HtmlReport& report, const std::filesystem::path& directory,
                                 Context& context);

}  // namespace dupin::cli
