#include "dupin/surface/curvature.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "context.h"
#include "dupin/base/error.h"
#include "dupin/io/surface_io.h"
#include "surface_input.h"

namespace dupin::cli {
namespace {

struct CurvatureRequest {
  std::string mesh;
  std::string output;
  std::string method = "taubin";
};

nlohmann::ordered_json summary(const Eigen::VectorXd& values) {
  return {{"min", values.minCoeff()}, {"max", values.maxCoeff()}, {"mean", values.mean()}};
}

// Values of the estimated vertices only, in the unit of the input.
Eigen::VectorXd estimated(const CurvatureField& field, const Eigen::VectorXd& values,
                          double factor) {
  Eigen::VectorXd kept(values.size() - field.num_skipped);
  Eigen::Index next = 0;
  for (Eigen::Index v = 0; v < values.size(); ++v) {
    if (field.is_estimated[static_cast<std::size_t>(v)] != 0) kept[next++] = factor * values[v];
  }
  return kept;
}

void write_curvature(const LoadedSurface& surface, const CurvatureField& field, double h, double k,
                     const std::string& path) {
  SurfaceOutput out;
  out.points = surface.input_points;
  const Triangles& local = surface.graph.triangles;
  out.triangles.resize(local.rows(), 3);
  for (Eigen::Index i = 0; i < local.size(); ++i) {
    out.triangles.data()[i] = surface.input_vertex[static_cast<std::size_t>(local.data()[i])];
  }
  const auto add = [&](const char* name, const Eigen::VectorXd& values, double factor) {
    out.properties.push_back({name, surface.to_input(factor * values), false});
  };
  add("k1", field.k1, h);
  add("k2", field.k2, h);
  add("H", field.mean(), h);
  add("K", field.gauss(), k);
  const char* names[2][3] = {{"d1x", "d1y", "d1z"}, {"d2x", "d2y", "d2z"}};
  for (Eigen::Index c = 0; c < 3; ++c) add(names[0][c], field.d1.col(c), 1.0);
  for (Eigen::Index c = 0; c < 3; ++c) add(names[1][c], field.d2.col(c), 1.0);
  Eigen::VectorXd flag(field.k1.size());
  for (Eigen::Index v = 0; v < flag.size(); ++v)
    flag[v] = field.is_estimated[static_cast<std::size_t>(v)];
  out.properties.push_back({"estimated", surface.to_input(flag), true});
  const SurfaceFormat format = surface_format_of(path);
  if (format != SurfaceFormat::ply_binary && format != SurfaceFormat::ply_ascii) {
    throw InvalidArgument("output is not a .ply file", "only PLY carries values at vertices");
  }
  write_surface(path, out, format);
}

void run_curvature(Context& context, const CurvatureRequest& request) {
  LoadedSurface surface;
  CurvatureField field;
  with_progress(context, "curvature", [&] {
    surface = load_surface(request.mesh, context);
    if (!surface.graph.is_mesh()) {
      throw Error(Errc::impossible, "E_NO_FACES",
                  "Taubin's curvature needs faces, this is a point cloud", {request.mesh, 0, -1},
                  "dupin keypoints works on points");
    }
    field = estimate_curvature_taubin({surface.graph.points, surface.graph.triangles},
                                      surface.graph.topology, context.run.stage(0.5, 1.0));
  });
  const double h = 1.0 / surface.unit;
  const double k = h * h;
  const Eigen::VectorXd H = estimated(field, field.mean(), h);
  const Eigen::VectorXd K = estimated(field, field.gauss(), k);
  if (H.size() == 0)
    throw AnalysisError("E_ALL_DEGENERATE", "no vertex has a face of positive area");
  if (!std::isfinite(K.sum()) || !std::isfinite(H.sum())) {
    throw Error(Errc::numerical, "E_RANGE", "the curvature is too large for a double",
                {request.mesh, 0, -1}, "use a larger unit of length");
  }
  if (!request.output.empty()) write_curvature(surface, field, h, k, request.output);
  const Eigen::Index skipped = surface.num_input_vertices - H.size();
  context.print_json({{"mean", {{"H", summary(H)}, {"K", summary(K)}}},
                      {"skipped_vertices", std::max<Eigen::Index>(skipped, 0)},
                      {"method", request.method},
                      {"warnings", to_json(surface.warnings)}});
  context.say(
      fmt::format("H  min {:.6g}  mean {:.6g}  max {:.6g}", H.minCoeff(), H.mean(), H.maxCoeff()));
  context.say(
      fmt::format("K  min {:.6g}  mean {:.6g}  max {:.6g}", K.minCoeff(), K.mean(), K.maxCoeff()));
  if (!request.output.empty()) context.say(fmt::format("written: {}", request.output));
}

}  // namespace

void add_curvature(CLI::App& app, Context& context) {
  CLI::App* verb =
      app.add_subcommand("curvature", "Principal curvatures and directions at every vertex");
  verb->footer(
      "Example:\n  dupin curvature bunny.off -o curvature.ply\n\nThe PLY carries k1 >= k2, H = (k1 "
      "+ k2) / 2 > 0 on a "
      "sphere, K = k1 k2 and the directions d1, d2.");
  add_global_options(*verb, context);
  auto request = std::make_shared<CurvatureRequest>();
  verb->add_option("MESH", request->mesh, "Surface; - reads standard input")->required();
  verb->add_option("-o,--output", request->output, "PLY to write");
  verb->add_option("--method", request->method, "Estimator")
      ->check(CLI::IsMember({"taubin"}))
      ->capture_default_str();
  verb->callback([request, &context] { run_curvature(context, *request); });
}

}  // namespace dupin::cli
