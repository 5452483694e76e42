#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace dupin {

/// A repair or a remark about an input: what, how often, and where first.
struct Warning {
  std::string code;        ///< stable name such as "W_DUPLICATE_FACE"
  std::int64_t count = 0;  ///< how many elements it concerns
  std::string first;       ///< first place, in words: "face 320", "line 17", "vertex 5"
  std::string message;     ///< one line for people
};

/// Warnings in the order in which they were first met; one entry a code.
class WarningList {
 public:
  /// Adds `count` to the entry of `code`, creating it with `first` and `message` if it is new.
  void add(const std::string& code, const std::string& first, const std::string& message,
           std::int64_t count = 1);
  void append(const WarningList& other);

  bool contains(const std::string& code) const;
  bool empty() const { return warnings_.empty(); }
  const std::vector<Warning>& all() const { return warnings_; }

 private:
  std::vector<Warning> warnings_;
};

}  // namespace dupin
