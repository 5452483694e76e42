#include "dupin/io/file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <utility>

#include "dupin/base/error.h"

namespace dupin {
namespace {

// Below this size a copy is as fast as a mapping.
constexpr std::int64_t kSmallFile = 1 << 16;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

struct Free {
  void operator()(std::uint8_t* data) const { std::free(data); }
};
using Buffer = std::unique_ptr<std::uint8_t, Free>;

[[noreturn]] void fail_read(const std::string& path, const char* code, const std::string& message,
                            const std::string& hint = {}) {
  throw IoError(Errc::cannot_read, code, message, {path, 0, -1}, hint);
}

[[noreturn]] void fail_open(const std::string& path, int error) {
  const std::string reason = std::strerror(error);
  if (error == ENOENT || error == ENOTDIR) fail_read(path, "E_NOT_FOUND", reason);
  if (error == EACCES || error == EPERM) fail_read(path, "E_PERMISSION", reason);
  fail_read(path, "E_OPEN", reason);
}

void require_regular(const std::string& path, mode_t mode) {
  if (S_ISREG(mode)) return;
  const char* kind = S_ISDIR(mode)    ? "a directory"
                     : S_ISFIFO(mode) ? "a FIFO"
                     : S_ISSOCK(mode) ? "a socket"
                                      : "a device";
  fail_read(path, "E_NOT_A_FILE", std::string("is ") + kind,
            "give a regular file, or - to read standard input");
}

void require_size(const std::string& path, std::int64_t size, const ReadLimits& limits) {
  if (size == 0) throw IoError(Errc::malformed, "E_EMPTY", "the file is empty", {path, 0, -1});
  if (size > limits.max_file_bytes) {
    throw IoError(
        Errc::over_limit, "E_TOO_LARGE",
        std::to_string(size) + " bytes, the limit is " + std::to_string(limits.max_file_bytes),
        {path, 0, -1}, "raise it with --max-file-bytes");
  }
}

Buffer grown(Buffer buffer, std::size_t size) {
  void* const data = std::realloc(buffer.get(), size);
  if (data == nullptr) throw std::bad_alloc();
  static_cast<void>(buffer.release());
  return Buffer(static_cast<std::uint8_t*>(data));
}

// A pipe may stay silent for ever: only poll() lets the run be looked at meanwhile.
void wait_for_input(int fd, const RunControl& run) {
  struct pollfd wanted {
    fd, POLLIN, 0
  };
  do {
    run.throw_if_cancelled();
  } while (::poll(&wanted, 1, 100) == 0);
  run.throw_if_cancelled();
}

// Reads to the end, at most one byte more than the limit, which require_size() then refuses.
std::pair<Buffer, std::size_t> read_all(int fd, const std::string& path, std::size_t first_capacity,
                                        const ReadLimits& limits, const RunControl& run) {
  const auto most = static_cast<std::size_t>(limits.max_file_bytes) + 1;
  std::size_t capacity = std::min(first_capacity, most);
  std::size_t size = 0;
  Buffer buffer = grown(nullptr, capacity);
  while (size < most) {
    if (size == capacity) {
      capacity = std::min(2 * capacity, most);
      buffer = grown(std::move(buffer), capacity);
    }
    wait_for_input(fd, run);
    const ssize_t got = ::read(fd, buffer.get() + size, capacity - size);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (got < 0 && errno == EISDIR) require_regular(path, S_IFDIR);
    if (got < 0) fail_read(path, "E_READ", std::strerror(errno));
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  require_size(path, static_cast<std::int64_t>(size), limits);
  return {std::move(buffer), size};
}

}  // namespace

FileBytes FileBytes::open(const std::string& path, const ReadLimits& limits,
                          const RunControl& run) {
  FileBytes file;
  if (path == "-") {
    auto [buffer, size] = read_all(STDIN_FILENO, path, std::size_t{1} << 16U, limits, run);
    file.data_ = buffer.release();
    file.size_ = size;
    return file;
  }
  // Looked at before it is opened, because opening can already act on a device; and again after,
  // because the name may mean another file by then.
  struct stat info {};
  if (path.find('\0') != std::string::npos) fail_open(path, ENOENT);
  if (::stat(path.c_str(), &info) != 0) fail_open(path, errno);
  require_regular(path, info.st_mode);
  const Descriptor fd(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  if (fd.get() < 0) fail_open(path, errno);
  if (::fstat(fd.get(), &info) != 0) fail_open(path, errno);
  require_regular(path, info.st_mode);
  // Files of /proc and the like say that they are empty and are not.
  if (info.st_size > kSmallFile) {
    require_size(path, info.st_size, limits);
    file.size_ = static_cast<std::size_t>(info.st_size);
    file.mapping_ = detail::Mapping(fd.get(), file.size_);
    file.data_ = file.mapping_.data();
    if (file.data_ != nullptr) return file;
  }
  const auto expected = static_cast<std::size_t>(info.st_size) + 1;
  auto [buffer, size] = read_all(fd.get(), path, expected, limits, run);
  file.data_ = buffer.release();
  file.size_ = size;
  return file;
}

void FileBytes::require_whole(const std::string& path) const {
  if (mapping_.was_cut()) fail_read(path, "E_READ", "the file became shorter while it was read");
}

FileBytes::FileBytes(FileBytes&& other) noexcept
    : mapping_(std::move(other.mapping_)),
      data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)) {}

FileBytes& FileBytes::operator=(FileBytes&& other) noexcept {
  std::swap(mapping_, other.mapping_);
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

FileBytes::~FileBytes() {
  // free() wants the memory as writable although nobody writes to it any more.
  if (mapping_.data() == nullptr) std::free(const_cast<std::uint8_t*>(data_));
}

}  // namespace dupin
