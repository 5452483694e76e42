#include "dupin/base/run_control.h"

#include <algorithm>
#include <atomic>

#include "dupin/base/error.h"

namespace dupin {

struct RunControl::State {
  std::atomic<bool> cancelled{false};
  std::atomic<double> progress{0.0};
};

RunControl RunControl::create() {
  RunControl control;
  control.state_ = std::make_shared<State>();
  return control;
}

void RunControl::cancel() const {
  if (state_) state_->cancelled.store(true, std::memory_order_relaxed);
}

bool RunControl::cancelled() const {
  return state_ && state_->cancelled.load(std::memory_order_relaxed);
}

void RunControl::throw_if_cancelled() const {
  if (cancelled()) throw Error(Errc::interrupted, "E_INTERRUPTED", "interrupted");
}

double RunControl::progress() const {
  return state_ ? state_->progress.load(std::memory_order_relaxed) : 0.0;
}

void RunControl::report(double fraction) const {
  if (!state_) return;
  const double value = from_ + (to_ - from_) * std::clamp(fraction, 0.0, 1.0);
  double seen = state_->progress.load(std::memory_order_relaxed);
  while (seen < value &&
         !state_->progress.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
}

RunControl RunControl::stage(double from, double to) const {
  RunControl part = *this;
  part.from_ = from_ + (to_ - from_) * from;
  part.to_ = from_ + (to_ - from_) * to;
  return part;
}

}  // namespace dupin
