#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <new>

#include "context.h"
#include "crest_verb.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/version.h"
#include "register_verb.h"
#include "surface_input.h"
#include "warp_verb.h"

namespace {

using dupin::Errc;
using dupin::Error;
using dupin::cli::Context;
using dupin::cli::report_error;

// A signal only sets a flag; algorithms look at it. The second one ends the program at once.
Context* volatile active_context = nullptr;
volatile std::sig_atomic_t signals_seen = 0;

void on_signal(int signal) {
  signals_seen = signals_seen + 1;
  if (signals_seen > 1 || active_context == nullptr) std::_Exit(128 + signal);
  active_context->last_signal = signal;
  active_context->run.cancel();
}

constexpr const char* kUsageHint = "dupin --help, or dupin VERB --help";

int usage_error(const Context& context, const std::string& message) {
  const std::string line = dupin::escaped(message.substr(0, message.find('\n')), 400);
  return report_error(context, Error(Errc::usage, "E_OPTION", line, {}, kUsageHint));
}

// What CLI11 prints goes through std::cout.
int printed(const Context& context, int exit_code) {
  if (std::cout.flush()) return exit_code;
  return report_error(context,
                      Error(Errc::cannot_write, "E_WRITE", "standard output cannot be written"));
}

// The handlers know the context only while it lives.
struct ActiveContext {
  explicit ActiveContext(Context& context) { active_context = &context; }
  ActiveContext(const ActiveContext&) = delete;
  ActiveContext& operator=(const ActiveContext&) = delete;
  ~ActiveContext() { active_context = nullptr; }
};

void add_verbs(CLI::App& app, Context& context) {
  dupin::cli::add_check(app, context);
  dupin::cli::add_curvature(app, context);
  dupin::cli::add_scalespace(app, context);
  dupin::cli::add_keypoints(app, context);
  dupin::cli::add_crest(app, context);
  dupin::cli::add_register(app, context);
  dupin::cli::add_register_all(app, context);
  dupin::cli::add_render(app, context);
  dupin::cli::add_mls(app, context);
  dupin::cli::add_warp(app, context);
  dupin::cli::add_synth(app, context);
  dupin::cli::add_demo(app, context);
  dupin::cli::add_completion(app, context);
  dupin::cli::add_version(app, context);
}

int run(int argc, char** argv) {
  Context context;
  const ActiveContext active(context);
  CLI::App app{"Dupin finds the features of 3D surfaces at every scale.", "dupin"};
  app.set_version_flag("--version", std::string("dupin ") + dupin::kVersion);
  app.require_subcommand(1);
  app.option_defaults()->always_capture_default(false);
  add_verbs(app, context);
  try {
    // So that even a usage error comes as JSON when JSON was asked for.
    context.json = std::any_of(argv + 1, argv + argc,
                               [](const char* word) { return std::string(word) == "--json"; });
    app.parse(argc, argv);
    return context.exit_code;
  } catch (const CLI::CallForHelp& help) {
    return printed(context, app.exit(help));
  } catch (const CLI::CallForAllHelp& help) {
    return printed(context, app.exit(help));
  } catch (const CLI::CallForVersion& version) {
    return printed(context, app.exit(version));
  } catch (const CLI::ParseError& error) {
    return usage_error(context, error.what());
  } catch (const Error& error) {
    const bool needs_hint = error.hint().empty() && error.errc() == Errc::usage;
    if (needs_hint)
      return report_error(context,
                          {error.errc(), error.code(), error.what(), error.location(), kUsageHint});
    return report_error(context, dupin::cli::in_file(error, context.input));
  } catch (const std::bad_alloc&) {
    return report_error(context, Error(Errc::over_limit, "E_MEMORY", "not enough memory", {},
                                       "a smaller input, or fewer levels"));
  } catch (const std::exception& error) {
    return report_error(context, Error(Errc::internal, "E_INTERNAL", dupin::escaped(error.what()),
                                       {}, "this is a bug; please report it with the input"));
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGPIPE, SIG_IGN);
#ifdef SIGXFSZ
  std::signal(SIGXFSZ, SIG_IGN);
#endif
  return run(argc, argv);
}
