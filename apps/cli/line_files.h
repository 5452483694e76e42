#pragma once

#include <string>
#include <vector>

#include "dupin/crest/crest_lines.h"
#include "dupin/io/read_options.h"
#include "dupin/render/scene.h"

namespace dupin::cli {

/// A crest line as files hold it, in the unit of the input.
struct LineRecord {
  CrestKind kind = CrestKind::ridge;
  Points points;                    ///< #P by 3; a closed line repeats its first
  std::vector<double> scale;        ///< #P
  std::vector<double> strength;     ///< #P
  std::vector<double> strength_sd;  ///< #P; -1: not known
};

/// OBJ: one `l` element a line, in groups `ridge` and `valley`.
std::string lines_as_obj(const std::vector<LineRecord>& lines);

/// PLY (ascii): element vertex with x, y, z, kind (0 ridge, 1 valley), line, strength, scale, sd;
/// element edge with vertex1, vertex2 and the same of its middle.
std::string lines_as_ply(const std::vector<LineRecord>& lines);

/// Lines of an OBJ or an ascii PLY file. Where vertices have a `scale` (PLY) lines are `width`
/// pixels wide at their median, in proportion elsewhere but a third to three times of it.
/// @throws IoError if the file is malformed
std::vector<ScenePolyline> read_lines(const std::string& path, double width,
                                      const ReadLimits& limits);

/// Colour of a kind in pictures.
Rgb crest_color(CrestKind kind);

/// Widths of the points of all lines for pictures, see read_lines().
void set_widths(std::vector<ScenePolyline>& lines, const std::vector<std::vector<double>>& scales,
                double width);

}  // namespace dupin::cli
