#include "dupin/io/file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <functional>
#include <thread>

#include "dupin/base/error.h"
#include "tests/unit/io/io_shapes.h"

namespace dupin {
namespace {

std::string open_code(const std::string& path, const ReadLimits& limits = {}) {
  try {
    FileBytes::open(path, limits);
    return {};
  } catch (const IoError& error) {
    return error.code();
  }
}

std::string write_code(const std::string& path, const std::string& text) {
  try {
    write_file_atomically(path, text);
    return {};
  } catch (const IoError& error) {
    EXPECT_EQ(error.errc(), Errc::cannot_write);
    return error.code();
  }
}

// Runs `work` in a child, which returns its exit status.
int in_child(const std::function<int()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    int status = 99;
    try {
      status = work();
    } catch (...) {
    }
    ::_exit(status);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

TEST(FileBytes, GivesTheBytesOfSmallAndLargeFiles) {
  const test::TemporaryFolder folder;
  for (const std::size_t size :
       {std::size_t{1}, std::size_t{65536}, std::size_t{65537}, std::size_t{1} << 20U}) {
    std::string text(size, 'x');
    text.back() = 'y';
    test::spit(folder / "a", text);
    const FileBytes file = FileBytes::open(folder / "a", {});
    ASSERT_EQ(file.bytes().size(), size);
    EXPECT_EQ(std::memcmp(file.bytes().data(), text.data(), size), 0);
  }
}

// The pages that a shortened file has lost end a process that looks at them; here they are zeros,
// and what was made of them is not believed.
TEST(FileBytes, OutlivesAFileThatShrinks) {
  const test::TemporaryFolder folder;
  constexpr std::size_t kSize = std::size_t{3} << 20U;
  test::spit(folder / "a", std::string(kSize, 'x'));
  const auto count_of = [](const FileBytes& file) {
    return static_cast<std::size_t>(
        std::count(file.bytes().begin(), file.bytes().end(), std::uint8_t{'x'}));
  };
  EXPECT_EQ(in_child([&] {
              const FileBytes file = FileBytes::open(folder / "a", {});
              if (file.judge("a", [&] { return count_of(file); }) != kSize) return 2;
              if (::truncate((folder / "a").c_str(), 100) != 0) return 3;
              try {
                return file.judge("a", [&] { return count_of(file); }) == 100 ? 1 : 5;
              } catch (const IoError& error) {
                return error.code() == "E_READ" ? 0 : 4;
              }
              return 1;
            }),
            0);
}

// The guard is for its own mappings: a process whose other mappings break still ends as before.
TEST(FileBytes, LeavesOtherMappingsAlone) {
  const test::TemporaryFolder folder;
  test::spit(folder / "a", std::string(std::size_t{1} << 20U, 'x'));
  test::spit(folder / "b", std::string(std::size_t{1} << 20U, 'x'));
  EXPECT_EQ(in_child([&] {
              ::signal(SIGBUS, SIG_DFL);  // whatever the tests run under
              const FileBytes file = FileBytes::open(folder / "a", {});
              const int fd = ::open((folder / "b").c_str(), O_RDONLY);
              const void* const data =
                  ::mmap(nullptr, std::size_t{1} << 20U, PROT_READ, MAP_PRIVATE, fd, 0);
              if (::truncate((folder / "b").c_str(), 100) != 0) return 2;
              return static_cast<const volatile std::uint8_t*>(data)[1 << 19] + 1;
            }),
            1000 + SIGBUS);
}

// A silent pipe is left as soon as the run is cancelled.
TEST(FileBytes, IsInterruptedWhileItWaits) {
  EXPECT_EQ(in_child([] {
              int ends[2];
              if (::pipe(ends) != 0 || ::dup2(ends[0], STDIN_FILENO) < 0) return 2;
              const RunControl run = RunControl::create();
              std::thread other([&] {
                std::this_thread::sleep_for(std::chrono::milliseconds(50));
                run.cancel();
              });
              int status = 1;
              try {
                FileBytes::open("-", {}, run);
              } catch (const Error& error) {
                status = error.errc() == Errc::interrupted ? 0 : 3;
              }
              other.join();
              return status;
            }),
            0);
}

// Contract row 2: refused within 50 ms, although nobody will ever write into the FIFO.
TEST(FileBytes, RefusesWhatIsNoRegularFileAtOnce) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  ASSERT_EQ(::symlink("/dev/zero", (folder / "zero").c_str()), 0);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  struct sockaddr_un address {};
  address.sun_family = AF_UNIX;
  const std::string socket_path = folder / "socket";
  ASSERT_LT(socket_path.size(), sizeof(address.sun_path));
  std::memcpy(address.sun_path, socket_path.c_str(), socket_path.size() + 1);
  ASSERT_EQ(::bind(fd, reinterpret_cast<const struct sockaddr*>(&address), sizeof(address)), 0);
  // The least of several: on a busy machine any one may wait.
  auto least = std::chrono::steady_clock::duration::max();
  for (int attempt = 0; attempt < 10 && least >= std::chrono::milliseconds(50); ++attempt) {
    const auto start = std::chrono::steady_clock::now();
    for (const char* name : {"fifo", "zero", "socket", "."}) {
      EXPECT_EQ(open_code(folder / name), "E_NOT_A_FILE") << name;
    }
    least = std::min(least, std::chrono::steady_clock::now() - start);
  }
  EXPECT_LT(least, std::chrono::milliseconds(50));
  ::close(fd);
}

TEST(FileBytes, NamesWhyAFileCannotBeOpened) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::symlink("loop", (folder / "loop").c_str()), 0);
  ASSERT_EQ(::symlink("no/such", (folder / "dangling").c_str()), 0);
  test::spit(folder / "empty", "");
  test::spit(folder / "file", "12345");
  EXPECT_EQ(open_code(folder / "missing"), "E_NOT_FOUND");
  EXPECT_EQ(open_code(folder / "dangling"), "E_NOT_FOUND");
  EXPECT_EQ(open_code(folder / "file/below"), "E_NOT_FOUND");
  EXPECT_EQ(open_code(folder / "loop"), "E_OPEN");
  EXPECT_EQ(open_code(folder / "empty"), "E_EMPTY");
  EXPECT_EQ(open_code(folder / "file", {.max_file_bytes = 4}), "E_TOO_LARGE");
  EXPECT_EQ(open_code(folder / "file", {.max_file_bytes = 5}), "");
  EXPECT_EQ(open_code(folder / std::string(300, 'n')), "E_OPEN");
}

