#pragma once

#include <string>

namespace dupin::test {

/// Path of a file of the shared data folder, or "" when the folder is not on this machine. Tests
/// that need it skip with the reason then.
std::string shared_data(const std::string& relative_path);

}  // namespace dupin::test

/// Skips the test, loudly, when a file of the shared data is missing.
#define DUPIN_REQUIRE_SHARED(variable, relative)                     \
  const std::string variable = ::dupin::test::shared_data(relative); \
  if ((variable).empty()) GTEST_SKIP() << "shared data not on this machine: " << (relative)
