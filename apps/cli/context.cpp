#include "context.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <thread>

#include "dupin/base/parallel.h"

namespace dupin::cli {

namespace {

// Everything the program prints on stdout goes through here: a full disk or a closed pipe is an
// error.
void write_stdout(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw IoError(Errc::cannot_write, "E_WRITE", "standard output cannot be written");
  }
}

std::string bar(const std::string& what, double fraction, double seconds) {
  constexpr int kWidth = 30;
  const int filled = static_cast<int>(fraction * kWidth);
  std::string line =
      fmt::format("\r{} [{}{}] {:3.0f} %", what, std::string(static_cast<std::size_t>(filled), '#'),
                  std::string(static_cast<std::size_t>(kWidth - filled), '.'), 100.0 * fraction);
  if (fraction > 0.02) {
    line += fmt::format(", {:.1f} %/s, {:.0f} s left ", 100.0 * fraction / seconds,
                        seconds * (1.0 - fraction) / fraction);
  }
  return line;
}

}  // namespace

void Context::print_json(const nlohmann::ordered_json& document) const {
  if (json) write_stdout(to_text(document));
}

void Context::say(const std::string& line) const {
  if (!json && !is_stdout_taken) write_stdout(line + "\n");
}

void Context::report(const std::string& file, const WarningList& warnings) const {
  for (const Warning& w : warnings.all()) {
    if (strict) {
      throw IoError(Errc::malformed, w.code, w.message + " (" + w.first + ")", {file, 0, -1},
                    "--strict turns every warning into an error");
    }
    if (!quiet) {
      fmt::print(stderr, "dupin: {}: {}: {} ({}, first: {})\n", escaped(file, 4096), w.code,
                 w.message, w.count, w.first);
    }
  }
}

nlohmann::ordered_json to_json(const WarningList& warnings) {
  auto list = nlohmann::ordered_json::array();
  for (const Warning& w : warnings.all()) {
    list.push_back(
        {{"code", w.code}, {"count", w.count}, {"first", w.first}, {"message", w.message}});
  }
  return list;
}

