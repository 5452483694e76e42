#pragma once

namespace dupin {

/// How a computation ended. Anything but `ok` says which part of the result is valid.
enum class Status {
  ok,             ///< everything asked for is there
  cancelled,      ///< the RunControl was cancelled: what the result says is done is valid
  not_converged,  ///< the stated tolerance was not reached: the result carries what was reached
};

}  // namespace dupin
