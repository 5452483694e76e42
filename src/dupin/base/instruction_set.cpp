#include "dupin/base/instruction_set.h"

namespace dupin {

InstructionSet instruction_set() {
#ifdef DUPIN_X86
  static const InstructionSet widest = [] {
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw")) {
      return InstructionSet::avx512;
    }
    return __builtin_cpu_supports("avx2") ? InstructionSet::avx2 : InstructionSet::base;
  }();
  return widest;
#else
  return InstructionSet::base;
#endif
}

}  // namespace dupin
