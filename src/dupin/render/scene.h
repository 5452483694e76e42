#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dupin/mesh/mesh.h"
#include "dupin/render/color_map.h"

namespace dupin {

/// A surface to be drawn, or a cloud of discs when it has no triangles.
struct SceneSurface {
  Points points;           ///< #V by 3 [mu]
  Triangles triangles;     ///< #F by 3, counter-clockwise seen from outside; 0 by 3: a cloud
  Points normals;          ///< #V by 3, any length; 0 by 3: from the triangles, towards the viewer
  Eigen::VectorXd scalar;  ///< #V, coloured by Scene::scale; or empty
  Points colors;           ///< #V by 3 sRGB in [0, 1]; or 0 by 3. Used when there is no scalar
  Rgb color{0.80, 0.81, 0.83};  ///< of the whole surface otherwise
  double disc_radius = 0.0;     ///< of a cloud's points [mu]; 0: from the extent and the count
};

/// A ball, drawn as a bubble: clear in the middle, denser at the rim, with a line where it meets
/// the surfaces. opacity 1 draws a solid ball.
struct SceneSphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [mu]
  double radius = 1.0;                               ///< > 0 [mu]
  Rgb color{0.84, 0.37, 0.0};
  double opacity = 0.3;  ///< in (0, 1]
};

/// A line in space, hidden by what is before it.
struct ScenePolyline {
  Points points;                 ///< #P by 3 [mu]
  Eigen::VectorXd thickness_px;  ///< #P or 1, full width [px], in (0, 1000]
  Rgb color{0.1, 0.1, 0.12};
};

/// Grey of places that have no value; no colour map has it.
inline const Rgb kNoValueColor(0.62, 0.62, 0.64);

/// What is written around the picture. Text is UTF-8; see text.h for the characters known.
struct Legend {
  std::string title;
  std::string caption;
  std::string scale_label;  ///< over the colour bar
  bool has_color_bar = false;
  bool has_scale_bar = false;  ///< exact in the plane through the centre of the scene
  std::string unit = "";       ///< after the number of the scale bar
  /// Under the colour bar, beside kNoValueColor; empty: not there.
  std::string no_value_label = "";
};

/// Everything in a picture.
struct Scene {
  std::vector<SceneSurface> surfaces;
  std::vector<SceneSphere> spheres;
  std::vector<ScenePolyline> polylines;
  ColorScale scale;
  Legend legend;
};

}  // namespace dupin
