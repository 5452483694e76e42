#pragma once

#include "context.h"

namespace dupin::cli {

/// `dupin crest`, as the functions at the end of context.h.
void add_crest(CLI::App& app, Context& context);

}  // namespace dupin::cli
