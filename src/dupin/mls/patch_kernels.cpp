#include "dupin/mls/patch_kernels.h"

#include <cstddef>
#include <cstdint>

#include "dupin/base/instruction_set.h"

// Vectors are written out because GCC does not vectorise sums without leave to reorder them.
namespace dupin::detail {
namespace {

using Eigen::Index;

typedef double Lanes __attribute__((vector_size(32), aligned(8), may_alias));
typedef std::int64_t IntLanes __attribute__((vector_size(32), aligned(8), may_alias));

DUPIN_INLINE const Lanes& at(const double* from) { return *reinterpret_cast<const Lanes*>(from); }
DUPIN_INLINE Lanes& at(double* to) { return *reinterpret_cast<Lanes*>(to); }

// sums[a] = sum_i powers[a][i] factor[i] for a < kCount.
template <int kCount>
DUPIN_INLINE void dots(Index count, const double* const* powers, const double* factor,
                       double* sums) {
  Lanes sum[static_cast<std::size_t>(kCount)] = {};
  for (Index i = 0; i < count; i += kPatchLanes) {
    const Lanes f = at(factor + i);
    sum[0] += f;
    for (int a = 1; a < kCount; ++a) sum[a] += at(powers[a] + i) * f;
  }
  for (int a = 0; a < kCount; ++a) {
    sums[a] = (sum[a][0] + sum[a][1]) + (sum[a][2] + sum[a][3]);
  }
}

DUPIN_INLINE void multiply(Index count, const double* a, const double* b, double* out) {
  for (Index i = 0; i < count; i += kPatchLanes) at(out + i) = at(a + i) * at(b + i);
}

// All moments of one weight array. table[b][a] is filled for a + b <= kDegree.
template <std::size_t kDegree, std::size_t kB = 0>
DUPIN_INLINE void rows(Index count, const double* const* powers, const double* y, double* factor,
                       double (*table)[kDegree + 1]) {
  double sums[kDegree + 1];
  dots<static_cast<int>(kDegree + 1 - kB)>(count, powers, factor, sums);
  for (std::size_t a = 0; a <= kDegree - kB; ++a) table[a][kB] = sums[a];
  if constexpr (kB < kDegree) {
    multiply(count, factor, y, factor);
    rows<kDegree, kB + 1>(count, powers, y, factor, table);
  }
}

DUPIN_INLINE void moments_body(Index count, const double* x, const double* y, const double* h,
                               const double* w, bool want_squared, double* scratch,
                               PatchMoments& moments) {
  double* powers[kMomentDegree + 1] = {};
  for (int a = 2; a <= kMomentDegree; ++a) powers[a] = scratch + (a - 2) * count;
  double* const factor = scratch + (kMomentDegree - 1) * count;
  const double* const_powers[kMomentDegree + 1] = {nullptr, x};
  for (int a = 2; a <= kMomentDegree; ++a) {
    multiply(count, const_powers[a - 1], x, powers[a]);
    const_powers[a] = powers[a];
  }
  for (Index i = 0; i < count; i += kPatchLanes) at(factor + i) = at(w + i);
  rows<std::size_t{kMomentDegree}>(count, const_powers, y, factor, moments.weight);
  multiply(count, w, h, factor);
  rows<std::size_t{kHeightDegree}>(count, const_powers, y, factor, moments.height);
  if (!want_squared) return;
  multiply(count, w, w, factor);
  rows<std::size_t{kMomentDegree}>(count, const_powers, y, factor, moments.squared);
}

// exp(-z) = 2^-n exp(r), z = n ln 2 - r, |r| <= ln 2 / 2: Taylor to degree 12 (remainder 2e-16).
DUPIN_INLINE void weights_body(Index count, const double* squared, double scale, double* out) {
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kLn2High = 6.93147180369123816490e-01;
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  constexpr double kTaylor[] = {1.0 / 479001600.0,
                                1.0 / 39916800.0,
                                1.0 / 3628800.0,
                                1.0 / 362880.0,
                                1.0 / 40320.0,
                                1.0 / 5040.0,
                                1.0 / 720.0,
                                1.0 / 120.0,
                                1.0 / 24.0,
                                1.0 / 6.0,
                                1.0 / 2.0,
                                1.0,
                                1.0};
  for (Index i = 0; i < count; i += kPatchLanes) {
    const Lanes z = at(squared + i) * scale;
    const Lanes shifted = z * -kLog2E + kRound;
    const Lanes n = shifted - kRound;
    const Lanes r = (-z - n * kLn2High) - n * kLn2Low;
    Lanes sum = r * kTaylor[0] + kTaylor[1];
    for (int k = 2; k < 13; ++k) sum = sum * r + kTaylor[k];
    // The integer stands in the low bits of `shifted`; moved to the exponent it multiplies by 2^n.
    IntLanes bits = *reinterpret_cast<const IntLanes*>(&shifted);
    bits <<= 52;
    IntLanes value = *reinterpret_cast<const IntLanes*>(&sum);
    value += bits;
    at(out + i) = *reinterpret_cast<const Lanes*>(&value);
  }
}

#ifdef DUPIN_X86
DUPIN_AVX2 void moments_avx2(Index count, const double* x, const double* y, const double* h,
                             const double* w, bool want_squared, double* scratch,
                             PatchMoments& moments) {
  moments_body(count, x, y, h, w, want_squared, scratch, moments);
}
DUPIN_AVX2 void weights_avx2(Index count, const double* squared, double scale, double* out) {
  weights_body(count, squared, scale, out);
}
#endif

}  // namespace

void sum_moments(Index count, const double* x, const double* y, const double* h, const double* w,
                 bool want_squared, double* scratch, PatchMoments& moments) {
#ifdef DUPIN_X86
  if (instruction_set() != InstructionSet::base)
    return moments_avx2(count, x, y, h, w, want_squared, scratch, moments);
#endif
  moments_body(count, x, y, h, w, want_squared, scratch, moments);
}

void gaussian_weights(Index count, const double* squared, double scale, double* out) {
#ifdef DUPIN_X86
  if (instruction_set() != InstructionSet::base) return weights_avx2(count, squared, scale, out);
#endif
  weights_body(count, squared, scale, out);
}

}  // namespace dupin::detail