TEST(FileBytes, AnUnreadableFileIsAMatterOfPermission) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to give up its rights in a child";
  const test::TemporaryFolder folder;
  ASSERT_EQ(::chmod(folder.path().c_str(), 0755), 0);
  test::spit(folder / "a", "text");
  ASSERT_EQ(::chmod((folder / "a").c_str(), 0), 0);
  EXPECT_EQ(in_child([&] {
              if (::setuid(65534) != 0) return 2;
              return open_code(folder / "a") == "E_PERMISSION" ? 0 : 1;
            }),
            0);
}

TEST(FileBytes, ReadsStandardInputWithinTheLimit) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{10}, std::size_t{200000}}) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t writer = ::fork();
    if (writer == 0) {
      ::close(ends[0]);
      const std::string text(size, 'x');
      std::size_t done = 0;
      while (done < size) {
        const ssize_t n = ::write(ends[1], text.data() + done, size - done);
        if (n <= 0) break;
        done += static_cast<std::size_t>(n);
      }
      ::_exit(0);
    }
    ::close(ends[1]);
    const int status = in_child([&] {
      ::dup2(ends[0], STDIN_FILENO);
      if (size == 0) return open_code("-") == "E_EMPTY" ? 0 : 1;
      if (size > 100000) return open_code("-", {.max_file_bytes = 99999}) == "E_TOO_LARGE" ? 0 : 1;
      return FileBytes::open("-", {}).bytes().size() == size ? 0 : 1;
    });
    EXPECT_EQ(status, 0) << size;
    ::close(ends[0]);
    ::waitpid(writer, nullptr, 0);
  }
}

