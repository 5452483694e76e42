#include "dupin/io/ply_header.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include "dupin/io/text_scanner.h"

namespace dupin::detail {
namespace {

// Far above any real file; they keep the search for repeated names short.
constexpr std::size_t kMaxElements = 256;
constexpr std::size_t kMaxProperties = 1024;

constexpr std::string_view kEndHeader = "end_header";

std::optional<PlyType> type_of(std::string_view word) {
  struct Name {
    std::string_view name;
    PlyType type;
  };
  static constexpr Name kNames[] = {
      {"char", PlyType::i8},    {"int8", PlyType::i8},     {"uchar", PlyType::u8},
      {"uint8", PlyType::u8},   {"short", PlyType::i16},   {"int16", PlyType::i16},
      {"ushort", PlyType::u16}, {"uint16", PlyType::u16},  {"int", PlyType::i32},
      {"int32", PlyType::i32},  {"uint", PlyType::u32},    {"uint32", PlyType::u32},
      {"float", PlyType::f32},  {"float32", PlyType::f32}, {"double", PlyType::f64},
      {"float64", PlyType::f64}};
  for (const Name& entry : kNames) {
    if (entry.name == word) return entry.type;
  }
  return std::nullopt;
}

bool is_line_end(char c) { return c == '\n' || c == '\r'; }

// Where the header line "end_header" ends (behind its line end), or nothing if it is not there.
std::optional<std::size_t> find_body(std::string_view text) {
  // Whether "\r" alone ends lines is decided by the first one: behind the last, a "\n" may
  // already belong to a binary body.
  const std::size_t first_end = text.find_first_of("\r\n");
  if (first_end == std::string_view::npos) return std::nullopt;
  const bool is_cr_only =
      text[first_end] == '\r' && (first_end + 1 >= text.size() || text[first_end + 1] != '\n');
  for (std::size_t at = text.find(kEndHeader); at != std::string_view::npos;
       at = text.find(kEndHeader, at + 1)) {
    if (at == 0 || !is_line_end(text[at - 1])) continue;
    std::size_t end = at + kEndHeader.size();
    while (end < text.size() && (text[end] == ' ' || text[end] == '\t')) ++end;
    if (end == text.size()) return std::nullopt;
    if (!is_line_end(text[end])) continue;
    if (text[end] == '\n' || is_cr_only) return end + 1;
    // "\r\n", or its first half at the end of a truncated file.
    if (end + 1 == text.size()) return std::nullopt;
    return text[end + 1] == '\n' ? end + 2 : end + 1;
  }
  return std::nullopt;
}

[[noreturn]] void fail_header(const TextScanner& scanner, const std::string& message) {
  scanner.fail(Errc::malformed, "E_HEADER", message);
}

std::string_view header_word(TextScanner& scanner, const char* what) {
  if (scanner.at_line_end()) fail_header(scanner, std::string("expected ") + what);
  return scanner.word(what);
}

PlyType header_type(TextScanner& scanner) {
  const std::string_view word = header_word(scanner, "a type");
  const std::optional<PlyType> type = type_of(word);
  if (!type) fail_header(scanner, "unknown type '" + escaped(word, 40) + "'");
  return *type;
}

PlyEncoding parse_encoding(TextScanner& scanner) {
  const std::string_view word = header_word(scanner, "a format");
  const std::string_view version = header_word(scanner, "a version");
  if (version != "1.0") fail_header(scanner, "unknown version '" + escaped(version, 40) + "'");
  if (word == "ascii") return PlyEncoding::ascii;
  if (word == "binary_little_endian") return PlyEncoding::little_endian;
  if (word == "binary_big_endian") return PlyEncoding::big_endian;
  fail_header(scanner, "unknown format '" + escaped(word, 40) + "'");
}

PlyElement parse_element(TextScanner& scanner, const PlyHeader& header) {
  PlyElement element;
  element.name = header_word(scanner, "an element name");
  element.line = scanner.line();
  if (scanner.at_line_end()) fail_header(scanner, "expected a count of elements");
  element.count = scanner.count("the count of elements");
  if (header.elements.size() == kMaxElements) fail_header(scanner, "too many elements");
  for (const PlyElement& other : header.elements) {
    if (other.name == element.name) {
      fail_header(scanner, "element '" + escaped(element.name, 40) + "' twice");
    }
  }
  return element;
}

PlyProperty parse_property(TextScanner& scanner, const PlyElement& element) {
  PlyProperty property;
  if (scanner.peek_word() == "list") {
    scanner.word("list");
    property.is_list = true;
    property.count_type = header_type(scanner);
    if (property.count_type == PlyType::f32 || property.count_type == PlyType::f64) {
      scanner.fail(Errc::malformed, "E_LIST_COUNT", "the count of a list cannot be fractional");
    }
  }
  property.type = header_type(scanner);
  property.name = header_word(scanner, "a property name");
  if (element.properties.size() == kMaxProperties) fail_header(scanner, "too many properties");
  if (element.find(property.name.c_str()) >= 0) {
    fail_header(scanner, "property '" + escaped(property.name, 40) + "' twice");
  }
  return property;
}

}  // namespace

std::int64_t size_of(PlyType type) {
  constexpr std::int64_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

std::ptrdiff_t PlyElement::find(const char* property) const {
  const auto found = std::find_if(properties.begin(), properties.end(),
                                  [&](const PlyProperty& p) { return p.name == property; });
  return found == properties.end() ? -1 : found - properties.begin();
}

std::int64_t PlyElement::least_binary_bytes() const {
  std::int64_t bytes = 0;
  for (const PlyProperty& p : properties) bytes += size_of(p.is_list ? p.count_type : p.type);
  return bytes;
}

// A digit and a blank or line end each.
std::int64_t PlyElement::least_ascii_bytes() const {
  return 2 * static_cast<std::int64_t>(properties.size());
}

bool PlyElement::has_lists() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& p) { return p.is_list; });
}

