#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <new>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/base/version.h"

namespace {

using dupin::Errc;
using dupin::Error;
using dupin::cli::Context;

// A signal only sets a flag; algorithms look at it. The second one ends the program at once.
Context* active_context = nullptr;
volatile std::sig_atomic_t signals_seen = 0;

void on_signal(int signal) {
  signals_seen = signals_seen + 1;
  if (signals_seen > 1 || active_context == nullptr) std::_Exit(128 + signal);
  active_context->run.cancel();
}

int report_error(const Context& context, Errc errc, const std::string& code,
                 const std::string& diagnostic, const std::string& message, const std::string& hint,
                 const dupin::Location& location) {
  const int exit_code = static_cast<int>(errc);
  fmt::print(stderr, "dupin: {}\n", diagnostic);
  if (!hint.empty()) fmt::print(stderr, "  hint: {}\n", hint);
  if (context.json) {
    nlohmann::ordered_json document;
    auto& error = document["error"];
    error["exit"] = exit_code;
    error["code"] = code;
    error["message"] = message;
    error["file"] = location.file;
    if (location.line > 0) error["line"] = location.line;
    if (location.byte >= 0) error["byte"] = location.byte;
    error["hint"] = hint;
    const std::string text =
        document.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    std::fwrite(text.data(), 1, text.size(), stdout);
    std::fflush(stdout);
  }
  return exit_code;
}

constexpr const char* kUsageHint = "dupin --help, or dupin VERB --help";

int report_error(const Context& context, const Error& error) {
  const bool needs_hint = error.hint().empty() && error.errc() == Errc::usage;
  return report_error(context, error.errc(), error.code(), error.diagnostic(), error.what(),
                      needs_hint ? kUsageHint : error.hint(), error.location());
}

int usage_error(const Context& context, const std::string& message) {
  std::string line = message.substr(0, message.find('\n'));
  return report_error(context, Errc::usage, "E_OPTION", "E_OPTION: " + dupin::escaped(line, 400),
                      line, kUsageHint, {});
}

void add_verbs(CLI::App& app, Context& context) {
  dupin::cli::add_check(app, context);
  dupin::cli::add_curvature(app, context);
  dupin::cli::add_scalespace(app, context);
  dupin::cli::add_keypoints(app, context);
  dupin::cli::add_render(app, context);
  dupin::cli::add_mls(app, context);
  dupin::cli::add_synth(app, context);
  dupin::cli::add_demo(app, context);
  dupin::cli::add_completion(app, context);
  dupin::cli::add_version(app, context);
}

int run(int argc, char** argv) {
  Context context;
  active_context = &context;
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
    return context.run.cancelled() ? static_cast<int>(Errc::interrupted) : context.exit_code;
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForAllHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return app.exit(version);
  } catch (const CLI::ParseError& error) {
    return usage_error(context, error.what());
  } catch (const Error& error) {
    return report_error(context, error);
  } catch (const std::bad_alloc&) {
    return report_error(context, Errc::over_limit, "E_MEMORY", "E_MEMORY: not enough memory",
                        "not enough memory", "a smaller input, or fewer levels", {});
  } catch (const std::exception& error) {
    return report_error(context, Errc::internal, "E_INTERNAL",
                        std::string("E_INTERNAL: ") + dupin::escaped(error.what()), error.what(),
                        "this is a bug; please report it with the input", {});
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
