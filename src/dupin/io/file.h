#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "dupin/base/error.h"
#include "dupin/base/mapping.h"
#include "dupin/base/run_control.h"
#include "dupin/io/read_options.h"

namespace dupin {

/// The bytes of an input, memory-mapped where possible, unmapped at the end of its life.
class FileBytes {
 public:
  /// Opens `path` without blocking and refuses what is not a regular file; "-" reads standard input
  /// to its end within limits.max_file_bytes, and looks at `run` ten times a second while it waits.
  /// @throws IoError E_NOT_FOUND, E_OPEN, E_PERMISSION, E_NOT_A_FILE, E_READ (Errc::cannot_read),
  ///   E_EMPTY (Errc::malformed), E_TOO_LARGE (Errc::over_limit)
  /// @throws Error(Errc::interrupted) when cancelled
  static FileBytes open(const std::string& path, const ReadLimits& limits,
                        const RunControl& run = {});

  FileBytes(FileBytes&& other) noexcept;
  FileBytes& operator=(FileBytes&& other) noexcept;
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  ~FileBytes();

  std::span<const std::uint8_t> bytes() const { return {data_, size_}; }

  /// Says that bytes [first, last) will not be read soon: the memory of a mapping is given back.
  void release(std::size_t first, std::size_t last) const { mapping_.release(first, last); }

  /// What `parse()` makes of the bytes, if they all stayed there: neither its result nor its error
  /// is to be believed when the file became shorter meanwhile, for then some bytes were zeros.
  /// @throws IoError E_READ in that case
  template <class Parse>
  auto judge(const std::string& path, Parse&& parse) const {
    try {
      auto result = parse();
      require_whole(path);
      return result;
    } catch (const IoError&) {
      require_whole(path);
      throw;
    }
  }

 private:
  FileBytes() = default;
  void require_whole(const std::string& path) const;
  detail::Mapping mapping_;  // empty: data_ is on the heap
  const std::uint8_t* data_ = nullptr;
  std::size_t size_ = 0;
};

/// Writes `bytes` beside `path` under a temporary name, flushes, and renames: readers see the old
/// or the new file, whole. The temporary is removed on failure and on SIGINT/SIGTERM (it is
/// anonymous until it is complete where the file system can do that). "-" writes standard output
/// and checks every write.
/// @throws IoError E_WRITE (Errc::cannot_write) with the system's reason
void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes);
void write_file_atomically(const std::string& path, std::string_view text);

/// Refuses, before long work, what write_file_atomically() would refuse after it: a directory, a
/// protected file, a folder that is missing or may not be written. Writes nothing; room on the
/// device is not asked for. "-" and devices pass.
/// @throws IoError E_WRITE (Errc::cannot_write) with the system's reason
void require_writable(const std::string& path);

}  // namespace dupin
