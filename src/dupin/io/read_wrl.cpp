#include <string_view>

#include "dupin/io/formats.h"
#include "dupin/io/wrl_lexer.h"
#include "dupin/io/wrl_scene.h"

namespace dupin::detail {

// VRML 1.0 (1995 specification) and VRML97 (ISO/IEC 14772-1), the part that describes surfaces.
SurfaceFile parse_wrl(ByteSpan bytes, const std::string& name, const ReadOptions& options,
                      const RunControl& run) {
  SurfaceFile file;
  file.format = "wrl";
  ByteSpan text = bytes;
  if (bytes.size() >= 3 && bytes[0] == 0xEF && bytes[1] == 0xBB && bytes[2] == 0xBF) {
    text = bytes.subspan(3);
    file.warnings.add("W_BOM", "byte 0", "the byte order mark at the start is skipped");
  }
  WrlLexer lexer(text, name);
  const std::string_view head(reinterpret_cast<const char*>(text.data()), text.size());
  const std::string_view magic = "#VRML V";
  if (!head.starts_with(magic)) {
    const bool is_prefix = magic.starts_with(head);
    lexer.fail(Errc::malformed, is_prefix ? "E_TRUNCATED" : "E_MAGIC",
               "a VRML file starts with '#VRML V1.0' or '#VRML V2.0'", 0);
  }
  if (head.size() <= magic.size()) {
    lexer.fail(Errc::malformed, "E_TRUNCATED", "the file ends inside its header", head.size());
  }
  const char version = head[magic.size()];
  if (version != '1' && version != '2') {
    lexer.fail(Errc::malformed, "E_HEADER", "VRML of a version other than 1 or 2", 0);
  }
  WrlScene scene = parse_wrl_scene(lexer, version == '1', options.limits);
  run.report(0.7);
  file.warnings.append(scene.warnings);
  file.mesh = flatten_wrl_scene(scene, lexer, options, file.warnings);
  run.report(1.0);
  return file;
}

}  // namespace dupin::detail
