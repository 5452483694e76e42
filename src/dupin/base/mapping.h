#pragma once

#include <cstddef>
#include <cstdint>

namespace dupin::detail {

/// A read-only mapping of a file that outlives the file's being shortened. Pages that the file has
/// lost read as zero, and was_cut() tells; without this they end the process with SIGBUS.
///
/// It lives here and not in io/ because threads and the handler share its atomics. No file is
/// opened. The first mapping installs a handler of SIGBUS for the process, because the system has
/// no other way to tell. It acts on addresses inside these mappings only and hands all others to
/// the handler that was there before.
class Mapping {
 public:
  Mapping() = default;
  /// Maps `size` bytes of `fd`. data() is null where that cannot be done or guarded (another system
  /// than Linux, 64 mappings at once): read the file instead.
  Mapping(int fd, std::size_t size);
  Mapping(Mapping&& other) noexcept;
  Mapping& operator=(Mapping&& other) noexcept;
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping();

  const std::uint8_t* data() const { return data_; }
  bool was_cut() const;
  /// Gives the memory of whole pages within [first, last) back; they are read again when they are
  /// looked at again.
  void release(std::size_t first, std::size_t last) const;

 private:
  const std::uint8_t* data_ = nullptr;
  int slot_ = -1;
};

}  // namespace dupin::detail
