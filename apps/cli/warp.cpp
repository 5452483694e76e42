#include "warp_verb.h"

namespace dupin::cli {

void add_warp(CLI::App& app, Context& context) {
  CLI::App* warp = app.add_subcommand("warp", "Bend cut-outs by control points");
  warp->require_subcommand(1);
  add_warp_new(*warp, context);
  add_warp_contour(*warp, context);
  add_warp_mesh(*warp, context);
  add_warp_render(*warp, context);
  add_warp_fit(*warp, context);
  add_warp_apply(*warp, context);
}

}  // namespace dupin::cli
