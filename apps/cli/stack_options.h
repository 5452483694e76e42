#pragma once

#include <optional>
#include <string>

#include "context.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/surface/surface_graph.h"
#include "surface_input.h"

namespace dupin::cli {

/// The options that scalespace and keypoints share.
struct StackRequest {
  std::string mesh;
  LevelSchedule schedule;
  std::string weights = "umbrella";
  std::string signal = "height";
  std::string filter = "implicit";
  double tolerance = 1e-8;
  int normal_smoothing = 6;
  int neighbors = 8;
};

void add_stack_options(CLI::App& verb, StackRequest& request);

/// The operator of a surface. Clamped cotan weights and masses are reported and added to its
/// warnings.
DiffusionOperator make_operator(LoadedSurface& surface, const StackRequest& request,
                                const Context& context);

/// Columns to be smoothed (#A by C) in local units, and what one local unit of them is in the
/// input.
struct SignalColumns {
  Eigen::MatrixXd columns;
  double to_input = 1.0;
  int length_power = 1;  ///< the signal is 1 / length^length_power; 0 of a file: it is its own unit
};

/// The signal of `request`: a name of Signal, "tensor" (six columns) or an .npy file with a row for
/// every input vertex.
/// @throws InvalidArgument for an unknown name; IoError or AnalysisError E_SIZE for a file that
/// does not fit
SignalColumns make_signal(const LoadedSurface& surface, const StackRequest& request,
                          Context& context);

/// The library's signal of this name, if it is one of those whose noise the library knows.
std::optional<Signal> library_signal(const std::string& name);

/// Options of the library from those of the command line.
ScaleSpaceOptions stack_options(const StackRequest& request);

}  // namespace dupin::cli
