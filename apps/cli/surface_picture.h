#pragma once

#include <Eigen/Core>
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
void color_by(Scene& scene, const ColorSignal& signal);

/// Adds keypoints to a scene: for each a small solid pin at its place and, around it, a transparent
/// ball of its radius. A ball wider than `largest` times the diagonal of the scene's box would hide
/// the surface and say little about a place: it is left out. Returns how many were.
Eigen::Index add_keypoint_balls(Scene& scene, const std::vector<SceneSphere>& keypoints,
                                double largest = 0.09);

/// Colour of a keypoint's ball by its kind.
Rgb keypoint_color(bool is_maximum);

}  // namespace dupin::cli
