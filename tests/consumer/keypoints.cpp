// What a user writes first: the keypoints of a surface, a line "vertex level kind response" each.
#include "dupin/features/keypoints.h"

#include <cstdio>

#include "dupin/mesh/shapes.h"

int main() {
  const dupin::Mesh mesh = dupin::make_bumpy_sphere(1.0, 4000).surface.mesh;
  const dupin::SurfaceGraph graph = dupin::surface_graph(mesh);
  const Eigen::VectorXd signal = dupin::compute_signal(graph, dupin::Signal::height);
  const auto op = dupin::umbrella_operator(graph.topology.ring, &graph.topology);
  const dupin::ScaleSpace stack = dupin::compute_scale_space(op, signal);
  const auto found = dupin::find_keypoints(graph, stack.loc, {}, signal.cwiseAbs().maxCoeff());
  for (const dupin::Keypoint& keypoint : found.keypoints) {
    std::printf("%d %d %s %.17g\n", keypoint.vertex, keypoint.level,
                keypoint.kind == dupin::KeypointKind::minimum ? "bump" : "hollow",
                keypoint.response);
  }
  return found.keypoints.empty() ? 1 : 0;
}
