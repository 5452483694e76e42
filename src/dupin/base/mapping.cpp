#include "dupin/base/mapping.h"

#include <utility>

#if defined(__linux__) && !defined(__EMSCRIPTEN__)
#include <sys/auxv.h>
#include <sys/mman.h>

#include <atomic>
#include <csignal>

namespace dupin::detail {
namespace {

// What the handler may look at: lock-free atomics only. `first` is set last and cleared first.
struct Slot {
  std::atomic<bool> is_taken{false};
  std::atomic<std::uintptr_t> first{0};
  std::atomic<std::uintptr_t> end{0};
  std::atomic<bool> was_cut{false};
};
static_assert(std::atomic<std::uintptr_t>::is_always_lock_free);

constexpr int kSlots = 64;
Slot slots[kSlots];
std::uintptr_t page_size = 4096;
struct sigaction before {};

void on_bus_error(int signal, siginfo_t* info, void* /*context*/) {
  const auto at = reinterpret_cast<std::uintptr_t>(info->si_addr);
  for (Slot& slot : slots) {
    const std::uintptr_t first = slot.first.load();
    if (first == 0 || at < first || at >= slot.end.load()) continue;
    const std::uintptr_t page = at / page_size * page_size;
    slot.was_cut.store(true);
    void* const zeros = ::mmap(reinterpret_cast<void*>(page), slot.end.load() - page, PROT_READ,
                               MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
    if (zeros != MAP_FAILED) return;
  }
  // Not ours: the access is repeated, and meets whoever was here before.
  ::sigaction(signal, &before, nullptr);
}

void install() {
  static const bool installed = [] {
    page_size = ::getauxval(AT_PAGESZ);
    struct sigaction action {};
    action.sa_sigaction = on_bus_error;
    action.sa_flags = SA_SIGINFO | SA_NODEFER;
    sigemptyset(&action.sa_mask);
    return ::sigaction(SIGBUS, &action, &before) == 0;
  }();
  static_cast<void>(installed);
}

int take_slot() {
  for (int i = 0; i < kSlots; ++i) {
    if (!slots[i].is_taken.exchange(true)) return i;
  }
  return -1;
}

}  // namespace

Mapping::Mapping(int fd, std::size_t size) {
  const int taken = take_slot();
  if (taken < 0) return;
  install();
  void* const data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE | MAP_POPULATE, fd, 0);
  if (data == MAP_FAILED) {
    slots[taken].is_taken = false;
    return;
  }
  data_ = static_cast<const std::uint8_t*>(data);
  slot_ = taken;
  slots[taken].was_cut = false;
  slots[taken].end = reinterpret_cast<std::uintptr_t>(data) + size;
  slots[taken].first = reinterpret_cast<std::uintptr_t>(data);
}

Mapping::~Mapping() {
  if (data_ == nullptr) return;
  Slot& slot = slots[slot_];
  const std::uintptr_t first = slot.first.exchange(0);
  // The interface wants the memory as writable although nobody wrote to it.
  ::munmap(const_cast<std::uint8_t*>(data_), slot.end.load() - first);
  slot.is_taken = false;
}

bool Mapping::was_cut() const { return data_ != nullptr && slots[slot_].was_cut.load(); }

void Mapping::release(std::size_t first, std::size_t last) const {
  const std::size_t begin = (first + page_size - 1) / page_size * page_size;
  const std::size_t end = last / page_size * page_size;
  if (data_ == nullptr || begin >= end) return;
  // The interface wants the memory as writable although nobody writes to it.
  ::madvise(const_cast<std::uint8_t*>(data_) + begin, end - begin, MADV_DONTNEED);
}

#else

namespace dupin::detail {

Mapping::Mapping(int /*fd*/, std::size_t /*size*/) {}
Mapping::~Mapping() = default;
bool Mapping::was_cut() const { return slot_ >= 0; }
void Mapping::release(std::size_t /*first*/, std::size_t /*last*/) const {}

#endif

Mapping::Mapping(Mapping&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), slot_(std::exchange(other.slot_, -1)) {}

Mapping& Mapping::operator=(Mapping&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(slot_, other.slot_);
  return *this;
}

}  // namespace dupin::detail
