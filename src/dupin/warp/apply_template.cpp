#include "dupin/warp/apply_template.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/warp/contour_curvature.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/project_stages.h"
#include "dupin/warp/triangulate_outline.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

// The outer loops, the largest first.
std::vector<std::size_t> parts_of(const Outline& outline) {
  std::vector<std::size_t> loops;
  for (std::size_t l = 0; l < outline.loops.size(); ++l) {
    if (signed_area(outline.loops[l]) > 0.0) loops.push_back(l);
  }
  std::stable_sort(loops.begin(), loops.end(), [&](std::size_t a, std::size_t b) {
    return signed_area(outline.loops[a]) > signed_area(outline.loops[b]);
  });
  return loops;
}

// The part of a triangle, by its size.
std::size_t part_of(const ProjectMesh& mesh, const std::vector<std::size_t>& parts,
                    std::int32_t triangle) {
  const std::int32_t component = mesh.meshed.component[static_cast<std::size_t>(triangle)];
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (mesh.outline.component[parts[i]] == component) return i;
  }
  return 0;
}

WarpProject with_stages(const WarpProject& project, std::size_t count) {
  WarpProject result = project;
  result.stages.resize(count);
  return result;
}

Deformation deformed(const WarpProject& project, const ProjectMesh& mesh, const RunControl& run) {
  const std::vector<DeformStage> stages = stages_of(project, mesh.anchors);
  require_tables(mesh.meshed.mesh, stages);
  return deform(mesh.meshed.mesh, stages, deform_options_of(project), run);
}

RowVector2d box_centre(const Points2& loop) {
  return 0.5 * (loop.colwise().minCoeff() + loop.colwise().maxCoeff());
}

// A small part without a corner (a button) is carried by its box, and nobody vouches for it.
TransferredPins carried_by_box(const Points2& from, const std::vector<WarpPin>& pins,
                               const Points2& to) {
  const double ratio = loop_length(to) / loop_length(from);
  TransferredPins result{pins, Eigen::VectorXd::Zero(static_cast<Index>(pins.size()))};
  for (WarpPin& pin : result.pins) {
    const RowVector2d way = ratio * (pin.target - pin.source);
    pin.source = box_centre(to) + ratio * (pin.source - box_centre(from));
    pin.target = pin.source + way;
    pin.radius *= ratio;
  }
  return result;
}

struct Parts {
  std::vector<std::size_t> from;
  std::vector<std::size_t> to;
  std::vector<std::optional<ContourMatch>> match;  // of the parts of the template
};

class Application {
 public:
  Application(const PoseTemplate& pose, const WarpProject& target, const Raster& image,
              const ApplyOptions& options)
      : pose_(pose), image_(image), options_(options) {
    result_.project = target;
    result_.project.stages.clear();
    result_.project.deformation = pose.project.deformation;
  }

  AppliedTemplate run(const RunControl& run) {
    result_.mesh = make_project_mesh(result_.project, image_, run.stage(0.0, 0.2));
    if (is_cancelled(run) || !match_parts(run.stage(0.2, 0.3))) return cancelled();
    Points2 points = result_.mesh.meshed.mesh.points;
    const std::size_t count = pose_.project.stages.size();
    bool is_first = true;
    for (std::size_t s = 0; s < count; ++s) {
      const auto share = static_cast<double>(s) / static_cast<double>(count);
      const RunControl part = run.stage(0.3 + 0.7 * share, 1.0);
      carry_stage(s, points);
      // Pins of the first stage become vertices.
      if (is_first && !result_.project.stages.back().pins.empty()) {
        is_first = false;
        result_.mesh = make_project_mesh(result_.project, image_, part.stage(0.0, 0.3));
        if (is_cancelled(run)) return cancelled();
      }
      result_.deformation = deformed(result_.project, result_.mesh, part.stage(0.3, 1.0));
      if (result_.deformation.status == Status::cancelled) return cancelled();
      points = result_.deformation.points;
    }
    if (count == 0) result_.deformation = deformed(result_.project, result_.mesh, run);
    result_.status = result_.deformation.status;
    WarningList warnings = result_.mesh.warnings;
    warnings.append(result_.deformation.warnings);
    warnings.append(result_.warnings);
    result_.warnings = std::move(warnings);
    result_.overlap = overlap(border_outline(result_.mesh, points));
    run.report(1.0);
    return std::move(result_);
  }

 private:
  bool is_cancelled(const RunControl& run) const {
    return run.cancelled() || result_.mesh.status == Status::cancelled;
  }

  static AppliedTemplate cancelled() {
    AppliedTemplate result;
    result.status = Status::cancelled;
    return result;
  }

  bool match_parts(const RunControl& run) {
    parts_.from = parts_of(pose_.outline);
    parts_.to = parts_of(result_.mesh.outline);
    for (std::size_t i = 0; i < parts_.from.size(); ++i) {
      parts_.match.emplace_back();
      if (i >= parts_.to.size()) continue;
      try {
        parts_.match[i] =
            match_contours(pose_.outline.loops[parts_.from[i]],
                           result_.mesh.outline.loops[parts_.to[i]], options_.match, run);
      } catch (const AnalysisError&) {
        if (i == 0) throw;
        continue;
      }
      if (parts_.match[i]->status == Status::cancelled) return false;
    }
    if (!parts_.match.empty() && parts_.match[0])
      result_.match_confidence = parts_.match[0]->confidence;
    return true;
  }

  TransferredPins carry_pin(const WarpPin& pin, std::size_t part) const {
    const Points2& from = pose_.outline.loops[parts_.from[part]];
    const Points2& to = result_.mesh.outline.loops[parts_.to[std::min(part, parts_.to.size() - 1)]];
    if (!parts_.match[part]) return carried_by_box(from, {pin}, to);
    return transfer_pins(from, {pin}, to, *parts_.match[part], TargetRule::relative);
  }

