#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/base/warning.h"
#include "dupin/image/raster.h"
#include "dupin/warp/deform.h"
#include "dupin/warp/project.h"
#include "dupin/warp/project_mesh.h"
#include "dupin/warp/warp_render.h"

namespace dupin::cli {

/// A picture as read. Its file was opened once: pixels and digest are of the same bytes.
struct LoadedPicture {
  std::string file;
  std::string sha256;
  Raster raster;
  WarningList warnings;  ///< of reading; reported already
};

/// Reads a PNG; errors name it, warnings are reported. "-" is standard input.
/// @throws as read_png()
LoadedPicture load_picture(const std::string& file, Context& context, const RunControl& run = {});

/// A project and the picture that it names.
struct WarpInput {
  std::string file;  ///< of the project; what messages name
  WarpProject project;
  LoadedPicture picture;
};

/// Reads a project alone. @throws IoError as FileBytes::open() and parse_project()
WarpProject load_project(const std::string& file, Context& context);

/// Reads a project, and the picture it names: relative to the project, with the bytes and the size
/// that the project says.
/// @throws as load_project() and load_picture(); AnalysisError E_IMAGE_CHANGED
WarpInput load_warp(const std::string& file, Context& context, const RunControl& run = {});

/// Whether the file begins as a PNG does. @throws IoError as FileBytes::open()
bool is_png_file(const std::string& file, const Context& context);

/// A path without links and detours, also of a file that is not there.
std::string whole_path(const std::string& path);

/// How a project at `project_file` names the picture: relative to its folder.
std::string picture_path(const std::string& picture_file, const std::string& project_file);

/// A project with the default settings for `picture`, to be written to `project_file`.
/// @throws InvalidArgument if the picture is standard input, or its path cannot be in a project
WarpProject new_project(const LoadedPicture& picture, const std::string& project_file);

/// All the text of a file. @throws IoError as FileBytes::open()
std::string read_text(const std::string& file, Context& context);

/// make_project_mesh() of the input, whose file an error names; warnings are reported.
/// @throws Error(Errc::interrupted) when cancelled
ProjectMesh mesh_of(const WarpInput& input, Context& context, const RunControl& run);

/// deform() by the stages of the project, the same way.
Deformation deformation_of(const WarpInput& input, const ProjectMesh& mesh,
                           bool is_unanchored_allowed, Context& context, const RunControl& run);

/// Adds W_CUT_OFF, if vertices lie outside the output by more than the margin of the contour.
void warn_of_cut(const WarpProject& project, const Points2& points, const WarpView& view,
                 WarningList& warnings);

/// Refuses outputs that are one of the inputs, or each other, or cannot be written; empty ones are
/// none. @throws InvalidArgument; IoError E_WRITE
void require_outputs(const std::vector<std::string>& outputs,
                     const std::vector<std::string>& inputs);

/// --method arap|mls|image-mls; `method` empty: what the project says.
void add_method_option(CLI::App& verb, std::string& method);
void set_method(WarpProject& project, const std::string& method);

/// "image", "components", "components_left_out", "area", "holes", "contour_length", "vertices",
/// "triangles", "spacing", angles: what is known before any pin moves.
nlohmann::ordered_json shape_json(const WarpInput& input, const ProjectMesh& mesh);
/// The same for people, in two lines.
void say_shape(const Context& context, const WarpInput& input, const ProjectMesh& mesh);

/// Sum of the lengths of the loops [px].
double contour_length(const Outline& outline);

/// Pins of all stages.
std::vector<WarpPin> all_pins(const WarpProject& project);

}  // namespace dupin::cli
