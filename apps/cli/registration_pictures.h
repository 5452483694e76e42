#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/registration/register.h"
#include "dupin/render/camera.h"
#include "dupin/render/scene.h"
#include "html_report.h"
#include "surface_input.h"

namespace dupin::cli {

/// A picture before it is drawn.
struct RegistrationPicture {
  Scene scene;
  Camera camera;
  std::string alt;
  std::string caption;
};

/// Colours of the scan that moves and of that which stays.
Rgb moving_color();
Rgb fixed_color();
/// Colours of features that agree on a pose and of those that do not.
Rgb agreeing_color();
Rgb other_color();
/// Colour of scan `index` of many: neighbours in the list are far apart in hue.
Rgb scan_color(std::size_t index);
ReportColor legend_of(const Rgb& color, const std::string& label);

/// A scan in one colour, moved by `pose` of its input. `normals` (of its analysis) shade a cloud.
SceneSurface drawn_scan(const LoadedSurface& scan, const Points& normals, const Pose& pose,
                        const Rgb& color);

/// Two views of what the surfaces show: about the mean of their normals where they have one, as
/// partial scans do, else from two sides.
std::array<Camera, 2> two_cameras(const std::vector<SceneSurface>& surfaces);

/// All surfaces at their places.
RegistrationPicture overlay_picture(const std::vector<SceneSurface>& surfaces, const Camera& camera,
                                    const std::string& alt, const std::string& caption);

/// The same where they are near enough to each other, and of like size; else in a row, all of one
/// size, and the caption says so.
RegistrationPicture overlay_or_row(std::vector<SceneSurface> surfaces, const Camera& camera,
                                   const std::string& alt, const std::string& caption);

/// Matches between two scans in one frame.
struct DrawnMatches {
  Points from;  ///< #N by 3, on the moving scan
  Points to;    ///< #N by 3, on the fixed one
  Rgb color = Rgb::Zero();
  double width_px = 1.5;
};

/// The scans side by side, moved apart along the picture, and lines between their matches: those of
/// the first set in front. Where a match agrees with the pose, its line is horizontal.
RegistrationPicture matches_picture(SceneSurface moving, SceneSurface fixed,
                                    const std::vector<DrawnMatches>& matches, const Camera& camera,
                                    const std::string& alt, const std::string& caption);

/// Draws `picture` into the page itself.
ReportPicture embedded(const RegistrationPicture& picture, int width, int height,
                       const RunControl& run);

/// Draws `picture` into a file beside the page.
ReportPicture drawn_beside(const RegistrationPicture& picture, const std::string& directory,
                           const std::string& file, int width, int height, const RunControl& run);

}  // namespace dupin::cli
