#pragma once

#include <CLI/CLI.hpp>

#include "context.h"

namespace dupin::cli {

/// Adds `views` to the verb `synth`.
void add_synth_views(CLI::App& synth, Context& context);

}  // namespace dupin::cli
