#include "surface_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "dupin/mesh/heal.h"
#include "dupin/surface/signal_noise.h"

namespace dupin::cli {
namespace {

using Eigen::Index;

// Points with finite coordinates; the reader has already refused others unless it was told to leave
// them.
std::vector<std::int32_t> finite_points(const Points& points) {
  std::vector<std::int32_t> kept;
  for (Index v = 0; v < points.rows(); ++v) {
    if (std::isfinite(points(v, 0)) && std::isfinite(points(v, 1)) && std::isfinite(points(v, 2))) {
      kept.push_back(static_cast<std::int32_t>(v));
    }
  }
  return kept;
}

// Local coordinates of a cloud by a power of two and, where it lies far from the origin, a shift:
// as heal() does for surfaces.
void localise(LoadedSurface& out) {
  const Eigen::RowVector3d low = out.points.colwise().minCoeff();
  const Eigen::RowVector3d high = out.points.colwise().maxCoeff();
  // Halves first: the sum of two large coordinates may overflow.
  const Eigen::RowVector3d middle = 0.5 * low + 0.5 * high;
  const double extent = (0.5 * high - 0.5 * low).maxCoeff();
  if (!(extent > 0.0)) {
    throw AnalysisError("E_ALL_DEGENERATE", "all points are at one place");
  }
  Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
  for (Index k = 0; k < 3; ++k) {
    if (std::abs(middle[k]) > 2.0 * extent) shift[k] = middle[k];
  }
  int exponent = 0;
  std::frexp(extent, &exponent);
  out.unit = std::ldexp(1.0, exponent);
  out.graph.points.resize(out.points.rows(), 3);
  for (Index v = 0; v < out.points.rows(); ++v) {
    for (Index k = 0; k < 3; ++k)
      out.graph.points(v, k) = std::ldexp(out.points(v, k) - shift[k], -exponent);
  }
}

LoadedSurface cloud_surface(const SurfaceFile& file, const std::string& path, Context& context,
                            int neighbors) {
  LoadedSurface out;
  out.num_input_vertices = file.mesh.points.rows();
  out.input_points = file.mesh.points;
  out.input_vertex = finite_points(file.mesh.points);
  if (out.input_vertex.empty()) throw AnalysisError("E_NO_VERTICES", "the file has no points");
  const auto dropped = out.num_input_vertices - static_cast<Index>(out.input_vertex.size());
  Index first_dropped = 0;
  while (first_dropped < static_cast<Index>(out.input_vertex.size()) &&
         out.input_vertex[static_cast<std::size_t>(first_dropped)] == first_dropped) {
    ++first_dropped;
  }
  out.warnings.add("W_NONFINITE_DROPPED", fmt::format("point {}", first_dropped),
                   "points that are not finite were dropped", dropped);
  context.report(path, out.warnings);
  out.analysis_vertex.assign(static_cast<std::size_t>(out.num_input_vertices), -1);
  PointCloud cloud;
  const auto count = static_cast<Index>(out.input_vertex.size());
  out.points.resize(count, 3);
  const bool has_normals = file.mesh.normals.rows() == out.num_input_vertices;
  out.has_given_normals = has_normals;
  if (has_normals) cloud.normals.resize(count, 3);
  for (Index a = 0; a < count; ++a) {
    const std::int32_t v = out.input_vertex[static_cast<std::size_t>(a)];
    out.analysis_vertex[static_cast<std::size_t>(v)] = static_cast<std::int32_t>(a);
    out.points.row(a) = file.mesh.points.row(v);
    if (has_normals) cloud.normals.row(a) = file.mesh.normals.row(v);
  }
  localise(out);
  if (neighbors == 0 && !has_normals) {
    out.graph.triangles.resize(0, 3);
    out.graph.normals.resize(0, 3);
    return out;
  }
  cloud.points = out.graph.points;
  CloudGraphOptions options;
  if (neighbors > 0) options.neighbors = neighbors;
  out.graph = surface_graph(cloud, options, context.run.stage(0.1, 0.2));
  context.run.throw_if_cancelled();
  WarningList of_normals;
  of_normals.add("W_NORMAL_LENGTH", place_of(out, out.graph.first_rescaled_normal),
                 "normals that are no unit vectors were rescaled", out.graph.num_rescaled_normals);
  of_normals.add("W_NORMAL_ESTIMATED", place_of(out, out.graph.first_estimated_normal),
                 "normals that are zero or not finite were estimated",
                 out.graph.num_estimated_normals);
  context.report(path, of_normals);
  out.warnings.append(of_normals);
  return out;
}

}  // namespace

Eigen::VectorXd LoadedSurface::to_input(const Eigen::VectorXd& values, double missing) const {
  Eigen::VectorXd result = Eigen::VectorXd::Constant(num_input_vertices, missing);
  for (Index v = 0; v < num_input_vertices; ++v) {
    const std::int32_t a = analysis_vertex[static_cast<std::size_t>(v)];
    if (a >= 0) result[v] = values[a];
  }
  return result;
}

NoiseLevel noise_level_of(LoadedSurface& surface, const NoiseLevelOptions& options,
                          const Context& context, const RunControl& run) {
  const NoiseLevel level = estimate_noise(surface.graph.points, options, run);
  WarningList repeated;
  repeated.add("W_REPEATED_POINT", place_of(surface, level.first_repeated),
               "points at the place of another were left out of the noise", level.num_repeated);
  context.report(context.input, repeated);
  surface.warnings.append(repeated);
  return level;
}

const std::vector<std::string>& surface_extensions() {
  static const std::vector<std::string> names = {"ply", "obj", "off", "stl", "glb"};
  return names;
}

double require_comparable_noise(double sigma) {
  if (!(sigma <= 1e3))
    throw InvalidArgument("noise is more than 1000 times the size of the surface",
                          "it is a length in the unit of the input");
  return sigma < 1e-15 ? 0.0 : sigma;
}

double noise_sigma_of(const std::string& noise, LoadedSurface& surface, const Context& context,
                      const RunControl& run) {
  if (noise.empty() || noise == "auto") {
    NoiseLevelOptions options;
    options.seed = context.seed;
    const NoiseLevel level = noise_level_of(surface, options, context, run);
    return std::max(level.sigma, estimate_rounding(surface.points) / surface.unit);
  }
  double sigma = 0.0;
  const char* end = noise.data() + noise.size();
  const auto parsed = std::from_chars(noise.data(), end, sigma);
  if (parsed.ec != std::errc() || parsed.ptr != end || !std::isfinite(sigma) || sigma < 0.0) {
    throw InvalidArgument("noise is \"" + escaped(noise, 40) +
                          "\", expected auto or a length >= 0 in the unit of the input");
  }
  return require_comparable_noise(sigma / surface.unit);
}

std::string place_of(const LoadedSurface& surface, Index vertex) {
  if (vertex < 0) return "nowhere";
  return fmt::format("{} {}", surface.graph.is_mesh() ? "vertex" : "point",
                     surface.input_vertex[static_cast<std::size_t>(vertex)]);
}

LoadedSurface to_loaded_surface(const PolygonMesh& mesh, const std::string& name,
                                Context& context) {
  HealOptions options;
  options.drop_nonfinite = context.read.drop_nonfinite;
  HealedSurface healed = heal(mesh, options, context.run.stage(0.1, 0.2));
  context.run.throw_if_cancelled();
  context.report(name, healed.warnings);
  LoadedSurface out;
  out.warnings = healed.warnings;
  out.graph = surface_graph(healed.mesh, healed.is_guarded);
  out.unit = healed.unit();
  out.num_input_vertices = healed.num_input_vertices;
  out.input_points = mesh.points;
  out.points.resize(healed.mesh.points.rows(), 3);
  for (Index a = 0; a < out.points.rows(); ++a)
    out.points.row(a) = healed.to_input(healed.mesh.points.row(a));
  out.input_vertex = std::move(healed.input_vertex);
  out.analysis_vertex = std::move(healed.analysis_vertex);
  return out;
}

Error in_file(const Error& error, const std::string& file) {
  Location location = error.location();
  const bool has_place = error.errc() != Errc::usage && error.errc() != Errc::interrupted;
  if (location.file.empty() && has_place) location.file = file;
  return {error.errc(), error.code(), error.what(), location, error.hint()};
}

void require_range(bool is_finite, const std::string& what, const std::string& file) {
  if (is_finite) return;
  throw Error(Errc::numerical, "E_RANGE", what + " is too large for a double", {file, 0, -1},
              "use a larger unit of length");
}

namespace {

LoadedSurface load(const std::string& path, Context& context, int neighbors) {
  const SurfaceFile file = read_surface(path, context.read, context.run.stage(0.0, 0.1));
  context.run.throw_if_cancelled();
  context.report(path, file.warnings);
  LoadedSurface out = file.mesh.num_faces() == 0 ? cloud_surface(file, path, context, neighbors)
                                                 : to_loaded_surface(file.mesh, path, context);
  WarningList all = file.warnings;
  all.append(out.warnings);
  out.warnings = all;
  return out;
}

}  // namespace

LoadedSurface load_surface(const std::string& path, Context& context, int neighbors) {
  context.input = path;
  try {
    return load(path, context, neighbors);
  } catch (const Error& error) {
    throw in_file(error, path);
  }
}

}  // namespace dupin::cli
