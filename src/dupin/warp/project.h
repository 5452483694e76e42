#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dupin/warp/planar_mesh.h"

namespace dupin {

/// All positions are pixels of the picture, x right, y down, pixel centres at .5. The comments give
/// the range that parse_project() and format_project() accept.

enum class PinKind : std::uint8_t {
  interior,  ///< a control point on the shape (thesis 7.3.1)
  exterior   ///< a vertex of the control polyline around it (7.3.5)
};

struct WarpPin {
  std::string name;  ///< at most 200 bytes; "" or one of its kind in its stage
  PinKind kind = PinKind::interior;
  Eigen::RowVector2d source = Eigen::RowVector2d::Zero();  ///< [px] +-1e6
  Eigen::RowVector2d target = Eigen::RowVector2d::Zero();  ///< [px] +-1e6
  std::optional<double> rotation_deg;  ///< +-36000, x towards y; absent: the deformation decides
  double depth = 0.0;                  ///< +-1e6, larger is nearer to the viewer
  double radius = 0.0;                 ///< [px] 0 to 1e6, held rigid about the pin
  double weight = 1.0;                 ///< 1e-6 to 1e6 [-]
  int loop = 0;                        ///< (exterior) its closed control polygon, 0 to 999

  bool operator==(const WarpPin&) const = default;
};

enum class StageMode : std::uint8_t { coarse, fine };

/// One step of the edit. Its sources lie on the shape as the stages before left it (7.4.4: P := Q),
/// so that the list, not the last pins, is the edit.
struct WarpStage {
  StageMode mode = StageMode::coarse;
  std::vector<WarpPin> pins;

  bool operator==(const WarpStage&) const = default;
};

enum class ContourSource : std::uint8_t { alpha, polyline };

struct ContourSettings {
  ContourSource source = ContourSource::alpha;
  double alpha_threshold = 0.5;  ///< (alpha) 0 to 0.999999, inside where alpha is above that
  bool keep_holes = true;        ///< (alpha)
  bool all_components = false;   ///< (alpha) false: the largest only, as the thesis
  double expansion = 2.0;        ///< (alpha) [px] 0 to 256, outward, as in ShapeOptions
  double minimum_area = 16.0;    ///< (alpha) [px^2] 1 to 1e9, of a part and of a hole
  double detail = 60.0;          ///< beta of Eq. 7.36 ff., above 6 to 65536: sigma = I / beta
  double prominence = 0.0;       ///< 0 to 1e6 [-]; 0: from the noise of the contour
  double separation = 0.0;       ///< [px] 0 to 1e6; 0: from the scale
  std::vector<Points2> loops;    ///< (polyline) drawn by the user, at least three corners each

  bool operator==(const ContourSettings& other) const;
};

struct MeshSettings {
  double spacing = 0.0;     ///< [px] 0 or 0.5 to 16384; 0: from `triangles` and the area
  int triangles = 2500;     ///< wanted, where spacing is 0; 16 to 2000000
  double min_angle = 25.0;  ///< [deg] 0 to 30
  int smoothing = 3;        ///< rounds, 0 to 1000

  bool operator==(const MeshSettings&) const = default;
};

enum class WarpMethod : std::uint8_t { arap, mls, image_mls };

struct DeformationSettings {
  WarpMethod method = WarpMethod::arap;
  double alpha = 2.0;   ///< theta = d^-alpha, 0.1 to 20
  double beta = 4.0;    ///< weight of vertices at pins, 1 to 1e6
  int iterations = 10;  ///< 0 to 10000

  bool operator==(const DeformationSettings&) const = default;
};

struct WarpImage {
  std::string path;    ///< relative to the project file, "/" between folders, at most 4096 bytes
  std::string sha256;  ///< of the bytes of the file, 64 lower-case digits
  int width = 0;       ///< [px] 1 to 32768
  int height = 0;      ///< [px] 1 to 32768

  bool operator==(const WarpImage&) const = default;
};

/// What a .dwarp file holds: all that decides the warped picture.
struct WarpProject {
  std::string program;  ///< version of the program that made it, at most 64 bytes
  WarpImage image;
  ContourSettings contour;
  MeshSettings mesh;
  DeformationSettings deformation;
  std::vector<WarpStage> stages;  ///< at most 1000, with 10000 pins in all

  bool operator==(const WarpProject&) const = default;
};

inline constexpr int kWarpProjectVersion = 1;

/// Reads a .dwarp text (docs/guide/dwarp.md). Absent settings have the defaults above; a name that
/// is not known is an error, since it may mean a different picture.
/// @throws IoError with the line. malformed: E_EMPTY, E_SYNTAX, E_TRUNCATED, E_NUMBER_RANGE,
///   E_MAGIC not a project, E_VERSION newer than this program, E_CRC changed since it was written;
///   over_limit: E_NESTING, E_TOO_LARGE.
/// Cost: O(bytes), at most 16 MiB.
WarpProject parse_project(std::string_view text);

/// The canonical text: the same bytes for equal projects, numbers as short as they read back, a
/// checksum last. parse_project(format_project(p)) == p.
/// @throws InvalidArgument naming the field that is out of its range
/// @throws IoError E_TOO_LARGE (over_limit) for more than parse_project() would read, which is
/// about
///   99,900 corners of loops
std::string format_project(const WarpProject& project);

/// Reads closed polylines: `[[[x, y], ...], ...]`, or one alone.
/// @throws IoError as parse_project()
std::vector<Points2> parse_loops(std::string_view text);

/// Reads a PINS.json: an array of pins as in a stage of a project, of which only `source` and
/// `target` must be there. @throws IoError as parse_project()
std::vector<WarpPin> parse_pins(std::string_view text);

/// Throws unless `file_bytes` are those of the picture the project was made for.
/// @throws AnalysisError E_IMAGE_CHANGED. Cost: O(bytes).
void require_image(const WarpProject& project, std::span<const std::uint8_t> file_bytes);

/// @throws InvalidArgument naming the first field outside the range stated above
void validate(const WarpProject& project);

}  // namespace dupin
