#pragma once

#include <memory>

namespace dupin {

/// Handle to one cancellable run. Copies share state; a default-constructed handle is inert, so a
/// caller who does not care writes nothing. Cancellation is sticky: create() a fresh one per run.
class RunControl {
 public:
  RunControl() = default;
  static RunControl create();

  void cancel() const;     ///< any thread or signal handler, idempotent
  bool cancelled() const;  ///< one relaxed load: cheap enough for every outer iteration
  /// For what has no Status to return: readers and the program. @throws Error(Errc::interrupted)
  /// E_INTERRUPTED if cancelled()
  void throw_if_cancelled() const;
  double progress() const;             ///< in [0, 1], never decreases during a run
  void report(double fraction) const;  ///< called by algorithms only; fraction of this stage

  /// A handle to the same run whose report(0..1) fills [from, to] of this handle's range.
  RunControl stage(double from, double to) const;

 private:
  struct State;
  std::shared_ptr<State> state_;  // null: inert
  double from_ = 0.0;
  double to_ = 1.0;
};

}  // namespace dupin
