#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>

#include "dupin/base/error.h"
#include "dupin/warp/json_text.h"
#include "dupin/warp/project.h"
#include "dupin/warp/project_fields.h"
#include "dupin/warp/sha256.h"

namespace dupin {
namespace {

using detail::json_error;
using detail::JsonValue;
using detail::shortest_decimal;
using Eigen::Index;
using Kind = JsonValue::Kind;

void require_kind(const JsonValue& value, Kind kind, const std::string& what) {
  constexpr const char* kNames[] = {"null",     "true or false", "a number",
                                    "a string", "an array",      "an object"};
  if (value.kind != kind)
    throw json_error("E_SYNTAX", what + " is not " + kNames[static_cast<std::size_t>(kind)],
                     value.line);
}

const JsonValue& require_member(const JsonValue& object, const char* name,
                                const std::string& where) {
  const JsonValue* member = object.find(name);
  if (member == nullptr)
    throw json_error("E_SYNTAX", where + " has no \"" + name + "\"", object.line);
  return *member;
}

double number_in(const JsonValue& value, double low, double high, const std::string& what) {
  require_kind(value, Kind::number, what);
  if (!(value.number >= low && value.number <= high))
    throw json_error("E_NUMBER_RANGE",
                     what + " is " + shortest_decimal(value.number) + ", not in [" +
                         shortest_decimal(low) + ", " + shortest_decimal(high) + "]",
                     value.line);
  return value.number;
}

std::string text_of(const JsonValue& value, std::size_t max_bytes, const std::string& what) {
  require_kind(value, Kind::string, what);
  if (value.text.size() > max_bytes)
    throw json_error("E_SYNTAX", what + " is longer than " + std::to_string(max_bytes) + " bytes",
                     value.line);
  if (!detail::is_plain_text(value.text))
    throw json_error("E_SYNTAX", what + " has a control character", value.line);
  return value.text;
}

template <class Enum, std::size_t N>
void read_choice(const JsonValue& object, const char* name,
                 const std::array<std::string_view, N>& names, const std::string& where,
                 Enum& choice) {
  const JsonValue* value = object.find(name);
  if (value == nullptr) return;
  require_kind(*value, Kind::string, where + "." + name);
  const auto found = std::find(names.begin(), names.end(), value->text);
  if (found == names.end()) {
    std::string list;
    for (const std::string_view each : names)
      list += (list.empty() ? "" : ", ") + std::string(each);
    throw json_error(
        "E_SYNTAX", where + "." + name + " is \"" + escaped(value->text) + "\", not one of " + list,
        value->line);
  }
  choice = static_cast<Enum>(found - names.begin());
}

template <class T>
void read_field(const JsonValue& value, const detail::Field<T>& field, const std::string& where,
                T& object) {
  const std::string what = where + "." + field.name;
  if (const auto* flag = std::get_if<bool T::*>(&field.member)) {
    require_kind(value, Kind::boolean, what);
    object.*(*flag) = value.truth;
    return;
  }
  require_kind(value, Kind::number, what);
  const bool is_zero = field.zero && value.number == 0.0;
  const double number = is_zero ? 0.0 : number_in(value, field.low, field.high, what);
  if (const auto* real = std::get_if<double T::*>(&field.member)) {
    object.*(*real) = number;
    return;
  }
  if (number != std::floor(number))
    throw json_error("E_NUMBER_RANGE", what + " is not a whole number", value.line);
  object.*std::get<int T::*>(field.member) = static_cast<int>(number);
}

// Every member of `object` is one of `fields`, which are read, or of `others`.
template <class T, class Fields>
void read_fields(const JsonValue& json, const Fields& fields,
                 std::initializer_list<std::string_view> others, const std::string& where,
                 T& object) {
  require_kind(json, Kind::object, where);
  for (std::size_t i = 0; i < json.items.size(); ++i) {
    const std::string& name = json.names[i];
    const JsonValue& value = json.items[i];
    const auto field = std::find_if(fields.begin(), fields.end(),
                                    [&](const auto& each) { return each.name == name; });
    if (field != fields.end()) {
      read_field(value, *field, where, object);
    } else if (std::find(others.begin(), others.end(), name) == others.end()) {
      throw json_error("E_SYNTAX", where + " has no field \"" + escaped(name) + "\"", value.line,
                       "a field that this version does not know may mean a different picture");
    }
  }
}

Eigen::RowVector2d place_of(const JsonValue& value, const std::string& what) {
  require_kind(value, Kind::array, what);
  if (value.items.size() != 2)
    throw json_error("E_SYNTAX", what + " is not a place [x, y]", value.line);
  Eigen::RowVector2d place;
  for (Index k = 0; k < 2; ++k) {
    place(k) = number_in(value.items[static_cast<std::size_t>(k)], -detail::kMaxPlace,
                         detail::kMaxPlace, what);
  }
  return place;
}

WarpPin pin_of(const JsonValue& json) {
  WarpPin pin;
  read_fields(json, detail::kPinFields, {"name", "kind", "source", "target", "rotation"}, "pin",
              pin);
  if (const JsonValue* name = json.find("name"))
    pin.name = text_of(*name, detail::kMaxName, "pin.name");
  read_choice(json, "kind", detail::kKinds, "pin", pin.kind);
  pin.source = place_of(require_member(json, "source", "the pin"), "pin.source");
  pin.target = place_of(require_member(json, "target", "the pin"), "pin.target");
  const JsonValue* rotation = json.find("rotation");
  if (rotation != nullptr && rotation->kind != Kind::null)
    pin.rotation_deg = number_in(*rotation, -detail::kMaxTurn, detail::kMaxTurn, "pin.rotation");
  return pin;
}

void require_count(std::size_t count, std::size_t limit, const char* what, std::int64_t line) {
  if (count <= limit) return;
  throw IoError(Errc::over_limit, "E_TOO_LARGE",
                std::to_string(count) + " " + what + ", the limit is " + std::to_string(limit),
                {.file = {}, .line = line, .byte = -1});
}

std::vector<WarpPin> pins_of(const JsonValue& json, std::size_t limit) {
  require_kind(json, Kind::array, "the list of pins");
  require_count(json.items.size(), limit, "pins", json.line);
  std::vector<WarpPin> pins;
  std::set<std::pair<PinKind, std::string>> names;
  for (const JsonValue& item : json.items) {
    pins.push_back(pin_of(item));
    const WarpPin& pin = pins.back();
    if (!pin.name.empty() && !names.emplace(pin.kind, pin.name).second)
      throw json_error("E_SYNTAX", "two pins are called \"" + escaped(pin.name) + "\"", item.line);
  }
  return pins;
}

WarpImage image_of(const JsonValue& json) {
  WarpImage image;
  read_fields(json, detail::kImageFields, {"path", "sha256"}, "image", image);
  for (const auto& field : detail::kImageFields) require_member(json, field.name, "image");
  const JsonValue& path = require_member(json, "path", "image");
  image.path = text_of(path, detail::kMaxPath, "image.path");
  if (const std::string why = detail::broken_path(image.path); !why.empty())
    throw json_error("E_SYNTAX", "image.path " + why, path.line);
  const JsonValue& hash = require_member(json, "sha256", "image");
  image.sha256 = text_of(hash, 64, "image.sha256");
  if (!detail::is_sha256(image.sha256))
    throw json_error("E_SYNTAX", "image.sha256 is not 64 lower-case hexadecimal digits", hash.line);
  return image;
}

std::vector<Points2> loops_of(const JsonValue& json) {
  require_kind(json, Kind::array, "the list of loops");
  require_count(json.items.size(), detail::kMaxLoops, "loops", json.line);
  if (json.items.empty()) throw json_error("E_SYNTAX", "the list of loops is empty", json.line);
  std::vector<Points2> loops;
  for (const JsonValue& item : json.items) {
    require_kind(item, Kind::array, "a loop");
    if (item.items.size() < 3)
      throw json_error("E_SYNTAX", "a loop has fewer than three corners", item.line);
    Points2 loop(static_cast<Index>(item.items.size()), 2);
    for (Index i = 0; i < loop.rows(); ++i)
      loop.row(i) = place_of(item.items[static_cast<std::size_t>(i)], "a corner of a loop");
    loops.push_back(std::move(loop));
  }
  return loops;
}

ContourSettings contour_of(const JsonValue& json) {
  ContourSettings contour;
  read_fields(json, detail::kContourFields, {"source", "loops"}, "contour", contour);
  read_choice(json, "source", detail::kSources, "contour", contour.source);
  const JsonValue* loops = json.find("loops");
  if ((contour.source == ContourSource::polyline) != (loops != nullptr))
    throw json_error("E_SYNTAX", "contour.loops belong to the source polyline, and to it only",
                     json.line);
  if (loops != nullptr) contour.loops = loops_of(*loops);
  return contour;
}

std::vector<WarpStage> stages_of(const JsonValue& json) {
  require_kind(json, Kind::array, "stages");
  require_count(json.items.size(), detail::kMaxStages, "stages", json.line);
  std::vector<WarpStage> stages;
  std::size_t room = detail::kMaxPins;
  for (const JsonValue& item : json.items) {
    WarpStage stage;
    read_fields(item, std::array<detail::Field<WarpStage>, 0>{}, {"mode", "pins"}, "stage", stage);
    require_member(item, "mode", "the stage");
    read_choice(item, "mode", detail::kModes, "stage", stage.mode);
    stage.pins = pins_of(require_member(item, "pins", "the stage"), room);
    room -= stage.pins.size();
    stages.push_back(std::move(stage));
  }
  return stages;
}

void require_version(const JsonValue& root) {
  const JsonValue* format = root.find("format");
  if (root.kind != Kind::object || format == nullptr || format->kind != Kind::string ||
      format->text != "dwarp")
    throw json_error("E_MAGIC", "not a warp project: \"format\" is not \"dwarp\"", root.line);
  const JsonValue& version = require_member(root, "version", "the project");
  const double number = number_in(version, 1.0, 1e9, "version");
  if (number != std::floor(number))
    throw json_error("E_NUMBER_RANGE", "version is not a whole number", version.line);
  if (number > kWarpProjectVersion)
    throw json_error("E_VERSION",
                     "a project of version " + shortest_decimal(number) + "; this program knows " +
                         std::to_string(kWarpProjectVersion),
                     version.line, "a newer program can read it");
}

// The text counts, not what this program makes of it: a project stays whole when a later program
// knows more fields.
void require_checksum(const JsonValue& root, std::string_view text) {
  const JsonValue* checksum = root.find("checksum");
  if (checksum == nullptr) return;
  require_kind(*checksum, Kind::string, "checksum");
  const std::string written =
      detail::without_space(text.substr(std::min(text.find('{'), text.size())));
  const std::string end = ",\"checksum\":\"" + checksum->text + "\"}";
  if (!written.ends_with(end))
    throw json_error("E_SYNTAX", "the checksum is not the last member of the project",
                     checksum->line);
  if (checksum->text !=
      sha256_hex(std::string_view(written).substr(0, written.size() - end.size())))
    throw json_error("E_CRC", "the project was changed after it was written", checksum->line,
                     "take the line \"checksum\" out after editing by hand");
}

}  // namespace

WarpProject parse_project(std::string_view text) {
  const JsonValue root = detail::parse_json(text);
  require_version(root);
  WarpProject project;
  read_fields(root, std::array<detail::Field<WarpProject>, 0>{},
              {"format", "version", "program", "image", "contour", "mesh", "deformation", "stages",
               "checksum"},
              "the project", project);
  if (const JsonValue* program = root.find("program"))
    project.program = text_of(*program, detail::kMaxProgram, "program");
  project.image = image_of(require_member(root, "image", "the project"));
  if (const JsonValue* contour = root.find("contour")) project.contour = contour_of(*contour);
  if (const JsonValue* mesh = root.find("mesh"))
    read_fields(*mesh, detail::kMeshFields, {}, "mesh", project.mesh);
  if (const JsonValue* deformation = root.find("deformation")) {
    read_fields(*deformation, detail::kDeformationFields, {"method"}, "deformation",
                project.deformation);
    read_choice(*deformation, "method", detail::kMethods, "deformation",
                project.deformation.method);
  }
  if (const JsonValue* stages = root.find("stages")) project.stages = stages_of(*stages);
  require_checksum(root, text);
  return project;
}

std::vector<Points2> parse_loops(std::string_view text) {
  JsonValue root = detail::parse_json(text);
  const auto is_array = [](const JsonValue& value) { return value.kind == Kind::array; };
  const bool is_one = is_array(root) && !root.items.empty() && is_array(root.items[0]) &&
                      !root.items[0].items.empty() && !is_array(root.items[0].items[0]);
  if (!is_one) return loops_of(root);
  JsonValue list;
  list.kind = Kind::array;
  list.items.push_back(std::move(root));
  return loops_of(list);
}

std::vector<WarpPin> parse_pins(std::string_view text) {
  return pins_of(detail::parse_json(text), detail::kMaxPins);
}

}  // namespace dupin
