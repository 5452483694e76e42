#include "tests/support/data.h"

#include <filesystem>

namespace dupin::test {

std::string shared_data(const std::string& relative_path) {
  const auto path = std::filesystem::path(DUPIN_SHARED_DATA) / relative_path;
  std::error_code error;
  return std::filesystem::exists(path, error) ? path.string() : std::string();
}

}  // namespace dupin::test
