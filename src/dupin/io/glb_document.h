#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/io/read_options.h"

namespace dupin::detail {

/// Where the values of one glTF accessor lie, checked against the file.
struct GlbAccessor {
  std::int64_t count = 0;
  int num_components = 1;
  int component_type = 5126;  ///< 5120 i8, 5121 u8, 5122 i16, 5123 u16, 5125 u32, 5126 float
  bool is_normalized = false;
  bool has_data = false;  ///< false: zeros
  std::size_t start = 0;  ///< of the first element in the BIN chunk
  std::size_t stride = 0;
  std::int64_t num_sparse = 0;
  std::size_t sparse_indices = 0;
  int sparse_index_type = 5125;
  std::size_t sparse_values = 0;
};

/// The JSON and BIN chunks of a binary glTF 2.0 file, with checked access.
/// All errors are IoError: E_MAGIC, E_HEADER, E_TRUNCATED, E_SYNTAX, E_NESTING, E_NUMBER_RANGE,
/// E_INDEX_RANGE, E_TOO_LARGE.
class GlbDocument {
 public:
  /// Neither argument is copied. The JSON chunk may have at most 4 MiB: its tree takes up to 25
  /// times its text.
  GlbDocument(std::span<const std::uint8_t> bytes, const std::string& name,
              const ReadLimits& limits);
  ~GlbDocument();
  GlbDocument(const GlbDocument&) = delete;
  GlbDocument& operator=(const GlbDocument&) = delete;

  const nlohmann::json& root() const { return *json_; }
  bool has_trailing_data() const { return has_trailing_data_; }

  /// root()[list][index]; E_INDEX_RANGE if there is none.
  const nlohmann::json& item(const char* list, std::int64_t index) const;
  /// A whole number >= 0 at `key` of `object`, or `absent` if the key is missing.
  std::int64_t whole(const nlohmann::json& object, const char* key, std::int64_t absent) const;
  /// Numbers at `key` into `values`; false if the key is missing.
  bool numbers(const nlohmann::json& object, const char* key, std::span<double> values) const;

  /// Checks accessor `index`, which must have `num_components` components ("VEC3": 3).
  GlbAccessor accessor(std::int64_t index, int num_components, std::int64_t most) const;
  /// All values of `accessor`, sparse ones put in place: count * num_components numbers, normalized
  /// integers in [0, 1] or [-1, 1].
  std::vector<double> values(const GlbAccessor& accessor) const;
  /// The same for whole numbers.
  std::vector<std::uint32_t> indices(const GlbAccessor& accessor) const;

  [[noreturn]] void fail(Errc errc, const char* code, const std::string& message) const;

 private:
  void check_depth(std::span<const std::uint8_t> text) const;
  std::size_t view_range(const nlohmann::json& view, std::int64_t offset, std::int64_t bytes) const;
  /// Calls put(element, byte in the BIN chunk) for every sparse value.
  template <typename Put>
  void for_each_sparse(const GlbAccessor& accessor, const Put& put) const;
  double component(std::size_t at, int type, bool is_normalized) const;

  std::span<const std::uint8_t> bytes_;
  std::span<const std::uint8_t> bin_;
  const std::string& name_;
  const ReadLimits& limits_;
  std::unique_ptr<nlohmann::json> json_;
  bool has_trailing_data_ = false;
};

}  // namespace dupin::detail