// Only what this program leaves behind is cleaned up, and of that only what is left behind.
TEST(WriteFileAtomically, LeavesFilesOfOthersAlone) {
  const test::TemporaryFolder folder;
  const char* kept[] = {".a.dupin-notes",     ".a.dupin-",      ".a.dupin-1-2",
                        ".a.dupin-1-2-3.txt", ".a.dupin-1-2-x", ".a.dupin-12345678901-2-3"};
  for (const char* name : kept) test::spit(folder / name, "mine");
  ASSERT_EQ(::symlink("target", (folder / ".a.dupin-7-8-9").c_str()), 0);
  ASSERT_EQ(::mkfifo((folder / ".a.dupin-7-8-10").c_str(), 0600), 0);
  test::spit(folder / ".a.dupin-1-2-3", "left by a killed process");
  EXPECT_EQ(write_code(folder / "a", "text"), "");
  struct stat info {};
  for (const char* name : kept) EXPECT_EQ(::lstat((folder / name).c_str(), &info), 0) << name;
  EXPECT_EQ(::lstat((folder / ".a.dupin-7-8-9").c_str(), &info), 0);
  EXPECT_EQ(::lstat((folder / ".a.dupin-7-8-10").c_str(), &info), 0);
  EXPECT_NE(::lstat((folder / ".a.dupin-1-2-3").c_str(), &info), 0);
}

TEST(WriteFileAtomically, ReplacesTheFileAndLeavesNothingElse) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(write_code(folder / "a", "first"), "");
  EXPECT_EQ(write_code(folder / "a", "second"), "");
  EXPECT_EQ(test::slurp(folder / "a"), "second");
  EXPECT_EQ(write_code(folder / "empty", ""), "");
  EXPECT_EQ(folder.num_entries(), 2U);
}

// New files get what the umask grants, replaced ones keep what they had.
TEST(WriteFileAtomically, HonoursTheUmaskAndKeepsTheMode) {
  const test::TemporaryFolder folder;
  const mode_t before = ::umask(027);
  write_file_atomically(folder / "new", std::string_view("x"));
  ::umask(before);
  struct stat info {};
  ASSERT_EQ(::stat((folder / "new").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777U, 0640U);
  ASSERT_EQ(::chmod((folder / "new").c_str(), 0604), 0);
  write_file_atomically(folder / "new", std::string_view("y"));
  ASSERT_EQ(::stat((folder / "new").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777U, 0604U);
}

TEST(WriteFileAtomically, FollowsALink) {
  const test::TemporaryFolder folder;
  test::spit(folder / "target", "old");
  ASSERT_EQ(::symlink("target", (folder / "link").c_str()), 0);
  EXPECT_EQ(write_code(folder / "link", "new"), "");
  EXPECT_EQ(test::slurp(folder / "target"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
}

TEST(WriteFileAtomically, RefusesTargetsThatCannotBeReplaced) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::mkdir((folder / "dir").c_str(), 0700), 0);
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  test::spit(folder / "protected", "old");
  ASSERT_EQ(::chmod((folder / "protected").c_str(), 0444), 0);
  EXPECT_EQ(write_code(folder / "dir", "x"), "E_WRITE");
  EXPECT_EQ(write_code(folder / "dir/", "x"), "E_WRITE");
  EXPECT_EQ(write_code(folder / "no/such", "x"), "E_WRITE");
  EXPECT_EQ(write_code(folder / "fifo", "x"), "E_WRITE");
  EXPECT_EQ(write_code("", "x"), "E_WRITE");
  EXPECT_EQ(write_code(folder / "protected", "x"), "E_WRITE");
  EXPECT_EQ(test::slurp(folder / "protected"), "old");
  EXPECT_EQ(write_code("/dev/full", "x"), "E_WRITE");
  EXPECT_EQ(write_code("/dev/null", "x"), "");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_EQ(folder.num_entries(), 3U);
}

// What a write would refuse for its target is refused before, with nothing written; what it would
// take is taken.
TEST(RequireWritable, SaysWhatAWriteWouldSay) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::mkdir((folder / "dir").c_str(), 0700), 0);
  test::spit(folder / "protected", "old");
  ASSERT_EQ(::chmod((folder / "protected").c_str(), 0444), 0);
  const auto code = [](const std::string& path) -> std::string {
    try {
      require_writable(path);
      return {};
    } catch (const IoError& error) {
      EXPECT_EQ(error.errc(), Errc::cannot_write);
      return error.code();
    }
  };
  for (const std::string& bad : {folder / "dir", folder / "dir/", folder / "no/such",
                                 folder / "protected", folder / "new/", std::string()}) {
    EXPECT_EQ(code(bad), "E_WRITE") << bad;
    EXPECT_EQ(write_code(bad, "x"), "E_WRITE") << bad;
  }
  EXPECT_EQ(folder.num_entries(), 2U);
  EXPECT_EQ(code(folder / "new"), "");
  EXPECT_EQ(code("-"), "");
  EXPECT_EQ(code("/dev/null"), "");
  EXPECT_EQ(folder.num_entries(), 2U);
}

