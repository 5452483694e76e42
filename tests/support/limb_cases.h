#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dupin/image/raster.h"
#include "dupin/warp/deform.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin::test {

/// An arm, a leg or a sleeve that turns about its joint while the rest stays. [px]
struct LimbCase {
  std::string name;
  Eigen::Vector2d joint = Eigen::Vector2d::Zero();
  Eigen::Vector2d cut_from = Eigen::Vector2d::Zero();  ///< the limb begins beyond the line between
  Eigen::Vector2d cut_to = Eigen::Vector2d::Zero();    ///< these two, which lie outside the shape
  std::vector<Eigen::Vector2d> limb;                   ///< two pins, the second nearer to its end
  std::vector<Eigen::Vector2d> body;                   ///< three pins or more
  double angle_deg = 0.0;                              ///< from x towards y
};

/// A picture and its limbs.
struct LimbPicture {
  std::string name;
  Raster raster;
  std::vector<LimbCase> limbs;
};

/// Figures of round strokes with soft edges: one with its arms out, one that strides, and a
/// jointed toy with a paw.
std::vector<LimbPicture> drawn_figures();

/// Limbs of cut-outs of the shared data, in shares of the sides of the picture: `name` is the file,
/// without ".png".
std::vector<LimbPicture> cut_out_limbs();
/// The same in pixels of the picture, which it takes in.
LimbPicture with_picture(LimbPicture in_shares, Raster raster);

/// The largest part of a picture, with about `rows` triangles in its height.
PlanarMesh mesh_of_picture(const Raster& raster, double rows = 60.0);

/// Errors of the dense map at all pixel centres, as shares of the height of the shape.
struct LimbErrors {
  double limb_median = 0.0;  ///< of the limb farther than a quarter of the cut from it
  double limb_most = 0.0;    ///< 90 % are below
  double body_median = 0.0;  ///< of all on the other side of the cut
  double body_most = 0.0;
  Eigen::Index num_limb = 0;  ///< pixels
  Eigen::Index num_body = 0;
  Eigen::Index flipped = 0;
};

/// Deforms by the pins of `limb` and compares with the turn about the joint.
LimbErrors measure_limb(const PlanarMesh& mesh, const LimbCase& limb, const DeformOptions& options);

/// What the thesis does: edge Dijkstra, uniform weights, beta 2, single stage without a polish.
DeformOptions thesis_options();
/// Moving least squares of the plane, through anything.
DeformOptions image_space_options();

}  // namespace dupin::test
