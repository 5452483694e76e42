#include <gtest/gtest.h>

#ifdef DUPIN_TRAPS
#include <cfenv>
#endif

int main(int argc, char** argv) {
#ifdef DUPIN_TRAPS
  // The first NaN stops the program where it is born. Threads inherit the setting.
  feenableexcept(FE_INVALID | FE_DIVBYZERO);
#endif
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
