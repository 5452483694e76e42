#include "dupin/warp/deform.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/warp_depth.h"

namespace dupin {
namespace {

using Eigen::Index;

bool is_repeated(const Pin& a, const Pin& b) {
  return a.source == b.source && a.target == b.target && a.rotation == b.rotation &&
         a.depth == b.depth && a.radius == b.radius && a.weight == b.weight &&
         a.anchor.has_value() == b.anchor.has_value() &&
         (!a.anchor ||
          (a.anchor->triangle == b.anchor->triangle && a.anchor->weights == b.anchor->weights));
}

// A pin that says what another says already is left out; one that says something else at the same
// place is refused by Warper. Pins that lines name are kept.
std::vector<Pin> without_repeated(const std::vector<Pin>& pins, WarningList& warnings) {
  std::vector<Pin> kept;
  for (std::size_t m = 0; m < pins.size(); ++m) {
    bool is_new = true;
    for (const Pin& other : kept) is_new = is_new && !is_repeated(pins[m], other);
    if (is_new)
      kept.push_back(pins[m]);
    else
      warnings.add("W_PIN_REPEATED", "pin " + std::to_string(m),
                   "pins that repeat another were left out");
  }
  return kept;
}

std::vector<ControlLine> closed_polyline(std::size_t count) {
  std::vector<ControlLine> lines;
  if (count < 2) return lines;
  for (std::size_t m = 0; m < count; ++m) {
    lines.push_back({static_cast<std::int32_t>(m), static_cast<std::int32_t>((m + 1) % count)});
  }
  return lines;
}

class StageRun {
 public:
  StageRun(const PlanarMesh& mesh, const DeformOptions& options, Deformation& result)
      : first_(mesh), rest_(mesh), options_(options), result_(result) {}

  void run(const DeformStage& stage, RunControl control) {
    StageReport report;
    rest_.points = result_.points;
    const bool is_fine = stage.mode == DeformMode::fine;
    const std::vector<Pin> pins =
        is_fine ? stage.pins : without_repeated(stage.pins, result_.warnings);
    std::vector<ControlLine> lines;
    if (is_fine) lines = stage.lines.empty() ? closed_polyline(pins.size()) : stage.lines;
    WarpOptions warp = options_.warp;
    if (is_fine) warp.iterations = options_.fine_iterations;
    const auto start = std::chrono::steady_clock::now();
    const Warper warper(rest_, pins, lines, warp, std::move(control));
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    report.seconds_to_prepare = spent.count();

    WarpStep step = warper.drag(warper.targets(), {}, true);
    report.iterations = step.iterations;
    report.energy = step.energy;
    report.is_converged = step.is_converged;
    report.seconds_per_iteration = step.seconds_per_iteration;
    report.still_components = warper.still_components();
    report.flipped_before_polish =
        static_cast<Index>(measure_warp(first_, step.points).flipped.size());
    if (options_.is_polished && report.flipped_before_polish > 0) {
      PolishResult polished = polish_folds(warper.arap(), first_, step.points, options_.polish);
      report.polish_iterations = polished.iterations;
      step.points = std::move(polished.points);
    }
    report.largest_violation_px =
        warper.largest_violation(step.points, warper.targets(), warper.rotations());
    remark(warper, report);
    result_.points = std::move(step.points);
    const bool has_depths =
        std::any_of(pins.begin(), pins.end(), [](const Pin& pin) { return pin.depth != 0.0; });
    if (!is_fine && has_depths) {
      Eigen::VectorXd depths(static_cast<Index>(pins.size()));
      for (std::size_t m = 0; m < pins.size(); ++m) depths[static_cast<Index>(m)] = pins[m].depth;
      result_.depth = warper.depth(depths);
    }
    if (!report.is_converged) result_.status = Status::not_converged;
    result_.stages.push_back(std::move(report));
  }

 private:
  void remark(const Warper& warper, const StageReport& report) {
    for (const std::int32_t component : report.still_components) {
      result_.warnings.add("W_COMPONENT_UNANCHORED", "part " + std::to_string(component),
                           "parts of the shape without a pin stay where they are");
    }
    if (warper.num_clamped_weights() > 0) {
      result_.warnings.add("W_WEIGHT_CLAMPED", "the mesh",
                           "cotangent weights that were negative or of needles were clamped",
                           warper.num_clamped_weights());
    }
  }

  const PlanarMesh& first_;  // what is folded over is so against the first shape
  PlanarMesh rest_;          // of the stage: the result of the one before
  const DeformOptions& options_;
  Deformation& result_;
};

}  // namespace

Deformation deform(const PlanarMesh& mesh, const std::vector<DeformStage>& stages,
                   const DeformOptions& options, RunControl run) {
  validate(mesh);
  if (options.fine_iterations < 0) throw InvalidArgument("fine_iterations must be >= 0");
  Deformation result;
  result.points = mesh.points;
  result.depth = Eigen::VectorXd::Zero(mesh.points.rows());
  StageRun stage_run(mesh, options, result);
  const auto num_stages = static_cast<double>(stages.size());
  for (std::size_t s = 0; s < stages.size(); ++s) {
    const auto done = static_cast<double>(s);
    try {
      run.throw_if_cancelled();
      if (stages[s].pins.empty())
        result.stages.emplace_back();
      else
        stage_run.run(stages[s], run.stage(done / num_stages, (done + 1.0) / num_stages));
    } catch (const Error& error) {
      if (error.errc() != Errc::interrupted) throw;
      result.status = Status::cancelled;
      break;
    }
    ++result.num_done;
  }
  result.quality = measure_warp(mesh, result.points);
  if (!result.quality.flipped.empty()) {
    result.warnings.add("W_FOLD_OVER", "face " + std::to_string(result.quality.flipped[0]),
                        "triangles are folded over",
                        static_cast<std::int64_t>(result.quality.flipped.size()));
  }
  result.paint_order = paint_order(mesh.triangles, result.depth);
  return result;
}

Deformation deform(const PlanarMesh& mesh, const std::vector<Pin>& pins,
                   const DeformOptions& options, RunControl run) {
  return deform(mesh, std::vector<DeformStage>{{DeformMode::coarse, pins, {}}}, options,
                std::move(run));
}

}  // namespace dupin
