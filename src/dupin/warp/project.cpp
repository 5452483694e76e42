#include "dupin/warp/project.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "dupin/base/error.h"
#include "dupin/warp/json_text.h"
#include "dupin/warp/project_fields.h"
#include "dupin/warp/sha256.h"

namespace dupin {
namespace {

using detail::quoted;
using detail::shortest_decimal;
using Eigen::Index;

template <class T>
double value_of(const T& object, const detail::Field<T>& field) {
  return std::visit([&](auto member) { return static_cast<double>(object.*member); }, field.member);
}

template <class T, class Fields>
std::string fields_text(const T& object, const Fields& fields) {
  std::string text;
  for (const auto& field : fields) {
    if (!text.empty()) text += ", ";
    text += quoted(field.name) + ": ";
    const double value = value_of(object, field);
    if (std::holds_alternative<bool T::*>(field.member)) {
      text += value == 0.0 ? "false" : "true";
    } else {
      text += shortest_decimal(value);
    }
  }
  return text;
}

std::string place_text(double x, double y) {
  return "[" + shortest_decimal(x) + ", " + shortest_decimal(y) + "]";
}

std::string pin_text(const WarpPin& pin) {
  std::string text = "{\"name\": " + quoted(pin.name) +
                     ", \"kind\": " + quoted(detail::kKinds[static_cast<std::size_t>(pin.kind)]) +
                     ", \"source\": " + place_text(pin.source.x(), pin.source.y()) +
                     ", \"target\": " + place_text(pin.target.x(), pin.target.y());
  if (pin.rotation_deg) text += ", \"rotation\": " + shortest_decimal(*pin.rotation_deg);
  return text + ", " + fields_text(pin, detail::kPinFields) + "}";
}

std::string loops_text(const std::vector<Points2>& loops) {
  std::string text;
  for (const Points2& loop : loops) {
    text += text.empty() ? "\n      [" : ",\n      [";
    for (Index i = 0; i < loop.rows(); ++i)
      text += (i > 0 ? ", " : "") + place_text(loop(i, 0), loop(i, 1));
    text += "]";
  }
  return text;
}

std::string stage_text(const WarpStage& stage) {
  std::string text = "    {\"mode\": ";
  text += quoted(detail::kModes[static_cast<std::size_t>(stage.mode)]) + ", \"pins\": [";
  for (std::size_t i = 0; i < stage.pins.size(); ++i)
    text += (i > 0 ? ",\n      " : "\n      ") + pin_text(stage.pins[i]);
  return text + (stage.pins.empty() ? "]}" : "\n    ]}");
}

// NaN is asked for first: an ordered comparison with it is an invalid operation.
bool is_within(double value, double low, double high) {
  return std::isfinite(value) && value >= low && value <= high;
}

template <class T, class Fields>
void require_fields(const T& object, const Fields& fields, const std::string& where) {
  for (const auto& field : fields) {
    const double value = value_of(object, field);
    if (is_within(value, field.low, field.high) || (field.zero && value == 0.0)) continue;
    throw InvalidArgument(where + "." + field.name + " is not in [" + shortest_decimal(field.low) +
                          ", " + shortest_decimal(field.high) + "]" +
                          (field.zero ? " and not 0" : ""));
  }
}

void require_place(double x, double y, const std::string& where) {
  const double limit = detail::kMaxPlace;
  if (!is_within(x, -limit, limit) || !is_within(y, -limit, limit))
    throw InvalidArgument(where + " is not within 1e6 pixels");
}

void require_pin(const WarpPin& pin, const std::string& where) {
  if (pin.name.size() > detail::kMaxName || !detail::is_plain_text(pin.name))
    throw InvalidArgument(where + ".name is longer than 200 bytes or no plain UTF-8");
  if (static_cast<std::size_t>(pin.kind) >= detail::kKinds.size())
    throw InvalidArgument(where + ".kind is not one that is known");
  require_place(pin.source.x(), pin.source.y(), where + ".source");
  require_place(pin.target.x(), pin.target.y(), where + ".target");
  if (pin.rotation_deg && !is_within(*pin.rotation_deg, -detail::kMaxTurn, detail::kMaxTurn))
    throw InvalidArgument(where + ".rotation is not within 36000 degrees");
  require_fields(pin, detail::kPinFields, where);
}

void require_contour(const ContourSettings& contour) {
  require_fields(contour, detail::kContourFields, "contour");
  const bool drawn = contour.source == ContourSource::polyline;
  if (static_cast<std::size_t>(contour.source) >= detail::kSources.size())
    throw InvalidArgument("contour.source is not one that is known");
  if (drawn == contour.loops.empty())
    throw InvalidArgument("contour.loops belong to the source polyline, and to it only");
  if (contour.loops.size() > detail::kMaxLoops)
    throw InvalidArgument("contour.loops are more than 1000");
  for (std::size_t l = 0; l < contour.loops.size(); ++l) {
    const std::string where = "contour.loops[" + std::to_string(l) + "]";
    if (contour.loops[l].rows() < 3) throw InvalidArgument(where + " has fewer than three corners");
    for (Index i = 0; i < contour.loops[l].rows(); ++i)
      require_place(contour.loops[l](i, 0), contour.loops[l](i, 1), where);
  }
}

}  // namespace

namespace detail {

bool is_sha256(std::string_view text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::string broken_path(std::string_view path) {
  if (path.empty()) return "is empty";
  if (path.size() > kMaxPath) return "is longer than 4096 bytes";
  if (!is_plain_text(path)) return "is no plain UTF-8";
  if (path[0] == '/' || path.find('\\') != std::string_view::npos || path.find(':') == 1)
    return "is not relative with \"/\" between folders";
  return "";
}

std::string project_body(const WarpProject& project) {
  const ContourSettings& contour = project.contour;
  std::string text = "{\n  \"format\": \"dwarp\",\n  \"version\": ";
  text += std::to_string(kWarpProjectVersion) + ",\n  \"program\": " + quoted(project.program);
  text += ",\n  \"image\": {\"path\": " + quoted(project.image.path) +
          ", \"sha256\": " + quoted(project.image.sha256) + ", " +
          fields_text(project.image, kImageFields) + "}";
  text += ",\n  \"contour\": {\"source\": " +
          quoted(kSources[static_cast<std::size_t>(contour.source)]) + ", " +
          fields_text(contour, kContourFields);
  if (!contour.loops.empty()) text += ", \"loops\": [" + loops_text(contour.loops) + "]";
  text += "},\n  \"mesh\": {" + fields_text(project.mesh, kMeshFields) + "}";
  text += ",\n  \"deformation\": {\"method\": " +
          quoted(kMethods[static_cast<std::size_t>(project.deformation.method)]) + ", " +
          fields_text(project.deformation, kDeformationFields) + "}";
  text += ",\n  \"stages\": [";
  for (std::size_t i = 0; i < project.stages.size(); ++i)
    text += (i > 0 ? ",\n" : "\n") + stage_text(project.stages[i]);
  return text + (project.stages.empty() ? "]" : "\n  ]");
}

std::string without_space(std::string_view text) {
  std::string result;
  bool is_in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (!is_in_string && (c == ' ' || c == '\t' || c == '\n' || c == '\r')) continue;
    result += c;
    if (is_in_string && c == '\\' && i + 1 < text.size()) {
      result += text[++i];
    } else if (c == '"') {
      is_in_string = !is_in_string;
    }
  }
  return result;
}

}  // namespace detail

bool ContourSettings::operator==(const ContourSettings& other) const {
  const auto scalars_equal = [&](const auto& field) {
    return value_of(*this, field) == value_of(other, field);
  };
  const auto same_loop = [](const Points2& a, const Points2& b) {
    return a.rows() == b.rows() && a == b;
  };
  return source == other.source &&
         std::all_of(detail::kContourFields.begin(), detail::kContourFields.end(), scalars_equal) &&
         std::equal(loops.begin(), loops.end(), other.loops.begin(), other.loops.end(), same_loop);
}

void validate(const WarpProject& project) {
  if (project.program.size() > detail::kMaxProgram || !detail::is_plain_text(project.program))
    throw InvalidArgument("program is longer than 64 bytes or no plain UTF-8");
  if (const std::string why = detail::broken_path(project.image.path); !why.empty())
    throw InvalidArgument("image.path " + why);
  if (!detail::is_sha256(project.image.sha256))
    throw InvalidArgument("image.sha256 is not 64 lower-case hexadecimal digits");
  require_fields(project.image, detail::kImageFields, "image");
  require_contour(project.contour);
  require_fields(project.mesh, detail::kMeshFields, "mesh");
  require_fields(project.deformation, detail::kDeformationFields, "deformation");
  if (static_cast<std::size_t>(project.deformation.method) >= detail::kMethods.size())
    throw InvalidArgument("deformation.method is not one that is known");
  if (project.stages.size() > detail::kMaxStages)
    throw InvalidArgument("stages are more than 1000");
  std::size_t num_pins = 0;
  for (std::size_t s = 0; s < project.stages.size(); ++s) {
    const WarpStage& stage = project.stages[s];
    const std::string where = "stages[" + std::to_string(s) + "]";
    if (static_cast<std::size_t>(stage.mode) >= detail::kModes.size())
      throw InvalidArgument(where + ".mode is not one that is known");
    std::set<std::pair<PinKind, std::string>> names;
    num_pins += stage.pins.size();
    if (num_pins > detail::kMaxPins) throw InvalidArgument("pins are more than 10000");
    for (std::size_t i = 0; i < stage.pins.size(); ++i) {
      const WarpPin& pin = stage.pins[i];
      require_pin(pin, where + ".pins[" + std::to_string(i) + "]");
      if (!pin.name.empty() && !names.emplace(pin.kind, pin.name).second)
        throw InvalidArgument(where + ": two pins are called \"" + escaped(pin.name) + "\"");
    }
  }
}

std::string format_project(const WarpProject& project) {
  validate(project);
  const std::string body = detail::project_body(project);
  std::string text = body + ",\n  \"checksum\": ";
  text += quoted(sha256_hex(detail::without_space(body))) + "\n}\n";
  try {
    detail::parse_json(text);
  } catch (const IoError& error) {
    throw IoError(error.errc(), error.code(),
                  std::string("the project would be too large to be read again: ") + error.what(),
                  {}, "fewer corners of loops, or fewer pins");
  }
  return text;
}

void require_image(const WarpProject& project, std::span<const std::uint8_t> file_bytes) {
  if (sha256_hex(file_bytes) == project.image.sha256) return;
  throw AnalysisError(
      "E_IMAGE_CHANGED",
      "\"" + escaped(project.image.path) + "\" is not the picture that the project was made for",
      "make a new project, or give it the picture with this SHA-256: " + project.image.sha256);
}

}  // namespace dupin
