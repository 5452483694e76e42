#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "dupin/render/raster.h"
#include "dupin/render/renderer.h"

namespace dupin::detail {

/// What the tiles need, in the view frame (scene inside the unit ball), colours in light energy.
struct PreparedVertex {
  FixedPoint place;
  float depth = 0.0F;
  float inverse_w = 1.0F;
  Eigen::Vector3f normal;
  Eigen::Vector3f color;
  float position = -1.0F;  ///< in the colour map; < 0: use color
  float sky = 1.0F;        ///< share of the sky seen
};

struct PreparedDisc {
  Eigen::Vector3d center;
  Eigen::Vector3d normal;  ///< of the disc, towards the viewer
  Eigen::Vector3f color;
  double radius = 0.0;
  bool is_round = false;  ///< without a normal: shaded like a ball
};

struct PreparedSegment {
  Eigen::Vector3d a;  ///< pixel x, pixel y, depth
  Eigen::Vector3d b;
  double radius_a = 0.5;  ///< [px]
  double radius_b = 0.5;
  Eigen::Vector3f color;
};

struct PreparedSphere {
  Eigen::Vector3d center;
  Eigen::Vector3f color;
  double radius = 0.0;
  double opacity = 1.0;
};

/// Indices of the items that may touch each tile, ascending, in compressed rows.
struct TileBins {
  std::vector<std::int32_t> offset;
  std::vector<std::int32_t> item;
};

struct PreparedScene {
  static constexpr int kTile = 64;   ///< side of a tile [px]
  static constexpr int kBorder = 2;  ///< pixels around a tile: one for the filter, one for edges

  Projection projection;
  RenderOptions options;
  int tiles_x = 0;
  int tiles_y = 0;
  std::vector<PreparedVertex> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<PreparedDisc> discs;
  std::vector<PreparedSegment> segments;
  std::vector<PreparedSphere> spheres;
  std::vector<Eigen::Vector3f> map_colors;  ///< the colour map in light energy, end to end
  TileBins solid;   ///< triangles, then discs, then segments, numbered through
  TileBins bubble;  ///< spheres
};

/// Checks, transforms and bins `scene` for a picture whose surfaces fill `viewport`.
/// @throws InvalidArgument as render_surface()
PreparedScene prepare_scene(const Scene& scene, const RenderOptions& options,
                            const Viewport& viewport, const RunControl& run);

/// Throws unless every array has the right size and every number is finite.
/// @throws InvalidArgument as render_surface()
void validate(const Scene& scene);

}  // namespace dupin::detail
