#include "registered_scan.h"

namespace dupin::cli {

using Eigen::Index;
using Json = nlohmann::ordered_json;

Pose local_to_input(const LoadedSurface& surface) {
  Pose pose;
  pose.scale = surface.unit;
  pose.translation =
      (surface.points.row(0) - surface.unit * surface.graph.points.row(0)).transpose();
  return pose;
}

ScanFeatures describe_loaded(const LoadedSurface& surface, double scale, const RunControl& run) {
  const SurfaceGraph& graph = surface.graph;
  if (graph.is_mesh()) return describe_scan(Mesh{scale * graph.points, graph.triangles}, {}, run);
  const Points normals = surface.has_given_normals ? graph.normals : Points(0, 3);
  return describe_scan(PointCloud{scale * graph.points, normals}, {}, run);
}

Json matrix_of(const Pose& pose) {
  Json rows = Json::array();
  for (Index r = 0; r < 3; ++r) {
    Json row = Json::array();
    for (Index c = 0; c < 3; ++c) row.push_back(pose.scale * pose.rotation(r, c));
    row.push_back(pose.translation[r]);
    rows.push_back(row);
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

Json warnings_of(const std::string& file, const LoadedSurface& surface) {
  Json list = to_json(surface.warnings);
  for (Json& warning : list) warning["file"] = file;
  return list;
}

SurfaceOutput as_given(const LoadedSurface& surface) {
  SurfaceOutput out;
  out.points = surface.input_points;
  out.triangles = surface.graph.triangles;
  for (Index i = 0; i < out.triangles.size(); ++i) {
    std::int32_t& vertex = out.triangles.data()[i];
    vertex = surface.input_vertex[static_cast<std::size_t>(vertex)];
  }
  return out;
}

void append_scan(SurfaceOutput& all, const SurfaceOutput& scan, const Pose& pose) {
  const Index first = all.points.rows();
  const Index faces = all.triangles.rows();
  all.points.conservativeResize(first + scan.points.rows(), 3);
  all.points.bottomRows(scan.points.rows()) = transformed(scan.points, pose);
  all.triangles.conservativeResize(faces + scan.triangles.rows(), 3);
  all.triangles.bottomRows(scan.triangles.rows()) =
      scan.triangles.array() + static_cast<std::int32_t>(first);
}

}  // namespace dupin::cli
