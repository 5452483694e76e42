#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace dupin {

/// Kinds of failure. The values are the exit codes of the program and the names are the exception
/// names of the bindings.
enum class Errc : int {
  ok = 0,
  negative = 1,      ///< done, and the answer is no
  usage = 2,         ///< an argument or option outside its stated range
  cannot_read = 3,   ///< an input cannot be opened or read
  malformed = 4,     ///< an input is not what its format promises
  impossible = 5,    ///< well formed, but this analysis is impossible on it
  over_limit = 6,    ///< over a stated limit
  cannot_write = 7,  ///< an output cannot be written
  gallery = 8,       ///< gallery locked, damaged, wrong key, newer version
  numerical = 9,     ///< a stated accuracy was not reached
  internal = 70,     ///< a bug of ours
  interrupted = 130  ///< cancelled by the user
};

/// Where in an input something is wrong. Unknown parts keep their default.
struct Location {
  std::string file;
  std::int64_t line = 0;   ///< 1-based; 0: unknown
  std::int64_t byte = -1;  ///< offset from the start of the file; -1: unknown
};

/// Every exception that leaves the library. what() is one line without file name or hint.
class Error : public std::runtime_error {
 public:
  /// @param code stable diagnostic name such as "E_TRUNCATED"
  Error(Errc errc, std::string code, const std::string& message, Location location = {},
        std::string hint = {});

  Errc errc() const { return errc_; }
  const std::string& code() const { return code_; }
  const Location& location() const { return location_; }
  const std::string& hint() const { return hint_; }

  /// "FILE:LINE: E_CODE: message" with control characters escaped; FILE@0x1f4 for a byte offset.
  std::string diagnostic() const;

 private:
  Errc errc_;
  std::string code_;
  Location location_;
  std::string hint_;
};

/// The caller broke a stated precondition. Thrown before any work is done.
class InvalidArgument : public Error {
 public:
  explicit InvalidArgument(const std::string& message, std::string hint = {});
};

/// The world failed: a file that cannot be read, is malformed, or cannot be written.
class IoError : public Error {
 public:
  using Error::Error;
};

/// The data are well formed, but this analysis is impossible on them.
class AnalysisError : public Error {
 public:
  AnalysisError(std::string code, const std::string& message, std::string hint = {});
};

/// `text` with control characters, quotes and backslashes as \xNN and cut to `max_bytes`, fit for a
/// terminal. Valid UTF-8 passes unchanged.
std::string escaped(std::string_view text, std::size_t max_bytes = 200);

}  // namespace dupin