nlohmann::ordered_json number_or_null(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json to_json(const Error& error) {
  nlohmann::ordered_json fields{{"exit", static_cast<int>(error.errc())},
                                {"code", error.code()},
                                {"message", error.what()},
                                {"file", error.location().file}};
  if (error.location().line > 0) fields["line"] = error.location().line;
  if (error.location().byte >= 0) fields["byte"] = error.location().byte;
  fields["hint"] = error.hint();
  return fields;
}

std::string shell_quoted(const std::string& word) {
  const std::string name = word.size() > 1 && word[0] == '-' ? "./" + word : word;
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("_./:=@%+,-").find(c) != std::string_view::npos;
  };
  if (!name.empty() && std::all_of(name.begin(), name.end(), is_plain)) return name;
  std::string quoted = "'";
  for (const char c : name) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string to_text(const nlohmann::ordered_json& document) {
  return document.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void tell_error(const Error& error) {
  fmt::print(stderr, "dupin: {}\n", error.diagnostic());
  if (!error.hint().empty()) fmt::print(stderr, "  hint: {}\n", error.hint());
}

int report_error(const Context& context, const Error& error) {
  tell_error(error);
  const int signal = context.last_signal != 0 ? static_cast<int>(context.last_signal) : SIGINT;
  const int exit_code =
      error.errc() == Errc::interrupted ? 128 + signal : static_cast<int>(error.errc());
  if (context.json) {
    nlohmann::ordered_json document{{"error", to_json(error)}};
    document["error"]["exit"] = exit_code;
    const std::string text = to_text(document);
    std::fwrite(text.data(), 1, text.size(), stdout);
    std::fflush(stdout);
  }
  return exit_code;
}

namespace {

// Work goes on beside this: what it makes meanwhile goes in the next round.
void remove_unfinished(Context& context) {
  const std::lock_guard<std::mutex> lock(context.unfinished_mutex);
  if (context.unfinished.empty()) return;
  std::error_code error;
  for (int round = 0; round < 5; ++round) {
    std::filesystem::remove_all(context.unfinished, error);
    if (!error && !std::filesystem::exists(context.unfinished)) return;
  }
}

}  // namespace

void with_progress(Context& context, const std::string& what, const std::function<void()>& work) {
  set_thread_count(context.threads);
  context.is_writing = false;
  const auto require_time = [&] {
    if (!context.timed_out) return;
    throw Error(Errc::over_limit, "E_TIMEOUT",
                fmt::format("not done after {} s", context.timeout_seconds), {}, "raise --timeout");
  };
  require_time();
  // The watcher draws the bar, keeps --timeout and makes Ctrl-C final; it never touches the result.
  const bool draw = !context.quiet && isatty(STDERR_FILENO) == 1;
  std::mutex mutex;
  std::condition_variable wake;
  bool done = false;
  const auto watch = [&] {
    std::unique_lock<std::mutex> lock(mutex);
    const auto seconds_since = [](std::chrono::steady_clock::time_point start) {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    const auto start = std::chrono::steady_clock::now();
    auto signalled = std::chrono::steady_clock::time_point::max();
    while (!wake.wait_for(lock, std::chrono::milliseconds(50), [&] { return done; })) {
      if (context.timeout_seconds > 0.0 && seconds_since(context.start) > context.timeout_seconds) {
        context.timed_out = true;
        context.run.cancel();
      }
      if (context.last_signal != 0 && !context.is_writing) {
        signalled = std::min(signalled, std::chrono::steady_clock::now());
        if (seconds_since(signalled) > 0.3) {
          if (draw) fmt::print(stderr, "\r\033[K");
          remove_unfinished(context);
          std::_Exit(
              report_error(context, Error(Errc::interrupted, "E_INTERRUPTED", "interrupted")));
        }
      }
      if (draw && seconds_since(start) > 0.5) {
        fmt::print(stderr, "{}", bar(what, context.run.progress(), seconds_since(start)));
        std::fflush(stderr);
      }
    }
    if (draw) fmt::print(stderr, "\r\033[K");
  };
  std::thread watcher(watch);
  const auto finish = [&] {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      done = true;
    }
    wake.notify_all();
    watcher.join();
  };
  try {
    work();
  } catch (const Error& error) {
    finish();
    // --timeout cancels the run, which then ends as if somebody had interrupted it.
    if (error.errc() == Errc::interrupted) require_time();
    throw;
  } catch (...) {
    finish();
    throw;
  }
  finish();
  if (context.is_writing) return;
  require_time();
  context.run.throw_if_cancelled();
}

void begin_outputs(Context& context) {
  context.is_writing = true;
  if (!context.run.cancelled()) return;
  context.is_writing = false;
  context.run.throw_if_cancelled();
}

std::string output_format(Context& context, const std::string& path, const std::string& named,
                          const std::vector<std::string>& legal) {
  std::string format = named;
  std::string list;
  for (const std::string& name : legal) list += (list.empty() ? "" : ", ") + name;
  if (path == "-") {
    if (context.json)
      throw InvalidArgument("-o - and --json both want standard output", "write to a file");
    if (format.empty() && legal.size() == 1) format = legal.front();
    if (std::find(legal.begin(), legal.end(), format) == legal.end()) {
      throw InvalidArgument("-o - has no extension that names its format",
                            "name it with --format: " + list);
    }
    context.is_stdout_taken = true;
    return format;
  }
  const std::size_t dot = path.find_last_of("./");
  format = dot == std::string::npos || path[dot] == '/' ? "" : path.substr(dot + 1);
  std::transform(format.begin(), format.end(), format.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  if (std::find(legal.begin(), legal.end(), format) == legal.end()) {
    throw InvalidArgument("output has the extension \"" + escaped(format, 20) +
                          "\", legal: " + list);
  }
  return format;
}

const std::vector<std::string>& input_formats() {
  static const std::vector<std::string> names = {"ply", "obj", "off", "stl", "wrl", "abs",
                                                 "bnt", "xyz", "pts", "pcd", "glb"};
  return names;
}

void add_input_format(CLI::App& verb, Context& context) {
  verb.add_option("--format", context.read.stdin_format,
                  "Format of standard input where its content does not tell")
      ->check(CLI::IsMember(input_formats()));
}

CLI::Validator in_range(double low, double high) {
  return CLI::Validator(
      [low, high](const std::string& text) {
        double value = 0.0;
        if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high)
          return std::string();
        return fmt::format("{} is not in the range {} to {}", escaped(text, 40), low, high);
      },
      fmt::format("FLOAT in [{} - {}]", low, high), "RANGE");
}

void add_global_options(CLI::App& verb, Context& context) {
  verb.add_flag("--json", context.json, "Print exactly one JSON document on stdout");
  verb.add_flag("--quiet", context.quiet, "No progress and no warnings on stderr");
  verb.add_flag("--strict", context.strict, "Turn every warning into an error");
  verb.add_option("--threads", context.threads,
                  "Threads; the result is the same for every number (default: all)")
      ->check(CLI::Range(1, 1024));
  verb.add_option("--seed", context.seed, "Seed of everything random")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  verb.add_option("--timeout", context.timeout_seconds, "Give up after so many seconds")
      ->check(in_range(1e-3, 1e9));
  ReadLimits& limits = context.read.limits;
  const auto limit = [&](const char* name, std::int64_t& value, const char* text) {
    verb.add_option(name, value, text)
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40))
        ->capture_default_str()
        ->group("Limits");
  };
  limit("--max-file-bytes", limits.max_file_bytes, "Largest input file");
  limit("--max-vertices", limits.max_vertices, "Most vertices");
  limit("--max-faces", limits.max_faces, "Most faces");
  limit("--max-polygon", limits.max_polygon, "Most corners of a face");
  limit("--max-line-bytes", limits.max_line_bytes, "Longest line of a text file");
  limit("--max-expansion-ratio", limits.max_expansion_ratio, "Highest gzip ratio");
  limit("--max-expanded-bytes", limits.max_expanded_bytes, "Most bytes from a gzip file");
  limit("--max-image-pixels", limits.max_image_pixels, "Most pixels of a picture");
  verb.add_option("--max-nesting", limits.max_nesting, "Deepest nesting")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str()
      ->group("Limits");
  verb.add_flag("--drop-nonfinite", context.read.drop_nonfinite,
                "Remove vertices with NaN or infinite coordinates");
}

}  // namespace dupin::cli
