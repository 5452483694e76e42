#pragma once

#include <cstdio>
#include <cstdlib>

/// Checks an invariant of our own; never a user's input. Active in debug, test and sanitizer
/// builds.
#if defined(DUPIN_ASSERTIONS) && DUPIN_ASSERTIONS
#define DUPIN_ASSERT(condition)                                                                  \
  ((condition)                                                                                   \
       ? static_cast<void>(0)                                                                    \
       : (std::fprintf(stderr, "%s:%d: broken invariant: %s\n", __FILE__, __LINE__, #condition), \
          std::abort()))
#else
#define DUPIN_ASSERT(condition) static_cast<void>(0)
#endif
