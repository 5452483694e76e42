#pragma once

#include "context.h"

namespace dupin::cli {

/// Adds `dupin mls scale`.
void add_mls_scale(CLI::App& verb, Context& context);

}  // namespace dupin::cli
