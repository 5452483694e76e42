#include "dupin/io/surface_io.h"

#include <algorithm>
#include <iterator>

#include "dupin/base/error.h"
#include "dupin/io/file.h"
#include "dupin/io/formats.h"
#include "dupin/io/sniff.h"

namespace dupin {
namespace {

using detail::ByteSpan;
using ParseFunction = SurfaceFile (*)(ByteSpan, const std::string&, const ReadOptions&,
                                      const RunControl&);

struct Parser {
  std::string_view format;
  ParseFunction parse;
};

constexpr Parser kParsers[] = {
    {"ply", detail::parse_ply}, {"obj", detail::parse_obj}, {"off", detail::parse_off},
    {"stl", detail::parse_stl}, {"wrl", detail::parse_wrl}, {"abs", detail::parse_abs},
    {"bnt", detail::parse_bnt}, {"xyz", detail::parse_xyz}, {"pts", detail::parse_pts},
    {"pcd", detail::parse_pcd}, {"glb", detail::parse_glb},
};

SurfaceFile parse_content(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                          const RunControl& run) {
  if (bytes.empty()) throw IoError(Errc::malformed, "E_EMPTY", "the file is empty", {name, 0, -1});
  if (const std::string foreign = detail::foreign_format(bytes); !foreign.empty()) {
    throw IoError(Errc::malformed, "E_MAGIC", "not a surface: looks like " + foreign, {name, 0, 0},
                  "surfaces are PLY, OBJ, OFF, STL, WRL, ABS, BNT, GLB, PCD, XYZ and PTS");
  }
  std::string format = detail::format_by_content(bytes);
  if (format.empty()) format = name == "-" ? options.stdin_format : detail::surface_extension(name);
  const auto* const parser = std::find_if(std::begin(kParsers), std::end(kParsers),
                                          [&](const Parser& p) { return p.format == format; });
  if (parser == std::end(kParsers)) {
    throw IoError(Errc::malformed, "E_MAGIC", "the content is of no known surface format",
                  {name, 0, 0},
                  "surfaces are PLY, OBJ, OFF, STL, WRL, ABS, BNT, GLB, PCD, XYZ and PTS");
  }
  return parser->parse(bytes, name, options, run);
}

}  // namespace

SurfaceFile parse_surface(std::span<const std::uint8_t> bytes, const std::string& name,
                          const ReadOptions& options, RunControl run) {
  // Only a name that says so is unpacked: gzip bytes under another name are a mistake. Standard
  // input has no name to contradict.
  if ((name == "-" || detail::ends_with_gz(name)) && bytes.size() >= 2 && bytes[0] == 0x1F &&
      bytes[1] == 0x8B) {
    return parse_content(detail::gunzip(bytes, name, options.limits), name, options, run);
  }
  return parse_content(bytes, name, options, run);
}

SurfaceFile read_surface(const std::string& path, const ReadOptions& options, RunControl run) {
  const FileBytes file = FileBytes::open(path, options.limits, run);
  return file.judge(path, [&] { return parse_surface(file.bytes(), path, options, run); });
}

void write_surface(const std::string& path, const SurfaceOutput& surface, SurfaceFormat format) {
  write_file_atomically(path, format_surface(surface, format));
}

}  // namespace dupin
