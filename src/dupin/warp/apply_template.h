#pragma once

#include <Eigen/Core>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/base/status.h"
#include "dupin/base/warning.h"
#include "dupin/image/raster.h"
#include "dupin/warp/contour_match.h"
#include "dupin/warp/deform.h"
#include "dupin/warp/pin_transfer.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/project.h"
#include "dupin/warp/project_mesh.h"
#include "dupin/warp/silhouette_fit.h"

namespace dupin {

/// The pose of a project, ready to be given to other pictures.
struct PoseTemplate {
  Status status = Status::ok;  ///< cancelled: nothing is valid
  WarpProject project;
  Outline outline;  ///< as meshed
  /// Where pins are on the shape at rest: stage by stage, pin by pin, whatever the stages before
  /// did to it.
  struct PinPlace {
    Eigen::RowVector2d at_rest = Eigen::RowVector2d::Zero();  ///< [px]
    Eigen::RowVector2d beside = Eigen::RowVector2d::Zero();   ///< of pins outside, from there [px]
    std::size_t part = 0;                                     ///< of the shape, 0 the largest
  };
  std::vector<std::vector<PinPlace>> places;
  Outline warped;  ///< the outline as the pose leaves it
};

/// @param mesh make_project_mesh() of `project`
/// @throws as deform()
PoseTemplate make_pose_template(const WarpProject& project, const ProjectMesh& mesh,
                                RunControl run = {});

struct ApplyOptions {
  TargetRule rule = TargetRule::relative;
  ContourMatchOptions match;
};

/// A pin of a template on another shape.
struct AppliedPin {
  double confidence = 0.0;  ///< to be within 3 % of the height, as TransferredPlaces
  double moved_px = 0.0;    ///< to the closest triangle, 0 where it was inside
};

/// A template on another picture.
struct AppliedTemplate {
  Status status = Status::ok;  ///< cancelled: nothing is valid; not_converged: of the deformation
  WarpProject project;         ///< with the stages
  ProjectMesh mesh;            ///< of it
  Deformation deformation;     ///< of it: what the project gives by itself
  std::vector<std::vector<AppliedPin>> pins;  ///< stage by stage
  double match_confidence = 0.0;              ///< of the contours of the largest parts
  /// Of the warped shape (a) and that of the template (b). Rule relative: brought to one area and
  /// one centre before.
  Overlap overlap;
  WarningList warnings;  ///< W_PIN_MOVED and all of the mesh and the deformation
};

/// Gives the pose of a template to the shape in another picture: the contours of their parts are
/// matched in order of size, pins are carried along (transfer_pins), interior ones that fall
/// outside go to the middle of the closest triangle, and stages run one after the other, each on
/// what the one before left.
/// @param target settings and picture of the new project; its stages are replaced
/// @throws as make_project_mesh(), match_contours() and deform()
/// Cost: two meshes and one deformation a stage.
AppliedTemplate apply_template(const PoseTemplate& pose, const WarpProject& target,
                               const Raster& image, const ApplyOptions& options = {},
                               RunControl run = {});

/// The outline of a mesh with its vertices at `points`.
Outline border_outline(const ProjectMesh& mesh, const Points2& points);

}  // namespace dupin
