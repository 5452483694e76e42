#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/run_control.h"
#include "dupin/base/warning.h"
#include "dupin/io/read_options.h"

namespace dupin::cli {

/// What every verb shares: the global options, the run, and the ways to speak.
struct Context {
  bool json = false;
  bool quiet = false;
  bool strict = false;
  int threads = 0;
  std::uint64_t seed = 0;
  double timeout_seconds = 0.0;  ///< of the whole command; 0: none
  ReadOptions read;
  std::string input;  ///< the last surface that was loaded: where an error without a place happened
  RunControl run = RunControl::create();
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  std::atomic<bool> timed_out{false};          ///< then `run` is cancelled, and for good
  volatile std::sig_atomic_t last_signal = 0;  ///< that cancelled the run; 0: none
  int exit_code = 0;                           ///< set by a verb whose answer is "no"
  bool is_stdout_taken = false;                ///< by an output: then nothing is said there
  std::atomic<bool> is_writing{false};         ///< see begin_outputs()
  std::mutex unfinished_mutex;
  std::string unfinished;  ///< folder that goes when an interruption ends the program at once

  /// Prints `document` on stdout when --json was given (and nothing else ever goes there then).
  void print_json(const nlohmann::ordered_json& document) const;
  /// Prints a line for people on stdout, unless --json.
  void say(const std::string& line) const;
  /// Warnings for people on stderr, unless --quiet; with --strict the first one becomes an error.
  void report(const std::string& file, const WarningList& warnings) const;
};

nlohmann::ordered_json to_json(const WarningList& warnings);
nlohmann::ordered_json number_or_null(const std::optional<double>& value);
/// The fields of an error: exit, code, message, file, line or byte where they are known, hint.
nlohmann::ordered_json to_json(const Error& error);
/// The text of `document`, and a line end. Bytes that are no UTF-8, as file names may hold, become
/// U+FFFD.
std::string to_text(const nlohmann::ordered_json& document);

/// `word` as one word of a shell: quoted where it must be, and never an option.
std::string shell_quoted(const std::string& word);
/// "dupin: FILE:LINE: E_CODE: ..." and the hint, on stderr.
void tell_error(const Error& error);

/// tell_error(), and the error as the JSON document when JSON was asked for. Returns the exit code:
/// for an interruption 130 or 143, what a shell expects of a program that the signal ended.
int report_error(const Context& context, const Error& error);

/// The format of an output, one of `legal`: the extension of `path` in lower case; for "-",
/// standard output, `named` by --format, or the only legal one. From then on nothing else is said
/// there.
/// @throws InvalidArgument if it is none of them, or --json wants standard output as well
std::string output_format(Context& context, const std::string& path, const std::string& named,
                          const std::vector<std::string>& legal);

/// Adds --format: the format of standard input where its content does not tell.
void add_input_format(CLI::App& verb, Context& context);
/// The formats that it may name.
const std::vector<std::string>& input_formats();

/// Accepts numbers in [low, high] and nothing else: CLI::Range lets NaN pass.
CLI::Validator in_range(double low, double high);

/// Adds the global options (--json, --quiet, --threads, ...) to a verb.
void add_global_options(CLI::App& verb, Context& context);

/// To be called inside with_progress() when all that is to be written is there, before the first of
/// several outputs: from here to the end of the work a signal or --timeout comes too late, so that
/// they are written all or not at all. @throws Error E_INTERRUPTED
void begin_outputs(Context& context);

/// Runs `work` on context.threads threads with a progress bar on a terminal; throws
/// Error(Errc::interrupted) when it was cancelled and E_TIMEOUT when --timeout has passed, at once
/// if it had before. Work that has not heeded a signal within 0.3 s is abandoned: the program ends
/// there, reported as above. Outputs are atomic, so none is left half written.
void with_progress(Context& context, const std::string& what, const std::function<void()>& work);

// One function a verb, in a file of its name. Each adds its subcommand; the callback does the work.
void add_check(CLI::App& app, Context& context);
void add_curvature(CLI::App& app, Context& context);
void add_scalespace(CLI::App& app, Context& context);
void add_keypoints(CLI::App& app, Context& context);
void add_mls(CLI::App& app, Context& context);
void add_render(CLI::App& app, Context& context);
void add_synth(CLI::App& app, Context& context);
void add_demo(CLI::App& app, Context& context);
void add_completion(CLI::App& app, Context& context);
void add_version(CLI::App& app, Context& context);

}  // namespace dupin::cli
