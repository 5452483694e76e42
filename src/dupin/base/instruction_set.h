#pragma once

// One source of a kernel, compiled for several instruction sets and chosen at run time. No variant
// contracts a*b+c, and all add in the same order, so they give the same bits (ADR 0004).

#if defined(__x86_64__) && defined(__GNUC__)
#define DUPIN_X86 1
#define DUPIN_AVX2 __attribute__((target("avx2")))
#ifdef __clang__
#define DUPIN_AVX512 __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw")))
#else  // clang knows no preferred width, and needs none
#define DUPIN_AVX512 \
  __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,prefer-vector-width=512")))
#endif
#endif

#ifdef DUPIN_X86
/// A part of an AVX2 variant that says so with intrinsics.
#define DUPIN_AVX2_INLINE inline __attribute__((always_inline, target("avx2")))
#endif

/// A function without a variant of its own: it takes the instruction set of its caller.
#define DUPIN_INLINE inline __attribute__((always_inline))

namespace dupin {

enum class InstructionSet { base, avx2, avx512 };

/// The widest that this machine knows. Cost: one load after the first call.
InstructionSet instruction_set();

}  // namespace dupin
