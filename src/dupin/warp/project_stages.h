#pragma once

#include <optional>
#include <vector>

#include "dupin/base/warning.h"
#include "dupin/warp/deform.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/project.h"

namespace dupin {

/// The stages of a project as deform() takes them, one for one: of a coarse stage the interior
/// pins, of a fine one the exterior pins, each loop number one closed control polygon in the order
/// of the list. Pins without a name are called by their number, and their stage where there are
/// several.
/// @param anchors  of the pins of the first stage that has any, as ProjectMesh::anchors; or none
/// @throws InvalidArgument for anchors of another number of pins
std::vector<DeformStage> stages_of(const WarpProject& project,
                                   const std::vector<std::optional<MeshPoint>>& anchors = {});

/// Throws if the tables of the largest stage would take more than 4 GB: distances and weights, #V
/// by pins and samples of control lines. A project may ask for far more than a computer has.
/// @throws Error(Errc::over_limit) E_TOO_LARGE. Cost: O(stages).
void require_tables(const PlanarMesh& mesh, const std::vector<DeformStage>& stages);

/// W_PIN_IGNORED, if stages have pins of the other kind, which move nothing there.
WarningList ignored_pins(const WarpProject& project);

/// arap: moving least squares and ARAP inside the shape, fold-overs taken out. mls: the former
/// alone. image_mls: the same with straight distances, through gaps. These two for comparison, so
/// fold-overs stay in.
DeformOptions deform_options_of(const WarpProject& project);

}  // namespace dupin
