#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/npz.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/curvature.h"
#include "stack_options.h"

namespace dupin::cli {
namespace {

using Eigen::Index;

std::vector<double> to_vector(const Eigen::VectorXd& values) {
  return {values.data(), values.data() + values.size()};
}

NpyArray vector_array(const std::string& name, const Eigen::VectorXd& values) {
  return {name, {values.size()}, values};
}

// Rows of levels over the graph as rows over the input vertices; a vertex that was not analysed
// gets 0.
NpyArray level_array(const std::string& name, const LoadedSurface& surface,
                     const LevelMatrix& levels, double factor) {
  NpyArray array{name, {levels.rows(), surface.num_input_vertices}, {}};
  array.values.setZero(levels.rows(), surface.num_input_vertices);
  for (Index l = 0; l < levels.rows(); ++l) {
    array.values.row(l) = surface.to_input(factor * levels.row(l).transpose()).transpose();
  }
  return array;
}

struct Stacks {
  std::vector<ScaleSpace> columns;
  double seconds = 0.0;
};

Stacks compute(LoadedSurface& surface, const StackRequest& request, const SignalColumns& signal,
               Context& context) {
  Stacks stacks;
  const DiffusionOperator op = make_operator(surface, request, context);
  const auto start = std::chrono::steady_clock::now();
  const auto count = static_cast<double>(signal.columns.cols());
  for (Index c = 0; c < signal.columns.cols(); ++c) {
    const RunControl part = context.run.stage(0.25 + 0.7 * static_cast<double>(c) / count,
                                              0.25 + 0.7 * static_cast<double>(c + 1) / count);
    ScaleSpaceOptions options = stack_options(request);
    options.want_loc = request.signal != "tensor";
    stacks.columns.push_back(compute_scale_space(op, signal.columns.col(c), options, part));
    context.run.throw_if_cancelled();
  }
  stacks.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return stacks;
}

// F becomes the mean curvature of the smoothed tensors; k1, k2 and the direction of k1 come beside
// it.
std::vector<NpyArray> tensor_arrays(const LoadedSurface& surface, const Stacks& stacks,
                                    double to_input) {
  const Index num_levels = stacks.columns.front().levels.rows();
  const Index count = surface.graph.points.rows();
  LevelMatrix mean(num_levels, count);
  LevelMatrix k1(num_levels, count);
  LevelMatrix k2(num_levels, count);
  LevelMatrix direction[3] = {LevelMatrix(num_levels, count), LevelMatrix(num_levels, count),
                              LevelMatrix(num_levels, count)};
  for (Index l = 0; l < num_levels; ++l) {
    TensorField tensor(count, 6);
    for (Index c = 0; c < 6; ++c)
      tensor.col(c) = stacks.columns[static_cast<std::size_t>(c)].levels.row(l).transpose();
    const CurvatureField field = diagonalise(tensor, surface.graph.normals);
    mean.row(l) = field.mean().transpose();
    k1.row(l) = field.k1.transpose();
    k2.row(l) = field.k2.transpose();
    for (int k = 0; k < 3; ++k) direction[k].row(l) = field.d1.col(k).transpose();
  }
  return {level_array("F", surface, mean, to_input),
          level_array("k1", surface, k1, to_input),
          level_array("k2", surface, k2, to_input),
          level_array("d1x", surface, direction[0], 1.0),
          level_array("d1y", surface, direction[1], 1.0),
          level_array("d1z", surface, direction[2], 1.0)};
}

std::vector<NpyArray> scalar_arrays(const LoadedSurface& surface, const Stacks& stacks,
                                    const SignalColumns& signal) {
  std::vector<NpyArray> arrays;
  for (std::size_t c = 0; c < stacks.columns.size(); ++c) {
    const std::string suffix = stacks.columns.size() == 1 ? "" : std::to_string(c);
    const ScaleSpace& stack = stacks.columns[c];
    const double scale = signal.columns.col(static_cast<Index>(c)).cwiseAbs().maxCoeff();
    arrays.push_back(level_array("F" + suffix, surface, stack.levels, signal.to_input));
    arrays.push_back(level_array("loc" + suffix, surface, stack.loc, signal.to_input));
    arrays.push_back(
        level_array("si_loc" + suffix, surface, scale_invariant_loc(stack.loc, scale), 1.0));
  }
  return arrays;
}

void run_scalespace(Context& context, const StackRequest& request, const std::string& output) {
  if (!output.empty()) output_format(context, output, "", {"npz"});
  LoadedSurface surface;
  Stacks stacks;
  std::vector<NpyArray> arrays;
  with_progress(context, "scale space", [&] {
    surface = load_surface(request.mesh, context, request.neighbors);
    const SignalColumns signal = make_signal(surface, request, context);
    stacks = compute(surface, request, signal, context);
    if (output.empty()) return;
    arrays = request.signal == "tensor" ? tensor_arrays(surface, stacks, signal.to_input)
                                        : scalar_arrays(surface, stacks, signal);
    const ScaleSpace& first = stacks.columns.front();
    arrays.push_back(vector_array("tau", first.tau));
    arrays.push_back(
        vector_array("t_thesis", level_scales(request.schedule, ScaleMeasure::thesis)));
    arrays.push_back(vector_array("lambda", first.lambda));
    Eigen::VectorXd analysed = Eigen::VectorXd::Ones(surface.graph.points.rows());
    arrays.push_back(vector_array("analysed", surface.to_input(analysed)));
    for (const NpyArray& array : arrays) {
      const double* const values = array.values.data();
      require_range(std::all_of(values, values + array.values.size(),
                                [](double x) { return std::isfinite(x); }),
                    "a value of " + array.name, request.mesh);
    }
    if (!context.run.cancelled()) write_npz(output, arrays);
  });
  const ScaleSpace& first = stacks.columns.front();
  context.print_json({{"levels", request.schedule.num_levels},
                      {"vertices", surface.num_input_vertices},
                      {"degree", first.degree},
                      {"tolerance", request.tolerance},
                      {"error_bound", first.error_bound},
                      {"seconds", stacks.seconds},
                      {"mean_edge_length", surface.graph.mean_edge * surface.unit},
                      {"tau", to_vector(first.tau)},
                      {"t_thesis", to_vector(level_scales(request.schedule, ScaleMeasure::thesis))},
                      {"warnings", to_json(surface.warnings)}});
  context.say(fmt::format("{} levels on {} vertices, degree {}, {:.3f} s",
                          request.schedule.num_levels, surface.num_input_vertices, first.degree,
                          stacks.seconds));
  if (!output.empty()) context.say(fmt::format("written: {}", output));
}

}  // namespace

void add_scalespace(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("scalespace", "A signal of the surface at every scale");
  verb->footer(
      "Example:\n  dupin scalespace bunny.off -o stack.npz\n\nThe npz holds F (levels x vertices), "
      "loc and si_loc (one level less), "
      "tau, t_thesis, lambda, and analysed: 0 for vertices that no face uses.");
  add_global_options(*verb, context);
  add_input_format(*verb, context);
  auto request = std::make_shared<StackRequest>();
  auto output = std::make_shared<std::string>();
  add_stack_options(*verb, *request);
  verb->add_option("-o,--output", *output, "NumPy archive (.npz) to write");
  verb->callback([request, output, &context] { run_scalespace(context, *request, *output); });
}

}  // namespace dupin::cli
