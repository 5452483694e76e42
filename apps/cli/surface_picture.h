#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/render/scene.h"
#include "surface_input.h"

namespace dupin::cli {

/// A quantity to colour a surface with.
struct ColorSignal {
  Eigen::VectorXd values;  ///< #V
  std::string label;       ///< for the colour bar
  bool is_signed = true;   ///< zero is the middle of its colours
  /// #V or empty: not 0 where there is no value (the number at its place is not looked at).
  std::vector<std::uint8_t> is_absent = {};
  std::string absent_label = "no value";
};

/// Names that compute_color_signal() knows.
const std::vector<std::string>& color_signal_names();

/// "height", "H", "K", "k1", "k2", or of the height signal "loc" and "si_loc" at `level` of the
/// default scale space, as `dupin scalespace` computes them. Units of the input.
/// @throws InvalidArgument for another name or a level outside [0, 33]
ColorSignal compute_color_signal(const LoadedSurface& surface, const std::string& name, int level,
                                 const RunControl& run);

/// The surface for a scene, without colours.
SceneSurface to_scene_surface(const LoadedSurface& surface);

/// Colours the first surface of `scene` by `signal`, with limits that leave out 2 % of outliers.
/// Vertices without a value are grey, and the legend says so. To change the limits afterwards, use
/// set_color_scale().
void color_by(Scene& scene, const ColorSignal& signal);

/// Colours by another scale what color_by() coloured.
void set_color_scale(Scene& scene, const ColorSignal& signal, const ColorScale& scale);

/// For each of `points` (#V by 3) the place in `sampled` of the vertex nearest to it: so a picture
/// of values at some vertices is coloured everywhere. `sampled` is not empty.
std::vector<std::size_t> nearest_sample(const Points& points,
                                        const std::vector<std::int32_t>& sampled);

/// Adds keypoints to a scene: for each a small solid pin at its place and, around it, a transparent
/// ball of its radius. A ball wider than `largest` times the diagonal of the scene's box would hide
/// the surface and say little about a place: it is left out. Returns how many were.
Eigen::Index add_keypoint_balls(Scene& scene, const std::vector<SceneSphere>& keypoints,
                                double largest = 0.09);

/// Colour of a keypoint's ball by its kind.
Rgb keypoint_color(bool is_maximum);

}  // namespace dupin::cli
