#include "surface_picture.h"

#include <cmath>

#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/scalespace/scale_space.h"

namespace dupin::cli {
namespace {

PictureSurface cloud_surface(const PolygonMesh& mesh, Context& context) {
  PictureSurface out;
  out.graph = surface_graph(PointCloud{mesh.points, mesh.normals}, {}, context.run);
  out.points = mesh.points;
  out.num_input_vertices = mesh.points.rows();
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
    out.input_vertex.push_back(static_cast<std::int32_t>(v));
  }
  return out;
}

}  // namespace

PictureSurface to_picture_surface(const PolygonMesh& mesh, const std::string& name,
                                  Context& context) {
  HealOptions options;
  options.drop_nonfinite = context.read.drop_nonfinite;
  const HealedSurface healed = heal(mesh, options, context.run);
  context.report(name, healed.warnings);
  PictureSurface out;
  out.graph = surface_graph(healed.mesh, healed.is_guarded);
  out.unit = healed.unit();
  out.input_vertex = healed.input_vertex;
  out.num_input_vertices = healed.num_input_vertices;
  out.points = (healed.mesh.points * healed.unit()).rowwise() + healed.center;
  return out;
}

PictureSurface load_surface(const std::string& path, Context& context) {
  const SurfaceFile file = read_surface(path, context.read, context.run);
  context.report(path, file.warnings);
  if (file.mesh.num_faces() == 0) return cloud_surface(file.mesh, context);
  return to_picture_surface(file.mesh, path, context);
}

const std::vector<std::string>& color_signal_names() {
  static const std::vector<std::string> names = {"height", "H", "K", "k1", "k2", "loc", "si_loc"};
  return names;
}

ColorSignal compute_color_signal(const PictureSurface& surface, const std::string& name, int level,
                                 const RunControl& run) {
  ColorSignal out;
  const bool is_stack = name == "loc" || name == "si_loc";
  Signal signal = Signal::height;
  if (name == "H") signal = Signal::mean;
  if (name == "K") signal = Signal::gauss;
  if (name == "k1") signal = Signal::k1;
  if (name == "k2") signal = Signal::k2;
  if (signal == Signal::height && name != "height" && !is_stack) {
    throw InvalidArgument("color \"" + escaped(name, 40) + "\" is unknown");
  }
  const Eigen::VectorXd field = compute_signal(surface.graph, signal, 6, run);
  const double to_input =
      1.0 / (signal == Signal::gauss ? surface.unit * surface.unit : surface.unit);
  out.label = name;
  if (!is_stack) {
    out.values = field * to_input;
    return out;
  }
  ScaleSpaceOptions options;
  if (level < 0 || level > options.schedule.num_levels - 2) {
    throw InvalidArgument("level is " + std::to_string(level) + ", legal range 0 to " +
                          std::to_string(options.schedule.num_levels - 2));
  }
  // Levels above the wanted one do not change it.
  options.schedule.num_levels = level + 2;
  options.want_levels = false;
  const DiffusionOperator op = umbrella_operator(
      surface.graph.topology.ring, surface.graph.is_mesh() ? &surface.graph.topology : nullptr);
  const ScaleSpace stack = compute_scale_space(op, field, options, run);
  if (stack.status == Status::cancelled) {
    throw Error(Errc::interrupted, "E_INTERRUPTED", "interrupted");
  }
  if (name == "loc") {
    out.values = stack.loc.row(level).transpose() * to_input;
    out.label = "LoC, level " + std::to_string(level);
  } else {
    const double scale = field.size() > 0 ? field.cwiseAbs().maxCoeff() : 0.0;
    out.values = scale_invariant_loc(stack.loc.bottomRows(1), scale).row(0).transpose();
    out.label = "si-LoC, level " + std::to_string(level);
  }
  return out;
}

SceneSurface to_scene_surface(const PictureSurface& surface) {
  SceneSurface out;
  out.points = surface.points;
  out.triangles = surface.graph.triangles;
  if (!surface.graph.is_mesh()) out.normals = surface.graph.normals;
  return out;
}

void color_by(Scene& scene, const ColorSignal& signal) {
  scene.surfaces.front().scalar = signal.values;
  scene.scale.map = signal.is_signed ? ColorMap::diverging : ColorMap::sequential;
  scene.scale.range =
      signal.is_signed ? symmetric_range(signal.values) : robust_range(signal.values);
  scene.legend.scale_label = signal.label;
  scene.legend.has_color_bar = true;
}

Rgb keypoint_color(bool is_maximum) {
  return is_maximum ? Rgb(0.835, 0.369, 0.0) : Rgb(0.0, 0.447, 0.698);
}

}  // namespace dupin::cli
