# Compile options of everything in this tree, as one interface target.
add_library(dupin_options INTERFACE)
target_compile_options(dupin_options INTERFACE
  -ffp-contract=off)  # a*b+c is the same everywhere: results do not depend on FMA

target_compile_options(dupin_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor
  -Woverloaded-virtual -Wold-style-cast -Wcast-qual -Wdouble-promotion -Wnull-dereference
  -Wmissing-declarations
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond -Wlogical-op>)
if(DUPIN_WERROR)
  target_compile_options(dupin_options INTERFACE -Werror)
endif()

# In optimised builds GCC 12's flow analysis sees impossible paths in Eigen and std::string (null, uninitialised) (GCC bug 105651).
target_compile_options(dupin_options INTERFACE
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<NOT:$<CONFIG:Debug>>>:-Wno-null-dereference -Wno-maybe-uninitialized>
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)

if(CMAKE_BUILD_TYPE STREQUAL "Debug")
  set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g1")
  target_compile_definitions(dupin_options INTERFACE _GLIBCXX_ASSERTIONS DUPIN_ASSERTIONS=1)
else()
  set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
  if(NOT DUPIN_SANITIZE)
    target_compile_options(dupin_options INTERFACE
      $<$<NOT:$<STREQUAL:${CMAKE_SYSTEM_NAME},Emscripten>>:-fstack-protector-strong>)
  endif()
endif()

if(DUPIN_SANITIZE)
  target_compile_options(dupin_options INTERFACE -fsanitize=${DUPIN_SANITIZE}
    -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(dupin_options INTERFACE -fsanitize=${DUPIN_SANITIZE})
endif()
if(DUPIN_FUZZ)
  target_compile_options(dupin_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
