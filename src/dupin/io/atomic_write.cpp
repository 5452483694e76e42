#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/io/file.h"

// System calls only, no stdio: every failure is seen where it happens, and a test can inject it.
namespace dupin {
namespace {

[[noreturn]] void fail_write(const std::string& path, int error) {
  throw IoError(Errc::cannot_write, "E_WRITE", std::strerror(error), {path, 0, -1});
}

// SIGINT and SIGTERM wait while a temporary has a name, so that they cannot leave it behind.
class DeferredSignals {
 public:
  DeferredSignals() {
    sigset_t deferred;
    sigemptyset(&deferred);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&deferred, signal);
    pthread_sigmask(SIG_BLOCK, &deferred, &before_);
  }
  DeferredSignals(const DeferredSignals&) = delete;
  DeferredSignals& operator=(const DeferredSignals&) = delete;
  ~DeferredSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

 private:
  sigset_t before_;
};

// A file being written: unnamed at first where the file system can do that. Its name, if any, is
// gone at the end of its life unless keep() was called.
class Temporary {
 public:
  Temporary(std::string path, const std::string& directory, const std::string& prefix)
      : path_(std::move(path)), directory_(directory), prefix_(prefix) {}
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    if (!name_.empty()) ::unlink(name_.c_str());
    if (fd_ >= 0) ::close(fd_);
  }

  void create(bool may_be_unnamed);
  void write_all(std::span<const std::uint8_t> bytes) const;
  void sync_with_mode(mode_t kept_mode) const;
  bool give_name();
  void rename_to(const std::string& target);

 private:
  std::string next_name();
  bool lock();

  std::string path_;  // as the caller wrote it, for messages
  std::string directory_;
  std::string prefix_;
  std::string name_;
  int fd_ = -1;
  mode_t mode_ = 0;
  unsigned attempt_ = 0;
};

std::string Temporary::next_name() {
  struct timespec now {};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return directory_ + "/" + prefix_ + std::to_string(::getpid()) + "-" +
         std::to_string(now.tv_nsec) + "-" + std::to_string(attempt_++);
}

// The lock tells a temporary in use from one that a killed process left. False if somebody has
// taken it for the latter in the instant between its creation and its lock.
bool Temporary::lock() {
  while (::flock(fd_, LOCK_EX) != 0) {
    if (errno != EINTR) return true;  // no locks here: nothing is cleaned up either
  }
  struct stat info {};
  return ::fstat(fd_, &info) == 0 && info.st_nlink > 0;
}

void Temporary::create(bool may_be_unnamed) {
#ifdef O_TMPFILE
  if (may_be_unnamed) {
    fd_ = ::open(directory_.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (fd_ >= 0) {
      while (::flock(fd_, LOCK_EX) != 0 && errno == EINTR) {
      }
    }
  }
#else
  static_cast<void>(may_be_unnamed);
#endif
  while (fd_ < 0) {
    const std::string name = next_name();
    fd_ = ::open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd_ < 0 && (errno == EEXIST || errno == EINTR) && attempt_ < 100) continue;
    if (fd_ < 0) fail_write(path_, errno);
    if (lock()) {
      name_ = name;
    } else {
      ::close(fd_);
      fd_ = -1;
    }
  }
  // The mode that the umask grants is read off the file, because reading the umask itself changes
  // it for every thread. Until it is complete, the file is private.
  struct stat info {};
  if (::fstat(fd_, &info) != 0) fail_write(path_, errno);
  mode_ = info.st_mode & 0777U;
  if (::fchmod(fd_, 0600) != 0) fail_write(path_, errno);
}

void write_fully(int fd, std::span<const std::uint8_t> bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail_write(path, errno);
    if (written == 0) fail_write(path, ENOSPC);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

void Temporary::write_all(std::span<const std::uint8_t> bytes) const {
  write_fully(fd_, bytes, path_);
}

void Temporary::sync_with_mode(mode_t kept_mode) const {
  if (::fchmod(fd_, kept_mode != 0 ? kept_mode : mode_) != 0) fail_write(path_, errno);
  while (::fsync(fd_) != 0) {
    if (errno != EINTR) fail_write(path_, errno);
  }
}

// False where an unnamed file cannot be named (no /proc).
bool Temporary::give_name() {
  if (!name_.empty()) return true;
  const std::string self = "/proc/self/fd/" + std::to_string(fd_);
  while (true) {
    const std::string name = next_name();
    if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0) {
      name_ = name;
      return true;
    }
    if (errno == EEXIST && attempt_ < 100) continue;
    if (errno == ENOENT || errno == EPERM || errno == EACCES) return false;
    fail_write(path_, errno);
  }
}

// Closing may be what tells of a failure (NFS): a second descriptor is closed before the name of
// the target is given up. The lock stays with the first.
void Temporary::rename_to(const std::string& target) {
  const int copy = ::dup(fd_);
  if (copy >= 0 && ::close(copy) != 0 && errno != EINTR) fail_write(path_, errno);
  if (::rename(name_.c_str(), target.c_str()) != 0) fail_write(path_, errno);
  name_.clear();
  const int fd = std::exchange(fd_, -1);
  if (::close(fd) != 0 && errno != EINTR) fail_write(path_, errno);
}

