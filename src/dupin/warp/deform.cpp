#include "dupin/warp/deform.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/fine_stage.h"
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

class Stopwatch {
 public:
  double seconds() const {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start_;
    return spent.count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

class StageRun {
 public:
  StageRun(const PlanarMesh& mesh, const DeformOptions& options, Deformation& result)
      : first_(mesh), rest_(mesh), options_(options), result_(result) {}

  void run(const DeformStage& stage, const RunControl& control) {
    StageReport report;
    rest_.points = result_.points;
    if (stage.mode == DeformMode::fine)
      run_fine(stage, report, control);
    else
      run_coarse(stage, report, control);
    for (const std::int32_t component : report.still_components) {
      result_.warnings.add("W_COMPONENT_UNANCHORED", "part " + std::to_string(component),
                           "parts of the shape without a pin stay where they are");
    }
    if (!report.is_converged) result_.status = Status::not_converged;
    result_.stages.push_back(std::move(report));
  }

 private:
  void run_coarse(const DeformStage& stage, StageReport& report, const RunControl& control) {
    const std::vector<Pin> pins = without_repeated(stage.pins, result_.warnings);
    const Stopwatch preparing;
    const Warper warper(rest_, pins, {}, options_.warp, control);
    report.seconds_to_prepare = preparing.seconds();
    WarpStep step = warper.drag(warper.targets(), {}, true, control);
    report.iterations = step.iterations;
    report.energy = step.energy;
    report.is_converged = step.is_converged;
    report.seconds_per_iteration = step.seconds_per_iteration;
    report.still_components = warper.still_components();
    if (is_folded(step.points, report)) {
      PolishResult polished =
          polish_folds(warper.arap(), first_, step.points, options_.polish, control);
      report.polish_iterations = polished.iterations;
      step.points = std::move(polished.points);
    }
    report.largest_violation_px =
        warper.largest_violation(step.points, warper.targets(), warper.rotations());
    remark_weights(warper.num_clamped_weights());
    result_.points = std::move(step.points);
    const bool has_depths =
        std::any_of(pins.begin(), pins.end(), [](const Pin& pin) { return pin.depth != 0.0; });
    if (has_depths) {
      Eigen::VectorXd depths(static_cast<Index>(pins.size()));
      for (std::size_t m = 0; m < pins.size(); ++m) depths[static_cast<Index>(m)] = pins[m].depth;
      result_.depth = warper.depth(depths);
    }
  }

  // Pins on the contour are many, more than one a triangle, and they say where the border goes:
  // iterations and the polish hold the border, not the corners next to the pins.
  void run_fine(const DeformStage& stage, StageReport& report, const RunControl& control) {
    const std::vector<ControlLine> lines =
        stage.lines.empty() ? closed_polyline(stage.pins.size()) : stage.lines;
    const Stopwatch preparing;
    const PlanarGraph graph = make_planar_graph(rest_);
    detail::LineWarp warped =
        detail::warp_by_lines(rest_, graph, stage.pins, lines, options_.warp, control);
    std::optional<detail::HeldBorder> held;
    if (options_.fine_iterations > 0) held.emplace(rest_, graph, options_.warp.edge_weights);
    report.seconds_to_prepare = preparing.seconds();
    report.still_components = std::move(warped.still_components);
    const Stopwatch iterating;
    for (; report.iterations < options_.fine_iterations; ++report.iterations) {
      control.throw_if_cancelled();
      report.energy.push_back(held->system().iterate(warped.points));
    }
    if (report.iterations > 0) {
      report.seconds_per_iteration = iterating.seconds() / report.iterations;
      report.energy.push_back(held->system().energy(warped.points));
    }
    if (is_folded(warped.points, report)) {
      if (!held) held.emplace(rest_, graph, options_.warp.edge_weights);
      PolishResult polished = held->polish(first_, warped.points, options_.polish, control);
      report.polish_iterations = polished.iterations;
      warped.points = std::move(polished.points);
    }
    if (held) remark_weights(held->num_clamped_weights());
    result_.points = std::move(warped.points);
  }

  bool is_folded(const Points2& points, StageReport& report) const {
    report.flipped_before_polish = static_cast<Index>(measure_warp(first_, points).flipped.size());
    return options_.is_polished && report.flipped_before_polish > 0;
  }

  void remark_weights(Index num_clamped) {
    if (num_clamped == 0) return;
    result_.warnings.add("W_WEIGHT_CLAMPED", "the mesh",
                         "cotangent weights that were negative or of needles were clamped",
                         num_clamped);
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
