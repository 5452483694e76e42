#pragma once

#include "context.h"

namespace dupin::cli {

/// `dupin register` and `dupin register-all`, as the functions at the end of context.h.
void add_register(CLI::App& app, Context& context);
void add_register_all(CLI::App& app, Context& context);

}  // namespace dupin::cli
