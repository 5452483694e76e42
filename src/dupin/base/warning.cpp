#include "dupin/base/warning.h"

#include <algorithm>

namespace dupin {

void WarningList::add(const std::string& code, const std::string& first, const std::string& message,
                      std::int64_t count) {
  if (count <= 0) return;
  for (Warning& warning : warnings_) {
    if (warning.code == code) {
      warning.count += count;
      return;
    }
  }
  warnings_.push_back({code, count, first, message});
}

void WarningList::append(const WarningList& other) {
  for (const Warning& w : other.warnings_) add(w.code, w.first, w.message, w.count);
}

bool WarningList::contains(const std::string& code) const {
  return std::any_of(warnings_.begin(), warnings_.end(),
                     [&](const Warning& warning) { return warning.code == code; });
}

}  // namespace dupin
