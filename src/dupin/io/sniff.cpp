#include "dupin/io/sniff.h"

#include <algorithm>
#include <bit>
#include <string_view>

#include "dupin/io/byte_loads.h"

namespace dupin::detail {
namespace {

constexpr std::size_t kHead = 4096;  // as far as any decision looks

using ByteSpan = std::span<const std::uint8_t>;

std::string_view head_of(ByteSpan bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), kHead)};
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return result;
}

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  return text;
}

std::string_view first_word(std::string_view text) {
  std::size_t size = 0;
  while (size < text.size() && !is_blank(text[size])) ++size;
  return text.substr(0, size);
}

// The text from the first line on that is no '#' comment.
std::string_view skip_comments(std::string_view text) {
  text = trimmed(text);
  while (!text.empty() && text.front() == '#') {
    const std::size_t end = text.find_first_of("\r\n");
    if (end == std::string_view::npos) return {};
    text = trimmed(text.substr(end));
  }
  return text;
}

bool is_exact_binary_stl(ByteSpan bytes) {
  if (bytes.size() < 84) return false;
  const auto count =
      load<std::uint32_t, std::endian::native == std::endian::big>(bytes.data() + 80);
  // 84 bytes of an empty surface look like the start of many a binary file: its name decides.
  return count > 0 && 84 + std::uint64_t{50} * count == bytes.size();
}

bool is_off_word(std::string_view word) {
  for (const std::string_view prefix : {"ST", "C", "N", "4", "n"}) {
    if (word.starts_with(prefix)) word.remove_prefix(prefix.size());
  }
  if (!word.starts_with("OFF")) return false;
  return word.size() == 3 || (word[3] >= '0' && word[3] <= '9');
}

bool is_number_word(std::string_view word) {
  return !word.empty() && word.find_first_of("0123456789") != std::string_view::npos &&
         word.find_first_not_of("0123456789+-.eE,;") == std::string_view::npos;
}

bool is_obj_keyword(std::string_view word) {
  constexpr std::string_view kKeywords[] = {"v", "vt", "vn", "vp",     "f",     "o",
                                            "g", "s",  "l",  "mtllib", "usemtl"};
  return std::find(std::begin(kKeywords), std::end(kKeywords), word) != std::end(kKeywords);
}

}  // namespace

std::string foreign_format(ByteSpan bytes) {
  const std::string_view head = head_of(bytes);
  struct Magic {
    std::string_view bytes;
    const char* name;
  };
  static constexpr Magic kMagics[] = {{"\x1f\x8b", "gzip"},
                                      {"\x89PNG", "a PNG image"},
                                      {"\xff\xd8\xff", "a JPEG image"},
                                      {"GIF8", "a GIF image"},
                                      {"%PDF", "a PDF document"},
                                      {"PK\x03\x04", "a ZIP archive"},
                                      {"BZh", "bzip2"},
                                      {"\xfd"
                                       "7zXZ",
                                       "xz"},
                                      {"7z\xbc\xaf", "a 7z archive"},
                                      {"\x28\xb5\x2f\xfd", "zstd"},
                                      {"\x7f"
                                       "ELF",
                                       "a program"},
                                      {"\x93NUMPY", "a NumPy array"}};
  for (const Magic& magic : kMagics) {
    if (head.starts_with(magic.bytes)) return magic.name;
  }
  std::string_view text = head;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::string start = lower(trimmed(text).substr(0, 16));
  if (start.starts_with("<!doctype html") || start.starts_with("<html")) return "an HTML page";
  if (start.starts_with("<?xml") || start.starts_with("<!doctype")) return "XML";
  return {};
}

std::string format_by_content(ByteSpan bytes) {
  std::string_view head = head_of(bytes);
  if (is_exact_binary_stl(bytes)) return "stl";
  if (head.starts_with("glTF")) return "glb";
  if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
  if (head.starts_with("ply") && (head.size() == 3 || is_blank(head[3]))) return "ply";
  if (head.starts_with("#VRML")) return "wrl";
  if (head.starts_with("# .PCD")) return "pcd";
  const std::string_view text = skip_comments(head);
  const std::string_view word = first_word(text);
  if (is_off_word(word)) return "off";
  if (lower(word) == "solid") return "stl";
  if (word == "VERSION" && text.find("FIELDS") != std::string_view::npos) return "pcd";
  if (is_number_word(word) && lower(first_word(trimmed(text.substr(word.size())))) == "rows") {
    return "abs";
  }
  if (is_obj_keyword(word)) return "obj";
  return {};
}

bool ends_with_gz(const std::string& name) { return lower(name).ends_with(".gz"); }

std::string surface_extension(const std::string& name) {
  std::string text = lower(name);
  if (text.ends_with(".gz")) text.resize(text.size() - 3);
  const std::size_t point = text.find_last_of("./");
  if (point == std::string::npos || text[point] == '/') return {};
  return text.substr(point + 1);
}

}  // namespace dupin::detail
