#include "surface_picture.h"

#include <algorithm>
#include <cmath>

#include "dupin/base/error.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/spatial/neighborhoods.h"

namespace dupin::cli {
const std::vector<std::string>& color_signal_names() {
  static const std::vector<std::string> names = {"height", "H", "K", "k1", "k2", "loc", "si_loc"};
  return names;
}

ColorSignal compute_color_signal(const LoadedSurface& surface, const std::string& name, int level,
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
  run.throw_if_cancelled();
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
  run.throw_if_cancelled();
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

SceneSurface to_scene_surface(const LoadedSurface& surface) {
  SceneSurface out;
  out.points = surface.points;
  out.triangles = surface.graph.triangles;
  if (!surface.graph.is_mesh()) out.normals = surface.graph.normals;
  return out;
}

void color_by(Scene& scene, const ColorSignal& signal) {
  Eigen::VectorXd there = signal.values;
  if (!signal.is_absent.empty()) {
    Eigen::Index count = 0;
    for (Eigen::Index v = 0; v < signal.values.size(); ++v) {
      if (signal.is_absent[static_cast<std::size_t>(v)] == 0) there[count++] = signal.values[v];
    }
    there.conservativeResize(count);
  }
  ColorScale scale;
  scale.map = signal.is_signed ? ColorMap::diverging : ColorMap::sequential;
  scale.range = signal.is_signed ? symmetric_range(there) : robust_range(there);
  scene.legend.scale_label = signal.label;
  scene.legend.has_color_bar = true;
  set_color_scale(scene, signal, scale);
}

void set_color_scale(Scene& scene, const ColorSignal& signal, const ColorScale& scale) {
  scene.scale = scale;
  SceneSurface& surface = scene.surfaces.front();
  const bool has_gaps = std::any_of(signal.is_absent.begin(), signal.is_absent.end(),
                                    [](std::uint8_t absent) { return absent != 0; });
  if (!has_gaps) {
    surface.scalar = signal.values;
    return;
  }
  // Grey is no colour of the map: the colours are mixed between vertices instead of the values.
  surface.scalar.resize(0);
  surface.colors.resize(signal.values.size(), 3);
  for (Eigen::Index v = 0; v < signal.values.size(); ++v) {
    surface.colors.row(v) =
        (signal.is_absent[static_cast<std::size_t>(v)] != 0 ? kNoValueColor
                                                            : scale.color(signal.values[v]))
            .transpose();
  }
  scene.legend.no_value_label = signal.absent_label;
}

std::vector<std::size_t> nearest_sample(const Points& points,
                                        const std::vector<std::int32_t>& sampled) {
  Points places(static_cast<Eigen::Index>(sampled.size()), 3);
  for (std::size_t i = 0; i < sampled.size(); ++i) {
    places.row(static_cast<Eigen::Index>(i)) = points.row(sampled[i]);
  }
  const NeighborTable table = NeighborSearch(places).nearest(points, 1);
  std::vector<std::size_t> out;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    out.push_back(static_cast<std::size_t>(table.index(v, 0)));
  }
  return out;
}

Eigen::Index add_keypoint_balls(Scene& scene, const std::vector<SceneSphere>& keypoints,
                                double largest) {
  const Points& points = scene.surfaces.front().points;
  const double diagonal = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  Eigen::Index left_out = 0;
  for (const SceneSphere& keypoint : keypoints) {
    SceneSphere pin = keypoint;
    pin.radius = std::min(0.005 * diagonal, keypoint.radius);
    pin.opacity = 1.0;
    scene.spheres.push_back(pin);
    if (keypoint.radius > largest * diagonal) {
      ++left_out;
    } else {
      scene.spheres.push_back(keypoint);
    }
  }
  return left_out;
}

Rgb keypoint_color(bool is_maximum) {
  return is_maximum ? Rgb(0.835, 0.369, 0.0) : Rgb(0.0, 0.447, 0.698);
}

}  // namespace dupin::cli