PlyHeader parse_ply_header(std::span<const std::uint8_t> bytes, const std::string& name,
                           const ReadLimits& limits) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::optional<std::size_t> body = find_body(text);
  // Without an end, the last line may be cut and is not judged.
  const std::size_t last_line_end = text.find_last_of("\r\n");
  const std::size_t size =
      body ? *body : (last_line_end == std::string_view::npos ? 0 : last_line_end + 1);
  TextScanner scanner(bytes.first(size), name, limits);
  PlyHeader header;
  header.has_bom = scanner.has_bom();
  const std::string_view magic = text.substr(header.has_bom ? 3 : 0, 4);
  const bool is_ply = magic.starts_with("ply") && (magic.size() == 3 || is_line_end(magic[3]) ||
                                                   magic[3] == ' ' || magic[3] == '\t');
  if (!is_ply && !std::string_view("ply").starts_with(magic)) {
    throw IoError(Errc::malformed, "E_MAGIC", "not a PLY file: it does not begin with 'ply'",
                  {name, 1, 0});
  }
  bool has_format = false;
  bool has_ended = false;
  if (scanner.next_line()) scanner.rest_of_line();
  while (!has_ended && scanner.next_line()) {
    const std::string_view keyword = scanner.word("a keyword");
    if (keyword == "comment" || keyword == "obj_info") {
      scanner.rest_of_line();
      continue;
    }
    if (keyword == "format") {
      if (has_format) fail_header(scanner, "format twice");
      header.encoding = parse_encoding(scanner);
      has_format = true;
    } else if (keyword == "element") {
      header.elements.push_back(parse_element(scanner, header));
    } else if (keyword == "property") {
      if (header.elements.empty()) fail_header(scanner, "a property before any element");
      PlyElement& element = header.elements.back();
      element.properties.push_back(parse_property(scanner, element));
    } else if (keyword == kEndHeader) {
      has_ended = true;
    } else {
      fail_header(scanner, "unknown keyword '" + escaped(keyword, 40) + "'");
    }
    if (!scanner.at_line_end()) {
      fail_header(scanner, "unexpected '" + escaped(scanner.peek_word(), 40) + "'");
    }
  }
  if (!has_ended || !body) {
    scanner.fail(Errc::malformed, "E_TRUNCATED", "the file ends within the header");
  }
  if (!has_format) fail_header(scanner, "no format");
  header.body = size;
  header.first_line = scanner.line() + 1;
  return header;
}

}  // namespace dupin::detail