  // `points`: the vertices as the stages before left them.
  void carry_stage(std::size_t s, const Points2& points) {
    const WarpStage& stage = pose_.project.stages[s];
    const PlanarMesh& mesh = result_.mesh.meshed.mesh;
    WarpStage made;
    made.mode = stage.mode;
    std::vector<AppliedPin> applied;
    for (std::size_t m = 0; m < stage.pins.size(); ++m) {
      const PoseTemplate::PinPlace& place = pose_.places[s][m];
      WarpPin pin = stage.pins[m];
      const RowVector2d way = pin.target - pin.source;
      pin.source = place.at_rest;
      pin.target = place.at_rest + way;
      const TransferredPins carried = carry_pin(pin, place.part);
      pin = carried.pins[0];
      const double ratio = ratio_of(place.part);
      MeshPoint where = closest_mesh_point(mesh, pin.source.transpose());
      RowVector2d inside = position(mesh.points, mesh.triangles, where).transpose();
      AppliedPin report{carried.confidence(0), 0.0};
      const double least = 1e-6 * box_diagonal(mesh.points);
      if (pin.kind == PinKind::interior && (inside - pin.source).norm() > least) {
        // A vertex on the border would leave the mesher with needles.
        where.weights.setConstant(1.0 / 3.0);
        inside = position(mesh.points, mesh.triangles, where).transpose();
        report.moved_px = (inside - pin.source).norm();
        result_.warnings.add("W_PIN_MOVED",
                             "pin " + (pin.name.empty() ? std::to_string(m) : pin.name),
                             "pins that fell outside went to the closest triangle");
      }
      const RowVector2d move = carried.pins[0].target - carried.pins[0].source;
      pin.source = position(points, mesh.triangles, where).transpose() + ratio * place.beside;
      pin.target = options_.rule == TargetRule::absolute ? stage.pins[m].target
                                                         : RowVector2d(pin.source + move);
      applied.push_back(report);
      made.pins.push_back(std::move(pin));
    }
    result_.project.stages.push_back(std::move(made));
    result_.pins.push_back(std::move(applied));
  }

  double ratio_of(std::size_t part) const {
    return loop_length(
               result_.mesh.outline.loops[parts_.to[std::min(part, parts_.to.size() - 1)]]) /
           loop_length(pose_.outline.loops[parts_.from[part]]);
  }

  Overlap overlap(Outline warped) const {
    Outline reference = pose_.warped;
    if (options_.rule == TargetRule::relative) {
      bring_to_unit(warped);
      bring_to_unit(reference);
    }
    return compute_overlap(warped, reference);
  }

  // Area 1, centre of the area at the origin.
  static void bring_to_unit(Outline& outline) {
    double area = 0.0;
    RowVector2d centre = RowVector2d::Zero();
    const RowVector2d base = outline.loops.at(0).row(0);
    for (const Points2& loop : outline.loops) {
      for (Index i = 0; i < loop.rows(); ++i) {
        const RowVector2d p = loop.row(i) - base;
        const RowVector2d q = loop.row((i + 1) % loop.rows()) - base;
        const double twice = p.x() * q.y() - p.y() * q.x();
        area += 0.5 * twice;
        centre += twice * (p + q) / 6.0;
      }
    }
    if (!(area > 0.0)) return;
    centre = base + centre / area;
    for (Points2& loop : outline.loops) loop = ((loop.rowwise() - centre) / std::sqrt(area)).eval();
  }

  const PoseTemplate& pose_;
  const Raster& image_;
  const ApplyOptions& options_;
  Parts parts_;
  AppliedTemplate result_;
};

}  // namespace

Outline border_outline(const ProjectMesh& mesh, const Points2& points) {
  return {border_loops(mesh.meshed.border, points), mesh.outline.component};
}

PoseTemplate make_pose_template(const WarpProject& project, const ProjectMesh& mesh,
                                RunControl run) {
  PoseTemplate pose;
  pose.project = project;
  pose.outline = mesh.outline;
  const std::vector<std::size_t> parts = parts_of(mesh.outline);
  const PlanarMesh& at_rest = mesh.meshed.mesh;
  PlanarMesh moved = at_rest;
  for (std::size_t s = 0; s < project.stages.size(); ++s) {
    std::vector<PoseTemplate::PinPlace> places;
    for (const WarpPin& pin : project.stages[s].pins) {
      const MeshPoint where = closest_mesh_point(moved, pin.source.transpose());
      PoseTemplate::PinPlace place;
      place.at_rest = position(at_rest.points, at_rest.triangles, where).transpose();
      place.beside = pin.source - position(moved.points, moved.triangles, where).transpose();
      if (pin.kind == PinKind::interior) place.beside.setZero();
      place.part = part_of(mesh, parts, where.triangle);
      places.push_back(place);
    }
    pose.places.push_back(std::move(places));
    const Deformation deformation = deformed(with_stages(project, s + 1), mesh, run);
    if (deformation.status == Status::cancelled) {
      pose = {};
      pose.status = Status::cancelled;
      return pose;
    }
    moved.points = deformation.points;
  }
  pose.warped = border_outline(mesh, moved.points);
  run.report(1.0);
  return pose;
}

AppliedTemplate apply_template(const PoseTemplate& pose, const WarpProject& target,
                               const Raster& image, const ApplyOptions& options, RunControl run) {
  if (pose.status != Status::ok || pose.outline.loops.empty() ||
      pose.places.size() != pose.project.stages.size())
    throw InvalidArgument("the template is not whole");
  return Application(pose, target, image, options).run(run);
}

}  // namespace dupin
