#pragma once

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/image/image.h"
#include "dupin/render/camera.h"
#include "dupin/render/scene.h"

namespace dupin {

enum class Background { white, transparent };

/// Options of render_surface().
struct RenderOptions {
  int width = 1600;   ///< in [16, 16384] [px]
  int height = 1200;  ///< in [16, 16384] [px]
  Camera camera;
  Background background = Background::white;
  int supersampling = 3;    ///< samples a pixel along each axis, in [1, 4]
  double occlusion = 0.75;  ///< strength of ambient occlusion, in [0, 1]; 0: not computed
  double edges = 0.6;       ///< strength of the darkening at silhouettes, in [0, 1]
};

/// Draws `scene` by rasterisation with a depth buffer: smooth normals, two lights over a
/// hemisphere, ambient occlusion of the true surface (share of the sky a vertex sees, from depth
/// maps along 24 axes), balls as exact ray-sphere intersections with order-independent sorting a
/// sample, and a Gaussian filter in light energy over the samples.
///
/// Watertight: of triangles sharing an edge exactly one owns a sample on it. The nearest surface
/// wins; equal depths go to the lower index. Cancelled: an image of 0 by 0.
///
/// Same input, same bits for every number of threads.
/// Cost: O(V + F + samples + spheres under each sample), about 90 bytes a vertex, 16 a triangle.
///
/// @throws InvalidArgument before any work: a coordinate, normal, scalar, colour or radius is not
///   finite, an array has the wrong size, an index is out of range, an option is outside its range
Image render_surface(const Scene& scene, const RenderOptions& options = {}, RunControl run = {});

}  // namespace dupin