// "PID-NANOSECONDS-ATTEMPT", as next_name() ends.
bool is_our_suffix(const char* suffix) {
  for (int part = 0; part < 3; ++part) {
    const std::size_t digits = std::strspn(suffix, "0123456789");
    if (digits == 0 || digits > 10) return false;
    suffix += digits;
    if (part < 2 && *suffix++ != '-') return false;
  }
  return *suffix == '\0';
}

// Removes temporaries of this target that no living process holds: regular files of this user with
// exactly such a name.
void remove_leftovers(const std::string& directory, const std::string& prefix) {
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(::opendir(directory.c_str()), ::closedir);
  if (entries == nullptr) return;
  while (const dirent* entry = ::readdir(entries.get())) {
    if (std::strncmp(entry->d_name, prefix.c_str(), prefix.size()) != 0) continue;
    if (!is_our_suffix(entry->d_name + prefix.size())) continue;
    const std::string name = directory + "/" + entry->d_name;
    const int fd = ::open(name.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0) continue;
    struct stat info {};
    const bool is_ours = ::fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && info.st_nlink == 1 &&
                         info.st_uid == ::geteuid();
    if (is_ours && ::flock(fd, LOCK_EX | LOCK_NB) == 0) ::unlink(name.c_str());
    ::close(fd);
  }
}

void sync_directory(const std::string& directory, const std::string& path) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;  // a directory that may be written but not read
  int error = 0;
  while (::fsync(fd) != 0) {
    error = errno;
    if (error != EINTR) break;
    error = 0;
  }
  ::close(fd);
  if (error != 0 && error != EINVAL && error != ENOTSUP) fail_write(path, error);
}

// Devices and pipes that already have a name (/dev/stdout, a process substitution) cannot be
// replaced; they are written to.
void write_to_special(const std::string& path, std::span<const std::uint8_t> bytes) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (fd < 0) fail_write(path, errno);
  const int flags = ::fcntl(fd, F_GETFL);
  if (flags >= 0) ::fcntl(fd, F_SETFL, flags & ~O_NONBLOCK);
  try {
    write_fully(fd, bytes, path);
  } catch (...) {
    ::close(fd);
    throw;
  }
  if (::close(fd) != 0 && errno != EINTR) fail_write(path, errno);
}

// A link is followed, so that the file it names is replaced and not the link.
std::string resolved(const std::string& path) {
  const std::unique_ptr<char, void (*)(void*)> real(::realpath(path.c_str(), nullptr), std::free);
  return real == nullptr ? path : std::string(real.get());
}

std::string directory_of(const std::string& target) {
  const std::size_t slash = target.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : target.substr(0, slash);
}

// Is there a device or a pipe? Refuses what cannot be written whatever is there; `kept_mode` is
// that of the file to be replaced, 0 if there is none.
bool is_special(const std::string& path, mode_t& kept_mode) {
  if (path.empty() || path.find('\0') != std::string::npos) fail_write(path, ENOENT);
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0) {
    if (S_ISDIR(info.st_mode)) fail_write(path, EISDIR);
    if (!S_ISREG(info.st_mode)) return true;
    // Renaming would replace a file that its owner has protected.
    if ((info.st_mode & 0222U) == 0) fail_write(path, EACCES);
    if (::access(path.c_str(), W_OK) != 0) fail_write(path, errno);
    kept_mode = info.st_mode & 0777U;
  } else if (errno != ENOENT) {
    fail_write(path, errno);
  }
  if (path.back() == '/') fail_write(path, EISDIR);
  return false;
}

bool write_regular(const std::string& path, const std::string& target, mode_t kept_mode,
                   std::span<const std::uint8_t> bytes, bool may_be_unnamed) {
  const std::string directory = directory_of(target);
  // 200 bytes leave room for the number within the 255 that a name may have.
  const std::string prefix = "." + target.substr(target.rfind('/') + 1).substr(0, 200) + ".dupin-";
  remove_leftovers(directory, prefix);
  const auto deferred = may_be_unnamed ? nullptr : std::make_unique<DeferredSignals>();
  Temporary temporary(path, directory, prefix);
  temporary.create(may_be_unnamed);
  temporary.write_all(bytes);
  temporary.sync_with_mode(kept_mode);
  {
    const DeferredSignals while_named;
    if (!temporary.give_name()) return false;
    temporary.rename_to(target);
  }
  sync_directory(directory, path);
  return true;
}

}  // namespace

void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes) {
  if (path == "-") return write_fully(STDOUT_FILENO, bytes, "-");
  mode_t kept_mode = 0;
  if (is_special(path, kept_mode)) return write_to_special(path, bytes);
  const std::string target = resolved(path);
  if (!write_regular(path, target, kept_mode, bytes, true)) {
    write_regular(path, target, kept_mode, bytes, false);
  }
}

void require_writable(const std::string& path) {
  if (path == "-") return;
  mode_t kept_mode = 0;
  if (is_special(path, kept_mode)) return;
  if (::access(directory_of(resolved(path)).c_str(), W_OK | X_OK) != 0) fail_write(path, errno);
}

void write_file_atomically(const std::string& path, std::string_view text) {
  write_file_atomically(path,
                        std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

}  // namespace dupin
