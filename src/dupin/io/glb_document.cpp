#include "dupin/io/glb_document.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dupin/io/little_endian.h"

namespace dupin::detail {
namespace {

using nlohmann::json;

constexpr std::uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinChunk = 0x004E4942;   // "BIN"
constexpr std::size_t kMaxJsonBytes = std::size_t{4} << 20;

int size_of(int component_type) {
  switch (component_type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      return 0;
  }
}

}  // namespace

GlbDocument::GlbDocument(std::span<const std::uint8_t> bytes, const std::string& name,
                         const ReadLimits& limits)
    : bytes_(bytes), name_(name), limits_(limits) {
  if (bytes.size() < 4) fail(Errc::malformed, "E_TRUNCATED", "the file ends inside its header");
  if (load_le(bytes.data(), 4) != kMagic) {
    fail(Errc::malformed, "E_MAGIC", "a binary glTF file starts with 'glTF'");
  }
  if (bytes.size() < 20) fail(Errc::malformed, "E_TRUNCATED", "the file ends inside its header");
  if (load_le(bytes.data() + 4, 4) != 2) {
    fail(Errc::malformed, "E_HEADER", "only version 2 of glTF is read");
  }
  const std::uint64_t length = load_le(bytes.data() + 8, 4);
  if (length > bytes.size()) {
    fail(Errc::malformed, "E_TRUNCATED",
         "the header claims " + std::to_string(length) + " bytes, the file has " +
             std::to_string(bytes.size()));
  }
  has_trailing_data_ = length < bytes.size();
  std::span<const std::uint8_t> text;
  for (std::size_t at = 12; at < length;) {
    if (length - at < 8) fail(Errc::malformed, "E_HEADER", "the header of a chunk is cut");
    const std::uint64_t size = load_le(bytes.data() + at, 4);
    const std::uint64_t type = load_le(bytes.data() + at + 4, 4);
    if (size > length - at - 8)
      fail(Errc::malformed, "E_HEADER", "a chunk is longer than the file");
    const auto chunk = bytes.subspan(at + 8, size);
    if (at == 12 && type != kJsonChunk) fail(Errc::malformed, "E_HEADER", "no JSON chunk at first");
    if (at == 12) text = chunk;
    if (type == kBinChunk && bin_.empty()) bin_ = chunk;
    at += 8 + size;
  }
  if (text.size() > kMaxJsonBytes) {
    fail(Errc::over_limit, "E_TOO_LARGE", "a JSON chunk of more than 4 MiB");
  }
  check_depth(text);
  json_ = std::make_unique<json>(json::parse(text.begin(), text.end(), nullptr, false));
  if (!json_->is_object()) fail(Errc::malformed, "E_SYNTAX", "the JSON chunk is not a JSON object");
}

GlbDocument::~GlbDocument() = default;

void GlbDocument::fail(Errc errc, const char* code, const std::string& message) const {
  throw IoError(errc, code, message, Location{name_, 0, -1});
}

/// Counts brackets before the parser sees them.
void GlbDocument::check_depth(std::span<const std::uint8_t> text) const {
  int depth = 0;
  bool is_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::uint8_t c = text[i];
    if (is_string) {
      if (c == '\\') ++i;
      if (c == '"') is_string = false;
    } else if (c == '"') {
      is_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > limits_.max_nesting) {
        fail(Errc::over_limit, "E_NESTING",
             "JSON nested deeper than " + std::to_string(limits_.max_nesting) + " levels");
      }
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
}

const json& GlbDocument::item(const char* list, std::int64_t index) const {
  const auto found = json_->find(list);
  if (found == json_->end() || !found->is_array() || index < 0 ||
      index >= static_cast<std::int64_t>(found->size())) {
    fail(Errc::malformed, "E_INDEX_RANGE",
         std::string(list) + "[" + std::to_string(index) + "] does not exist");
  }
  const json& value = (*found)[static_cast<std::size_t>(index)];
  if (!value.is_object()) {
    fail(Errc::malformed, "E_SYNTAX",
         std::string(list) + "[" + std::to_string(index) + "] is not an object");
  }
  return value;
}

std::int64_t GlbDocument::whole(const json& object, const char* key, std::int64_t absent) const {
  const auto found = object.find(key);
  if (found == object.end()) return absent;
  constexpr std::uint64_t most = std::uint64_t{1} << 53;
  if (!found->is_number_unsigned() || found->get<std::uint64_t>() > most) {
    fail(Errc::malformed, "E_NUMBER_RANGE",
         std::string("'") + key + "' is not a whole number >= 0");
  }
  return static_cast<std::int64_t>(found->get<std::uint64_t>());
}

bool GlbDocument::numbers(const json& object, const char* key, std::span<double> values) const {
  const auto found = object.find(key);
  if (found == object.end()) return false;
  if (!found->is_array() || found->size() != values.size()) {
    fail(Errc::malformed, "E_SYNTAX",
         std::string("'") + key + "' is not a list of " + std::to_string(values.size()) +
             " numbers");
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const json& value = (*found)[i];
    if (!value.is_number()) {
      fail(Errc::malformed, "E_SYNTAX", std::string("'") + key + "' holds something else");
    }
    values[i] = value.get<double>();
  }
  return true;
}

/// Where `bytes` bytes from `offset` in `view` start in the BIN chunk.
std::size_t GlbDocument::view_range(const json& view, std::int64_t offset,
                                    std::int64_t bytes) const {
  const std::int64_t buffer = whole(view, "buffer", -1);
  const json& owner = item("buffers", buffer);
  if (buffer != 0 || owner.contains("uri")) {
    fail(Errc::malformed, "E_HEADER",
         "buffers[" + std::to_string(buffer) + "] is not in the file; no other file is opened");
  }
  const std::int64_t start = whole(view, "byteOffset", 0);
  const std::int64_t length = whole(view, "byteLength", 0);
  const auto available = static_cast<std::int64_t>(bin_.size());
  if (start > available || length > available - start || offset > length ||
      bytes > length - offset) {
    fail(Errc::malformed, "E_INDEX_RANGE", "an accessor reaches beyond its buffer");
  }
  return static_cast<std::size_t>(start + offset);
}

GlbAccessor GlbDocument::accessor(std::int64_t index, int num_components, std::int64_t most) const {
  const json& source = item("accessors", index);
  GlbAccessor result;
  result.count = whole(source, "count", 0);
  result.num_components = num_components;
  result.component_type =
      static_cast<int>(std::min<std::int64_t>(whole(source, "componentType", 0), 65535));
  const int size = size_of(result.component_type);
  const auto type = source.find("type");
  static constexpr const char* types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  if (size == 0 || type == source.end() || !type->is_string() ||
      type->get_ref<const std::string&>() != types[num_components - 1]) {
    fail(Errc::malformed, "E_HEADER",
         "accessors[" + std::to_string(index) + "] is not a list of " + types[num_components - 1]);
  }
  const auto normalized = source.find("normalized");
  result.is_normalized = normalized != source.end() && normalized->is_boolean() &&
                         normalized->get<bool>() && result.component_type != 5126;
  if (result.count > most) {
    fail(Errc::over_limit,
         result.count > static_cast<std::int64_t>(bin_.size()) ? "E_COUNT_EXCEEDS_FILE"
                                                               : "E_TOO_LARGE",
         "accessors[" + std::to_string(index) + "] claims " + std::to_string(result.count) +
             " elements");
  }
  const std::int64_t element = std::int64_t{size} * num_components;
  const std::int64_t offset = whole(source, "byteOffset", 0);
  if (source.contains("bufferView")) {
    const json& view = item("bufferViews", whole(source, "bufferView", -1));
    const std::int64_t stride = whole(view, "byteStride", element);
    if (stride < element || stride > 4096) {
      fail(Errc::malformed, "E_HEADER", "a byteStride that does not fit its elements");
    }
    const std::int64_t span = result.count == 0 ? 0 : stride * (result.count - 1) + element;
    result.start = view_range(view, offset, span);
    result.stride = static_cast<std::size_t>(stride);
    result.has_data = true;
  }
  const auto sparse = source.find("sparse");
  if (sparse == source.end()) return result;
  if (!sparse->is_object() || !sparse->contains("indices") || !sparse->contains("values") ||
      !(*sparse)["indices"].is_object() || !(*sparse)["values"].is_object()) {
    fail(Errc::malformed, "E_SYNTAX", "a sparse accessor without indices and values");
  }
  const json& places = (*sparse)["indices"];
  const json& stored = (*sparse)["values"];
  result.num_sparse = whole(*sparse, "count", 0);
  if (result.num_sparse > result.count) {
    fail(Errc::malformed, "E_INDEX_RANGE", "more sparse values than elements");
  }
  result.sparse_index_type =
      static_cast<int>(std::min<std::int64_t>(whole(places, "componentType", 0), 65535));
  const int index_size = size_of(result.sparse_index_type);
  if (index_size == 0 || result.sparse_index_type == 5126) {
    fail(Errc::malformed, "E_HEADER", "sparse indices that are not whole numbers");
  }
  result.sparse_indices =
      view_range(item("bufferViews", whole(places, "bufferView", -1)),
                 whole(places, "byteOffset", 0), result.num_sparse * index_size);
  result.sparse_values = view_range(item("bufferViews", whole(stored, "bufferView", -1)),
                                    whole(stored, "byteOffset", 0), result.num_sparse * element);
  return result;
}

double GlbDocument::component(std::size_t at, int type, bool is_normalized) const {
  const std::uint8_t* bytes = bin_.data() + at;
  switch (type) {
    case 5120: {
      const auto value = static_cast<double>(signed_from_bits(load_le(bytes, 1), 1));
      return is_normalized ? std::max(value / 127.0, -1.0) : value;
    }
    case 5121: {
      const auto value = static_cast<double>(load_le(bytes, 1));
      return is_normalized ? value / 255.0 : value;
    }
    case 5122: {
      const auto value = static_cast<double>(signed_from_bits(load_le(bytes, 2), 2));
      return is_normalized ? std::max(value / 32767.0, -1.0) : value;
    }
    case 5123: {
      const auto value = static_cast<double>(load_le(bytes, 2));
      return is_normalized ? value / 65535.0 : value;
    }
    case 5125:
      return static_cast<double>(load_le(bytes, 4));
    default:
      return float_from_bits(static_cast<std::uint32_t>(load_le(bytes, 4)));
  }
}

template <typename Put>
void GlbDocument::for_each_sparse(const GlbAccessor& accessor, const Put& put) const {
  const auto index_size = static_cast<std::size_t>(size_of(accessor.sparse_index_type));
  const auto element_size =
      static_cast<std::size_t>(size_of(accessor.component_type) * accessor.num_components);
  for (std::size_t i = 0; i < static_cast<std::size_t>(accessor.num_sparse); ++i) {
    const std::uint64_t element = load_le(bin_.data() + accessor.sparse_indices + i * index_size,
                                          static_cast<int>(index_size));
    if (element >= static_cast<std::uint64_t>(accessor.count)) {
      fail(Errc::malformed, "E_INDEX_RANGE", "a sparse index out of range");
    }
    put(element, accessor.sparse_values + i * element_size);
  }
}

std::vector<double> GlbDocument::values(const GlbAccessor& accessor) const {
  const auto width = static_cast<std::size_t>(accessor.num_components);
  const auto size = static_cast<std::size_t>(size_of(accessor.component_type));
  const auto count = static_cast<std::size_t>(accessor.count);
  std::vector<double> result(count * width, 0.0);
  const auto copy = [&](std::size_t element, std::size_t from) {
    for (std::size_t k = 0; k < width; ++k) {
      result[element * width + k] =
          component(from + k * size, accessor.component_type, accessor.is_normalized);
    }
  };
  if (accessor.has_data) {
    for (std::size_t i = 0; i < count; ++i) copy(i, accessor.start + i * accessor.stride);
  }
  for_each_sparse(accessor, copy);
  return result;
}

std::vector<std::uint32_t> GlbDocument::indices(const GlbAccessor& accessor) const {
  if (accessor.component_type == 5126 || accessor.component_type == 5120 ||
      accessor.component_type == 5122) {
    fail(Errc::malformed, "E_HEADER", "indices that are not unsigned whole numbers");
  }
  const int size = size_of(accessor.component_type);
  std::vector<std::uint32_t> result(static_cast<std::size_t>(accessor.count), 0);
  for (std::size_t i = 0; accessor.has_data && i < result.size(); ++i) {
    const std::uint8_t* from = bin_.data() + accessor.start + i * accessor.stride;
    result[i] = static_cast<std::uint32_t>(load_le(from, size));
  }
  for_each_sparse(accessor, [&](std::size_t element, std::size_t from) {
    result[element] = static_cast<std::uint32_t>(load_le(bin_.data() + from, size));
  });
  return result;
}

}  // namespace dupin::detail
