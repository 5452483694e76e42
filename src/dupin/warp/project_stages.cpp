#include "dupin/warp/project_stages.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

bool acts(const WarpPin& pin, const WarpStage& stage) {
  return (pin.kind == PinKind::interior) == (stage.mode == StageMode::coarse);
}

Pin to_pin(const WarpPin& from, const std::string& number) {
  Pin pin;
  pin.name = from.name.empty() ? number : from.name;
  pin.source = from.source.transpose();
  pin.target = from.target.transpose();
  if (from.rotation_deg) pin.rotation = *from.rotation_deg * (std::numbers::pi / 180.0);
  pin.depth = from.depth;
  pin.radius = from.radius;
  pin.weight = from.weight;
  return pin;
}

// From each pin to the next of its loop, the last to the first. A pin alone is joined to itself:
// no line, but it may lie outside the shape as the others.
std::vector<ControlLine> polygons_of(const std::map<int, std::vector<std::int32_t>>& loops) {
  std::vector<ControlLine> lines;
  for (const auto& [loop, pins] : loops) {
    for (std::size_t i = 0; i < pins.size(); ++i)
      lines.push_back({pins[i], pins[(i + 1) % pins.size()]});
  }
  return lines;
}

}  // namespace

std::vector<DeformStage> stages_of(const WarpProject& project,
                                   const std::vector<std::optional<MeshPoint>>& anchors) {
  std::vector<DeformStage> stages;
  bool is_first = true;
  for (const WarpStage& from : project.stages) {
    DeformStage stage;
    stage.mode = from.mode == StageMode::coarse ? DeformMode::coarse : DeformMode::fine;
    std::map<int, std::vector<std::int32_t>> loops;
    for (std::size_t i = 0; i < from.pins.size(); ++i) {
      if (!acts(from.pins[i], from)) continue;
      loops[from.pins[i].loop].push_back(static_cast<std::int32_t>(stage.pins.size()));
      const std::string where =
          project.stages.size() > 1 ? " of stage " + std::to_string(stages.size()) : "";
      stage.pins.push_back(to_pin(from.pins[i], std::to_string(i) + where));
    }
    if (stage.mode == DeformMode::fine) stage.lines = polygons_of(loops);
    if (is_first && !stage.pins.empty()) {
      is_first = false;
      if (!anchors.empty() && anchors.size() != stage.pins.size())
        throw InvalidArgument("there are anchors of " + std::to_string(anchors.size()) +
                              " pins, the first stage has " + std::to_string(stage.pins.size()));
      for (std::size_t i = 0; i < anchors.size(); ++i) stage.pins[i].anchor = anchors[i];
    }
    stages.push_back(std::move(stage));
  }
  return stages;
}

void require_tables(const PlanarMesh& mesh, const std::vector<DeformStage>& stages) {
  // At most so many samples lie on the lines of a stage; a pin has a distance to every vertex and
  // three numbers in the table of moving least squares, a sample a distance.
  constexpr double kLineSamples = 256.0;
  constexpr double kNumbersOfPin = 5.0;
  constexpr double kMaxTableBytes = 4e9;
  double most = 0.0;
  for (const DeformStage& stage : stages) {
    const double samples = stage.lines.empty() ? 0.0 : kLineSamples;
    most = std::max(most, kNumbersOfPin * static_cast<double>(stage.pins.size()) + samples);
  }
  const double bytes = most * sizeof(double) * static_cast<double>(mesh.points.rows());
  if (!(bytes > kMaxTableBytes)) return;
  throw Error(Errc::over_limit, "E_TOO_LARGE",
              std::to_string(mesh.points.rows()) + " vertices and so many pins need " +
                  std::to_string(static_cast<int>(std::ceil(bytes / 1e9))) + " GB, the limit is " +
                  std::to_string(static_cast<int>(kMaxTableBytes / 1e9)),
              {}, "a coarser mesh, or fewer pins");
}

WarningList ignored_pins(const WarpProject& project) {
  WarningList warnings;
  for (std::size_t s = 0; s < project.stages.size(); ++s) {
    const WarpStage& stage = project.stages[s];
    for (std::size_t i = 0; i < stage.pins.size(); ++i) {
      if (acts(stage.pins[i], stage)) continue;
      warnings.add("W_PIN_IGNORED", "stage " + std::to_string(s) + ", pin " + std::to_string(i),
                   "exterior control points move nothing in a coarse stage, interior ones nothing "
                   "in a fine one");
    }
  }
  return warnings;
}

DeformOptions deform_options_of(const WarpProject& project) {
  const DeformationSettings& settings = project.deformation;
  DeformOptions options;
  options.warp.mls.alpha = settings.alpha;
  options.warp.beta = settings.beta;
  options.warp.iterations = settings.method == WarpMethod::arap ? settings.iterations : 0;
  options.warp.metric =
      settings.method == WarpMethod::image_mls ? WarpMetric::euclidean : WarpMetric::geodesic;
  options.is_polished = settings.method == WarpMethod::arap;
  return options;
}

}  // namespace dupin
