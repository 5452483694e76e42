#pragma once

#include <memory>
#include <mutex>
#include <utility>

namespace dupin {

/// A value that threads take turns with. The mutex stays here, since base/ alone knows about
/// threads.
template <class T>
class Guarded {
 public:
  /// Calls action(value) while no other thread does.
  template <class Action>
  auto with(Action&& action) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::forward<Action>(action)(value_);
  }

 private:
  std::mutex mutex_;
  T value_;
};

}  // namespace dupin
