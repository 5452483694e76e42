#pragma once

#include "context.h"

namespace dupin::cli {

/// `dupin warp`, as the functions at the end of context.h.
void add_warp(CLI::App& app, Context& context);

/// Its verbs, one a file, added to `warp`.
void add_warp_new(CLI::App& warp, Context& context);
void add_warp_contour(CLI::App& warp, Context& context);
void add_warp_mesh(CLI::App& warp, Context& context);
void add_warp_render(CLI::App& warp, Context& context);
void add_warp_fit(CLI::App& warp, Context& context);
void add_warp_apply(CLI::App& warp, Context& context);

}  // namespace dupin::cli
