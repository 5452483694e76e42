#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "context.h"
#include "dupin/base/warning.h"
#include "dupin/mesh/polygon_mesh.h"
#include "dupin/mls/noise_level.h"
#include "dupin/surface/surface_graph.h"

namespace dupin::cli {

/// A surface as the verbs need it: read, repaired, in local coordinates, with the way back to the
/// input.
struct LoadedSurface {
  SurfaceGraph graph;                      ///< #A vertices in local coordinates
  Points points;                           ///< #A by 3, input unit, aligned with graph.points
  double unit = 1.0;                       ///< input length of one local length, a power of two
  std::vector<std::int32_t> input_vertex;  ///< #A: vertex of the input
  std::vector<std::int32_t>
      analysis_vertex;  ///< #V: vertex of the graph, or -1 (isolated, dropped)
  Eigen::Index num_input_vertices = 0;
  bool has_given_normals = false;  ///< of a cloud: the file says which side is outward
  Points input_points;             ///< #V by 3 as given
  WarningList warnings;            ///< of reading and repairing

  /// A per-vertex value of the graph in the numbering of the input; `missing` where there is none.
  Eigen::VectorXd to_input(const Eigen::VectorXd& values, double missing = 0.0) const;
};

/// `error` with `file` as its place if it has none: what the analysis says of a surface says
/// nothing of its file. Usage errors and interruptions have no place.
Error in_file(const Error& error, const std::string& file);

/// @throws Error(Errc::numerical) E_RANGE unless `is_finite`, which says so of all results of
/// `file` in its own unit
void require_range(bool is_finite, const std::string& what, const std::string& file);

/// Extensions of the surfaces that the program writes, as surface_format_of() knows them.
const std::vector<std::string>& surface_extensions();

/// A noise level in local units, where a surface is about one across: 0 if rounding hides it.
/// @throws InvalidArgument above 1000, where no first order and no square of it means anything
double require_comparable_noise(double sigma);

/// What --noise says, in local units: empty or "auto" is estimate_noise(), at least the rounding of
/// the coordinates (no file holds its points better), anything else a length.
/// @throws InvalidArgument for another word, a negative length, or as require_comparable_noise();
///   AnalysisError as estimate_noise()
double noise_sigma_of(const std::string& noise, LoadedSurface& surface, const Context& context,
                      const RunControl& run);

/// A vertex of the analysis as people know it: "vertex 5" or "point 5" of the input.
std::string place_of(const LoadedSurface& surface, Eigen::Index vertex);

/// estimate_noise() of a surface in local units; points that repeat others are reported and added
/// to its warnings.
NoiseLevel noise_level_of(LoadedSurface& surface, const NoiseLevelOptions& options,
                          const Context& context, const RunControl& run);

/// Reads and repairs a surface; a file without faces becomes a cloud with `neighbors` in a ring.
/// Warnings go to `context` as well. 0 neighbors: bare points get neither a ring nor normals.
/// @throws Error of read_surface(), heal(), build_cloud_graph(); Errc::interrupted when cancelled
LoadedSurface load_surface(const std::string& path, Context& context, int neighbors = 8);
/// The same of a mesh at hand.
LoadedSurface to_loaded_surface(const PolygonMesh& mesh, const std::string& name, Context& context);

}  // namespace dupin::cli
