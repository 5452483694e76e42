#pragma once

#include <array>
#include <string_view>
#include <variant>

#include "dupin/warp/project.h"

/// Names and ranges of the fields of a project, once for reading, writing and checking.
namespace dupin::detail {

inline constexpr std::size_t kMaxName = 200;
inline constexpr std::size_t kMaxPath = 4096;
inline constexpr std::size_t kMaxProgram = 64;
inline constexpr std::size_t kMaxStages = 1000;
inline constexpr std::size_t kMaxPins = 10000;
inline constexpr std::size_t kMaxLoops = 1000;
inline constexpr double kMaxPlace = 1e6;
inline constexpr double kMaxTurn = 36000.0;

template <class T>
struct Field {
  const char* name;
  std::variant<double T::*, int T::*, bool T::*> member;
  double low;
  double high;
  bool zero = false;  ///< 0 is allowed besides [low, high]
};

inline constexpr std::array<Field<ContourSettings>, 8> kContourFields = {{
    {"alpha_threshold", &ContourSettings::alpha_threshold, 0.0, 0.999999},
    {"keep_holes", &ContourSettings::keep_holes, 0.0, 1.0},
    {"all_components", &ContourSettings::all_components, 0.0, 1.0},
    {"expansion", &ContourSettings::expansion, 0.0, 256.0},
    {"minimum_area", &ContourSettings::minimum_area, 1.0, 1e9},
    {"detail", &ContourSettings::detail, 6.000001, 65536.0},
    {"prominence", &ContourSettings::prominence, 0.0, 1e6},
    {"separation", &ContourSettings::separation, 0.0, 1e6},
}};
inline constexpr std::array<Field<MeshSettings>, 4> kMeshFields = {{
    {"spacing", &MeshSettings::spacing, 0.5, 16384.0, true},
    {"triangles", &MeshSettings::triangles, 16.0, 2e6},
    {"min_angle", &MeshSettings::min_angle, 0.0, 30.0},
    {"smoothing", &MeshSettings::smoothing, 0.0, 1000.0},
}};
inline constexpr std::array<Field<DeformationSettings>, 3> kDeformationFields = {{
    {"alpha", &DeformationSettings::alpha, 0.1, 20.0},
    {"beta", &DeformationSettings::beta, 1.0, 1e6},
    {"iterations", &DeformationSettings::iterations, 0.0, 10000.0},
}};
inline constexpr std::array<Field<WarpImage>, 2> kImageFields = {{
    {"width", &WarpImage::width, 1.0, 32768.0},
    {"height", &WarpImage::height, 1.0, 32768.0},
}};
inline constexpr std::array<Field<WarpPin>, 4> kPinFields = {{
    {"depth", &WarpPin::depth, -1e6, 1e6},
    {"radius", &WarpPin::radius, 0.0, 1e6},
    {"weight", &WarpPin::weight, 1e-6, 1e6},
    {"loop", &WarpPin::loop, 0.0, 999.0},
}};

inline constexpr std::array<std::string_view, 2> kKinds = {"interior", "exterior"};
inline constexpr std::array<std::string_view, 2> kModes = {"coarse", "fine"};
inline constexpr std::array<std::string_view, 2> kSources = {"alpha", "polyline"};
inline constexpr std::array<std::string_view, 3> kMethods = {"arap", "mls", "image-mls"};

/// Why `path` is no path of a picture; "" if it is one.
std::string broken_path(std::string_view path);
/// Whether `text` is 64 lower-case hexadecimal digits.
bool is_sha256(std::string_view text);
/// The canonical text up to the checksum.
std::string project_body(const WarpProject& project);
/// The JSON text without the white space between its tokens: what a checksum is taken of, so that
/// it outlives other line ends and indents. @param text valid JSON
std::string without_space(std::string_view text);

}  // namespace dupin::detail
