// Finds the features of a surface: keypoints [SURFACE]. Without a file, of a sphere with 12 bumps.
#include "dupin/features/keypoints.h"

#include <cstdio>

#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/mesh/shapes.h"
#include "dupin/surface/surface_graph.h"

int main(int argc, char** argv) try {
  const dupin::PolygonMesh input =
      argc > 1 ? dupin::read_surface(argv[1]).mesh
               : to_polygon_mesh(dupin::make_bumpy_sphere(1.0, 20'000).surface.mesh);
  const dupin::HealedSurface healed = dupin::heal(input);
  const dupin::SurfaceGraph graph = dupin::surface_graph(healed.mesh, healed.is_guarded);
  const Eigen::VectorXd signal = dupin::compute_signal(graph, dupin::Signal::height);
  const dupin::DiffusionOperator op =
      dupin::umbrella_operator(graph.topology.ring, &graph.topology);
  const dupin::ScaleSpace stack = dupin::compute_scale_space(op, signal, {.want_levels = false});
  const dupin::KeypointSet found =
      dupin::find_keypoints(graph, stack.loc, {}, signal.cwiseAbs().maxCoeff(), {.top = 20});
  for (const dupin::Keypoint& point : found.keypoints) {
    const Eigen::RowVector3d p = healed.to_input(graph.points.row(point.vertex));
    std::printf("%9.5f %9.5f %9.5f  radius %.4f  %s\n", p.x(), p.y(), p.z(),
                point.radius * healed.unit(),
                point.kind == dupin::KeypointKind::minimum ? "bump" : "dent");
  }
  return found.keypoints.empty() ? 1 : 0;
} catch (const dupin::Error& error) {
  std::fprintf(stderr, "%s\n", error.diagnostic().c_str());
  return static_cast<int>(error.errc());
}
