#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/mesh/polygon_mesh.h"
#include "dupin/render/scene.h"
#include "dupin/surface/surface_graph.h"

namespace dupin::cli {

/// A surface as a verb that draws needs it: repaired, and back in the unit of the input.
struct PictureSurface {
  SurfaceGraph graph;                      ///< in local coordinates when it is a mesh
  Points points;                           ///< #V by 3, input unit, aligned with graph.points
  double unit = 1.0;                       ///< input length of one local length
  std::vector<std::int32_t> input_vertex;  ///< #V: vertex of the input
  Eigen::Index num_input_vertices = 0;
};

/// Reads and repairs a surface; a file without faces becomes a cloud. Warnings go to `context`.
PictureSurface load_surface(const std::string& path, Context& context);
/// The same of a mesh at hand.
PictureSurface to_picture_surface(const PolygonMesh& mesh, const std::string& name,
                                  Context& context);

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
ColorSignal compute_color_signal(const PictureSurface& surface, const std::string& name, int level,
                                 const RunControl& run);

/// The surface for a scene, without colours.
SceneSurface to_scene_surface(const PictureSurface& surface);

/// Colours the first surface of `scene` by `signal`, with limits that leave out 2 % of outliers.
void color_by(Scene& scene, const ColorSignal& signal);

/// Colour of a keypoint's ball by its kind.
Rgb keypoint_color(bool is_maximum);

}  // namespace dupin::cli
