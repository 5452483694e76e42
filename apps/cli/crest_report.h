#pragma once

#include <string>
#include <vector>

#include "context.h"
#include "dupin/crest/crest_lines.h"
#include "dupin/crest/crest_noise.h"
#include "dupin/render/scene.h"
#include "surface_input.h"

namespace dupin::cli {

/// What `dupin crest` found on one surface.
struct CrestAnalysis {
  LoadedSurface surface;
  CrestSet set;
  double sigma = 0.0;                         ///< noise of every coordinate [local]
  std::vector<CrestUncertainty> uncertainty;  ///< aligned with the lines, or empty
};

/// A surface of a page: that of the file, or a copy with noise.
struct CrestSubject {
  CrestAnalysis found;
  double added_percent = 0.0;  ///< of the mean edge; 0: as it is
};

/// Ridge or valley.
const char* kind_name(const CrestLine& line);

/// Adds the lines to a scene, in the unit of the input, as thick as their scales.
void add_crest_lines(Scene& scene, const LoadedSurface& surface, const CrestSet& set);

/// Writes a page with the lines of `subjects`, of two sides each, and tables of them; the pictures
/// are beside it, PAGE-1.png and so on. `view` as camera_of() knows it.
void write_crest_report(const std::string& page, const std::string& mesh, const std::string& view,
                        const std::vector<CrestSubject>& subjects, Context& context);

}  // namespace dupin::cli
