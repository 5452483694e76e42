#pragma once

#include <cstdint>

namespace dupin {

/// Seeded random numbers, the same on every platform with the same libm.
/// Stream: splitmix64 from a start that is a hash of the seed, so that neighbouring seeds share
/// nothing; no global state.
class Rng {
 public:
  explicit Rng(std::uint64_t seed);

  std::uint64_t next();  ///< 64 random bits
  double uniform();      ///< in [0, 1), 53 bits
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Standard normal deviate (Marsaglia's polar method).
  double normal();
  /// Uniform integer in [0, bound); bound > 0.
  std::uint64_t below(std::uint64_t bound);

 private:
  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace dupin
