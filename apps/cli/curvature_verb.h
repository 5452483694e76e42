#pragma once

#include <string>

#include "context.h"
#include "dupin/mls/mls_patch.h"

namespace dupin::cli {

/// What `dupin curvature` and `dupin mls curvature` are asked for.
struct CurvatureRequest {
  std::string mesh;
  std::string output;
  std::string method = "taubin";  ///< taubin, mls, jet
  MlsOptions patch;               ///< mls, jet
};

/// --neighbors, --radius, --patch-weights, --weight-width of everything that fits patches.
void add_patch_options(CLI::App& verb, MlsOptions& options);

/// Points by the coefficients that their neighbourhood determined.
nlohmann::ordered_json count_orders(const Eigen::VectorXi& order);

/// Estimates, writes and prints.
void run_curvature(Context& context, const CurvatureRequest& request);

}  // namespace dupin::cli