TEST(WriteFileAtomically, FaultsOfStandardOutputAreFaultsOfWriting) {
  EXPECT_EQ(in_child([] {
              ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO);
              return write_code("-", "text") == "E_WRITE" ? 0 : 1;
            }),
            0);
  EXPECT_EQ(in_child([] {
              std::signal(SIGPIPE, SIG_IGN);
              int ends[2];
              if (::pipe(ends) != 0) return 2;
              ::dup2(ends[1], STDOUT_FILENO);
              ::close(ends[0]);
              ::close(ends[1]);
              return write_code("-", "text") == "E_WRITE" ? 0 : 1;
            }),
            0);
}

// The old file stays, to the byte, and the temporary goes.
TEST(WriteFileAtomically, AFileSizeLimitLeavesTheOldFile) {
  const test::TemporaryFolder folder;
  test::spit(folder / "a", "old");
  EXPECT_EQ(in_child([&] {
              std::signal(SIGXFSZ, SIG_IGN);
              const struct rlimit limit { 1000, 1000 };
              ::setrlimit(RLIMIT_FSIZE, &limit);
              return write_code(folder / "a", std::string(100000, 'x')) == "E_WRITE" ? 0 : 1;
            }),
            0);
  EXPECT_EQ(test::slurp(folder / "a"), "old");
  EXPECT_EQ(folder.num_entries(), 1U);
}

TEST(WriteFileAtomically, AFullDiskLeavesTheOldFile) {
  const test::TemporaryFolder folder;
  const std::string disk = folder / "disk";
  ASSERT_EQ(::mkdir(disk.c_str(), 0700), 0);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "needs the right to mount a tmpfs: " << std::strerror(errno);
  }
  test::spit(disk + "/a", "old");
  EXPECT_EQ(write_code(disk + "/a", std::string(1 << 20, 'x')), "E_WRITE");
  EXPECT_EQ(test::slurp(disk + "/a"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(disk),
                          std::filesystem::directory_iterator()),
            1);
  ::umount(disk.c_str());
}

// A process that is killed at any moment leaves the old or the new file; whatever it leaves beside
// it, the next one removes.
TEST(WriteFileAtomically, AKilledWriterLeavesTheOldOrTheNewFile) {
  const test::TemporaryFolder folder;
  const std::string old_text(300000, 'o');
  const std::string new_text(300000, 'n');
  write_file_atomically(folder / "a", old_text);
  for (int trial = 0; trial < 40; ++trial) {
    const pid_t child = ::fork();
    if (child == 0) {
      while (true) {
        write_file_atomically(folder / "a", new_text);
        write_file_atomically(folder / "a", old_text);
      }
    }
    std::this_thread::sleep_for(std::chrono::microseconds(1000 + 371 * trial));
    ::kill(child, trial % 2 == 0 ? SIGKILL : SIGTERM);
    ::waitpid(child, nullptr, 0);
    const std::string text = test::slurp(folder / "a");
    ASSERT_TRUE(text == old_text || text == new_text) << "trial " << trial;
    if (trial % 2 != 0) {
      ASSERT_EQ(folder.num_entries(), 1U) << "after SIGTERM";
    }
    write_file_atomically(folder / "a", old_text);
    ASSERT_EQ(folder.num_entries(), 1U) << "trial " << trial;
  }
}

// A temporary that a living process holds is not swept away.
TEST(WriteFileAtomically, TwoWritersDoNotDisturbEachOther) {
  const test::TemporaryFolder folder;
  std::vector<pid_t> children;
  for (int writer = 0; writer < 4; ++writer) {
    const pid_t child = ::fork();
    if (child == 0) {
      try {
        for (int i = 0; i < 50; ++i) {
          write_file_atomically(folder / "a", std::string(20000, static_cast<char>('a' + writer)));
        }
      } catch (...) {
        ::_exit(1);
      }
      ::_exit(0);
    }
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  const std::string text = test::slurp(folder / "a");
  EXPECT_EQ(text, std::string(20000, text.front()));
  EXPECT_EQ(folder.num_entries(), 1U);
}

}  // namespace
}  // namespace dupin
