#include "demo_parts.h"

#include "dupin/io/png.h"
#include "dupin/io/surface_io.h"
#include "dupin/render/renderer.h"

namespace dupin::cli {

DemoAnalysis analyse(const DemoSubject& subject, DemoTiming& timing, Context& context) {
  DemoAnalysis out;
  out.surface = to_loaded_surface(subject.mesh, subject.name, context);
  const SurfaceGraph& graph = out.surface.graph;
  out.mean_edge = graph.mean_edge * out.surface.unit;
  timing.name = subject.title;
  timing.warnings = out.surface.warnings;
  timing.vertices = graph.points.rows();
  timing.faces = graph.triangles.rows();
  Watch watch;
  const Eigen::VectorXd local = compute_signal(graph, Signal::height, 6, context.run);
  context.run.throw_if_cancelled();
  timing.signal = watch.lap();
  ScaleSpaceOptions options;
  options.want_levels = false;
  const DiffusionOperator op = umbrella_operator(graph.topology.ring, &graph.topology);
  const ScaleSpace stack = compute_scale_space(op, local, options, context.run);
  context.run.throw_if_cancelled();
  timing.stack = watch.lap();
  const double signal_scale = local.size() > 0 ? local.cwiseAbs().maxCoeff() : 0.0;
  KeypointSet found =
      find_keypoints(graph, stack.loc, options.schedule, signal_scale, {}, context.run);
  timing.keypoints = watch.lap();
  context.run.throw_if_cancelled();
  out.schedule = options.schedule;
  out.tau = stack.tau;
  out.loc = stack.loc;
  out.signal = local;
  out.keypoints = std::move(found.keypoints);
  return out;
}

void to_input_unit(DemoAnalysis& analysis) {
  const double unit = analysis.surface.unit;
  analysis.loc /= unit;
  analysis.signal /= unit;
  for (Keypoint& keypoint : analysis.keypoints) {
    keypoint.radius *= unit;
    keypoint.response /= unit;
  }
}

ReportPicture draw(const std::filesystem::path& directory, const DemoSubject& subject,
                   const std::string& suffix, const Scene& scene, const std::string& caption,
                   Context& context) {
  RenderOptions options;
  options.width = kDemoWidth;
  options.height = kDemoHeight;
  options.camera = camera_of(subject.view);
  const std::string name = subject.name + "-" + suffix + ".png";
  const Image image = render_surface(scene, options, context.run);
  context.run.throw_if_cancelled();  // a picture whose tiles are not all drawn is no picture
  write_png((directory / name).string(), image);
  return {name, subject.title + ": " + scene.legend.title, caption, kDemoWidth, kDemoHeight};
}

Scene plain_scene(const DemoAnalysis& analysis, const std::string& title) {
  Scene scene;
  scene.surfaces.push_back(to_scene_surface(analysis.surface));
  scene.legend.title = title;
  scene.legend.has_scale_bar = true;
  return scene;
}

void write_subject(const DemoSubject& subject) {
  SurfaceOutput output;
  output.points = subject.mesh.points;
  output.triangles = Eigen::Map<const Triangles>(subject.mesh.face_index.data(),
                                                 subject.mesh.face_index.size() / 3, 3);
  write_surface(subject.file, output, SurfaceFormat::ply_binary);
}

}  // namespace dupin::cli
