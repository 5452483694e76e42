#include "stack_options.h"

#include <fmt/format.h>

#include <map>

#include "dupin/base/error.h"
#include "dupin/io/npz.h"
#include "dupin/mls/mls_surface.h"
#include "dupin/surface/curvature.h"
#include "dupin/surface/laplacian.h"

namespace dupin::cli {
namespace {

using Eigen::Index;

const std::map<std::string, Signal>& signal_names() {
  static const std::map<std::string, Signal> names{{"height", Signal::height},
                                                   {"H", Signal::mean},
                                                   {"K", Signal::gauss},
                                                   {"k1", Signal::k1},
                                                   {"k2", Signal::k2}};
  return names;
}

bool is_array_file(const std::string& name) {
  return name.size() > 4 && name.compare(name.size() - 4, 4, ".npy") == 0;
}

SignalColumns signal_from_file(const LoadedSurface& surface, const std::string& path,
                               const Context& context) {
  const NpyArray array = read_npy(path, context.read.limits, context.run);
  const RowMatrixXd& values = array.values;
  if (values.rows() != surface.num_input_vertices) {
    throw Error(Errc::impossible, "E_SIZE",
                fmt::format("{} rows, but the surface has {} vertices", values.rows(),
                            surface.num_input_vertices),
                {path, 0, -1}, "one row for every vertex of the input, in its order");
  }
  SignalColumns signal;
  signal.length_power = 0;
  signal.columns.resize(surface.graph.points.rows(), values.cols());
  for (Index a = 0; a < signal.columns.rows(); ++a) {
    signal.columns.row(a) = values.row(surface.input_vertex[static_cast<std::size_t>(a)]);
  }
  return signal;
}

}  // namespace

void add_stack_options(CLI::App& verb, StackRequest& request) {
  verb.add_option("MESH", request.mesh, "Surface or point cloud; - reads standard input")
      ->required();
  verb.add_option("--levels", request.schedule.num_levels, "Levels of the stack")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--lambda0", request.schedule.lambda0, "First time step, in squared mean edges")
      ->check(in_range(1e-300, 1e9))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option_function<double>(
          "--delta",
          [&request](double delta) {
            if (!(delta > 1.0))
              throw InvalidArgument(fmt::format("delta is {}, legal range > 1", delta));
            request.schedule.delta = delta;
          },
          "Growth of the time steps, > 1 (default 1.2)")
      ->group("Stack");
  verb.add_option("--weights", request.weights, "Laplacian")
      ->check(CLI::IsMember({"umbrella", "cotan"}))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--signal", request.signal,
                  "height, H, K, k1, k2, mls-H, mls-K (patches), tensor (scalespace) or FILE.npy")
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--filter", request.filter, "implicit: the thesis's; heat: exact diffusion")
      ->check(CLI::IsMember({"implicit", "heat"}))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--tolerance", request.tolerance,
                  "Truncation error relative to the norm of the signal")
      ->check(in_range(1e-14, 0.1))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--normal-smoothing", request.normal_smoothing,
                  "Times that normals are averaged for height")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str()
      ->group("Stack");
  verb.add_option("--neighbors", request.neighbors, "Points in the ring of a point of a cloud")
      ->check(CLI::Range(3, 100))
      ->capture_default_str()
      ->group("Stack");
}

DiffusionOperator make_operator(LoadedSurface& surface, const StackRequest& request,
                                const Context& context) {
  const SurfaceGraph& graph = surface.graph;
  if (request.weights == "umbrella") {
    return umbrella_operator(graph.topology.ring, graph.is_mesh() ? &graph.topology : nullptr);
  }
  if (!graph.is_mesh()) {
    throw AnalysisError("E_NO_FACES", "cotan weights need faces, this is a point cloud",
                        "--weights umbrella");
  }
  const CotanWeights cotan = cotan_weights({graph.points, graph.triangles}, graph.topology);
  WarningList clamped;
  clamped.add("W_WEIGHT_CLAMPED", "edge at " + place_of(surface, cotan.first_clamped_weight),
              "negative or needle cotan weights were clamped", cotan.num_clamped_weights);
  clamped.add("W_MASS_CLAMPED", place_of(surface, cotan.first_clamped_mass),
              "vertex areas below 5 % of the mean were raised", cotan.num_clamped_masses);
  context.report(request.mesh, clamped);
  surface.warnings.append(clamped);
  return cotan_operator(graph.topology.ring, cotan, graph.mean_edge);
}

SignalColumns make_signal(const LoadedSurface& surface, const StackRequest& request,
                          Context& context) {
  const SurfaceGraph& graph = surface.graph;
  if (is_array_file(request.signal)) return signal_from_file(surface, request.signal, context);
  SignalColumns signal;
  signal.to_input = 1.0 / surface.unit;
  if (request.signal == "tensor") {
    if (!graph.is_mesh()) {
      throw AnalysisError("E_NO_FACES", "the curvature tensor needs faces, this is a point cloud",
                          "--signal height");
    }
    const CurvatureField field = estimate_curvature_taubin(
        {graph.points, graph.triangles}, graph.topology, context.run.stage(0.2, 0.25));
    context.run.throw_if_cancelled();
    signal.columns = curvature_tensor(field);
    return signal;
  }
  if (request.signal == "mls-H" || request.signal == "mls-K") {
    const MlsCurvature patches = estimate_curvature_mls(
        graph.points, graph.normals, {.want_deviations = false}, context.run.stage(0.2, 0.25));
    context.run.throw_if_cancelled();
    const bool is_mean = request.signal == "mls-H";
    signal.columns = is_mean ? patches.field.mean() : patches.field.gauss();
    if (!is_mean) signal.to_input /= surface.unit;
    return signal;
  }
  const auto named = signal_names().find(request.signal);
  if (named == signal_names().end()) {
    throw InvalidArgument("signal is \"" + escaped(request.signal, 40) +
                          "\", legal: height, H, K, k1, k2, mls-H, mls-K, tensor, FILE.npy");
  }
  signal.columns =
      compute_signal(graph, named->second, request.normal_smoothing, context.run.stage(0.2, 0.25));
  context.run.throw_if_cancelled();
  if (named->second == Signal::gauss) {
    signal.to_input /= surface.unit;
    signal.length_power = 2;
  }
  return signal;
}

std::optional<Signal> library_signal(const std::string& name) {
  const auto named = signal_names().find(name);
  if (named == signal_names().end()) return std::nullopt;
  return named->second;
}

ScaleSpaceOptions stack_options(const StackRequest& request) {
  ScaleSpaceOptions options;
  options.schedule = request.schedule;
  options.filter = request.filter == "heat" ? Filter::heat : Filter::implicit;
  options.tolerance = request.tolerance;
  return options;
}

}  // namespace dupin::cli
