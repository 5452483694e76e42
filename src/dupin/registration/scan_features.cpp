#include "dupin/registration/scan_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/features/keypoints.h"
#include "dupin/mls/noise_level.h"
#include "dupin/registration/grid_cells.h"
#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/scale_space.h"
#include "dupin/spatial/neighborhoods.h"
#include "dupin/surface/height_signal.h"

namespace dupin {
namespace {

using detail::GridCells;
using Eigen::Index;
using Eigen::RowVector3d;
using std::size_t;

constexpr Index kFewestPoints = 16;

void check(Index num_points, const ScanFeatureOptions& options) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw InvalidArgument(std::string(what));
  };
  require(options.max_keypoints >= 0, "max_keypoints is negative");
  require(options.min_anchors >= 0, "min_anchors is negative");
  require(options.min_persistence >= 1, "min_persistence is below 1");
  require(options.normal_smoothing >= 0, "normal_smoothing is negative");
  require(options.coarse_points >= 100, "coarse_points is below 100");
  require(std::isfinite(options.noise_sigma), "noise_sigma is not finite");
  if (num_points < kFewestPoints) {
    throw AnalysisError("E_TOO_FEW_POINTS", std::to_string(num_points) +
                                                " points, registration needs at least " +
                                                std::to_string(kFewestPoints));
  }
}

// Cells that the surface only grazes hold few points: their means are noisy and lie near those of
// their neighbours. What they hold is about what they take from the evenness of the others.
void drop_grazed(GridCells& cells) {
  std::vector<std::int32_t> size(static_cast<size_t>(cells.count), 0);
  for (const std::int32_t c : cells.cell_of) ++size[static_cast<size_t>(c)];
  const double mean = static_cast<double>(cells.cell_of.size()) / static_cast<double>(cells.count);
  std::vector<std::int32_t> renamed(size.size(), -1);
  Index kept = 0;
  for (size_t c = 0; c < size.size(); ++c) {
    if (size[c] >= 0.3 * mean) renamed[c] = static_cast<std::int32_t>(kept++);
  }
  for (std::int32_t& c : cells.cell_of) c = renamed[static_cast<size_t>(c)];
  cells.count = kept;
}

// Cells of a size that leaves about `wanted` of them: their number falls with its square.
GridCells thinning_cells(const Points& points, double diameter, Index wanted) {
  double step = diameter / 100.0;
  GridCells cells = detail::grid_cells(points, step);
  for (int round = 0; round < 3; ++round) {
    const double ratio = static_cast<double>(cells.count) / static_cast<double>(wanted);
    if (ratio > 0.9 && ratio < 1.15) break;
    step = std::max(step * std::sqrt(ratio), diameter * 1e-6);
    cells = detail::grid_cells(points, step);
  }
  drop_grazed(cells);
  return cells;
}

// Mean of the rows of every cell.
Points means_of(const Points& rows, const GridCells& cells) {
  Points sum = Points::Zero(cells.count, 3);
  Eigen::VectorXd count = Eigen::VectorXd::Zero(cells.count);
  for (Index i = 0; i < rows.rows(); ++i) {
    const Index c = cells.cell_of[static_cast<size_t>(i)];
    if (c < 0) continue;
    sum.row(c) += rows.row(i);
    count[c] += 1.0;
  }
  return sum.array().colwise() / count.array();
}

void add_keypoints(ScanFeatures& scan, const SurfaceGraph& graph, const ScanFeatureOptions& options,
                   const RunControl& run) {
  const Eigen::VectorXd signal =
      compute_signal(graph, Signal::height, options.normal_smoothing, run.stage(0.0, 0.2));
  const DiffusionOperator op = umbrella_operator(graph.topology.ring);
  ScaleSpaceOptions stack_options;
  stack_options.want_levels = false;
  const ScaleSpace stack = compute_scale_space(op, signal, stack_options, run.stage(0.2, 0.8));
  if (stack.status != Status::ok || options.max_keypoints == 0) return;
  KeypointOptions wanted;
  wanted.min_persistence = options.min_persistence;
  wanted.min_level = options.min_level;
  wanted.top = options.max_keypoints;
  const KeypointSet set = find_keypoints(graph, stack.loc, stack_options.schedule,
                                         signal.cwiseAbs().maxCoeff(), wanted, run);
  for (const Keypoint& point : set.keypoints) {
    Anchor anchor;
    anchor.vertex = point.vertex;
    anchor.position = graph.points.row(point.vertex);
    anchor.kind = point.kind == KeypointKind::maximum ? 1 : -1;
    anchor.radius = point.radius * scan.mean_edge / graph.mean_edge;
    scan.anchors.push_back(anchor);
  }
  scan.num_keypoints = static_cast<Index>(scan.anchors.size());
}

// The points that are farthest from all anchors, one after another: they cover what has no feature.
void add_spread_points(ScanFeatures& scan, const SurfaceGraph& graph,
                       const ScanFeatureOptions& options) {
  const Index missing = options.min_anchors - scan.num_keypoints;
  if (missing <= 0) return;
  Eigen::VectorXd away(graph.points.rows());
  for (Index v = 0; v < away.size(); ++v) {
    const bool is_inside = graph.is_guarded[static_cast<size_t>(v)] == 0;
    away[v] = is_inside ? std::numeric_limits<double>::max() : 0.0;
  }
  const auto take = [&](const RowVector3d& position) {
    away = away.cwiseMin((graph.points.rowwise() - position).rowwise().squaredNorm());
  };
  for (const Anchor& anchor : scan.anchors) take(anchor.position);
  for (Index i = 0; i < missing; ++i) {
    Index farthest = 0;
    if (!(away.maxCoeff(&farthest) > 0.0)) break;
    Anchor anchor;
    anchor.vertex = static_cast<std::int32_t>(farthest);
    anchor.position = graph.points.row(farthest);
    take(anchor.position);
    scan.anchors.push_back(anchor);
  }
}

// Mean normal within six mean edges: what the height maps are measured over.
void set_normals(ScanFeatures& scan, const RunControl& run) {
  const auto count = static_cast<Index>(scan.anchors.size());
  if (count == 0) return;
  Points places(count, 3);
  for (Index i = 0; i < count; ++i) places.row(i) = scan.anchors[static_cast<size_t>(i)].position;
  const NeighborSearch search(scan.coarse);
  const double reach = 6.0 * scan.mean_edge;
  const auto visitor = [&]() -> NeighborVisitor {
    return [&](Index query, std::span<const std::int32_t> index, std::span<const double>) {
      Anchor& anchor = scan.anchors[static_cast<size_t>(query)];
      const RowVector3d side = scan.coarse_normals.row(anchor.vertex);
      std::vector<std::int32_t> sorted(index.begin(), index.end());
      std::sort(sorted.begin(), sorted.end());  // one order of addition
      RowVector3d normal = RowVector3d::Zero();
      for (const std::int32_t i : sorted) {
        const RowVector3d n = scan.coarse_normals.row(i);
        const double squared = (scan.coarse.row(i) - anchor.position).squaredNorm();
        // The other side of a thin sheet is near in space, but not on the surface.
        if (n.dot(side) > 0.0) normal += (1.0 - squared / (reach * reach)) * n;
      }
      const double length = normal.norm();
      anchor.normal = length > 0.0 ? RowVector3d(normal / length) : RowVector3d::UnitZ();
      anchor.vertex = scan.coarse_vertex[static_cast<size_t>(anchor.vertex)];
    };
  };
  if (reach > 0.0 && !run.cancelled()) search.visit_within(places, reach, visitor, run);
}

// Mean edge without those that lead to stray points: longer than eight times the median.
double mean_edge_of(const SurfaceGraph& graph) {
  const Adjacency& ring = graph.topology.ring;
  std::vector<double> length;
  length.reserve(ring.neighbor.size() / 2);
  for (Index v = 0; v < ring.num_vertices(); ++v) {
    for (const std::int32_t* j = ring.begin(v); j != ring.end(v); ++j) {
      if (*j > v) length.push_back((graph.points.row(v) - graph.points.row(*j)).norm());
    }
  }
  if (length.empty()) return 0.0;
  const auto middle = length.begin() + static_cast<std::ptrdiff_t>(length.size() / 2);
  std::nth_element(length.begin(), middle, length.end());
  const double longest = 8.0 * *middle;
  if (!(longest > 0.0)) return graph.mean_edge;
  double sum = 0.0;
  Index count = 0;
  for (const double one : length) {
    if (one > longest) continue;
    sum += one;
    ++count;
  }
  return sum / static_cast<double>(count);
}

void require_extent(double mean_edge) {
  if (mean_edge > 0.0) return;
  throw AnalysisError("E_DEGENERATE", "all points of the scan lie at one place");
}

// Everything but the graph. `cells`: of the points of the scan in the graph; empty: one each.
ScanFeatures describe(ScanFeatures scan, const SurfaceGraph& graph, const GridCells& cells,
                      const ScanFeatureOptions& options, const RunControl& run) {
  scan.coarse = graph.points;
  scan.mean_edge = mean_edge_of(graph);
  require_extent(graph.mean_edge);
  scan.coarse_normals =
      smooth_normals(graph.normals, graph.topology.ring, options.normal_smoothing);
  if (cells.count > 0) {
    scan.normals.resize(scan.points.rows(), 3);
    scan.coarse_vertex.assign(static_cast<size_t>(cells.count), 0);
    std::vector<double> away(static_cast<size_t>(cells.count), std::numeric_limits<double>::max());
    for (Index i = 0; i < scan.points.rows(); ++i) {
      const std::int32_t c = cells.cell_of[static_cast<size_t>(i)];
      scan.normals.row(i).setZero();
      if (c < 0) continue;
      scan.normals.row(i) = scan.coarse_normals.row(c);
      const double squared = (scan.points.row(i) - scan.coarse.row(c)).squaredNorm();
      if (squared >= away[static_cast<size_t>(c)]) continue;
      away[static_cast<size_t>(c)] = squared;
      scan.coarse_vertex[static_cast<size_t>(c)] = static_cast<std::int32_t>(i);
    }
  } else {
    scan.normals = scan.coarse_normals;
    scan.coarse_vertex.resize(static_cast<size_t>(scan.points.rows()));
    std::iota(scan.coarse_vertex.begin(), scan.coarse_vertex.end(), 0);
  }
  if (!run.cancelled()) {
    NoiseLevelOptions noise;
    noise.num_samples = 400;
    scan.noise_sigma = options.noise_sigma >= 0.0
                           ? options.noise_sigma
                           : estimate_noise(scan.points, noise, run.stage(0.2, 0.3)).sigma;
    const double in_cell =
        static_cast<double>(scan.points.rows()) / static_cast<double>(scan.coarse.rows());
    scan.coarse_sigma = scan.noise_sigma / std::sqrt(std::max(1.0, in_cell));
  }
  if (!run.cancelled()) add_keypoints(scan, graph, options, run.stage(0.3, 0.9));
  if (!run.cancelled()) add_spread_points(scan, graph, options);
  if (!run.cancelled()) set_normals(scan, run.stage(0.9, 1.0));
  if (!run.cancelled()) return scan;
  ScanFeatures cancelled;
  cancelled.status = Status::cancelled;
  return cancelled;
}

// Diagonal of the core box, stretched to what it is of a full one.
double diameter_of(const Points& points) { return detail::core_box(points).size().norm() / 0.98; }

}  // namespace

ScanFeatures describe_scan(const Mesh& mesh, const ScanFeatureOptions& options, RunControl run) {
  check(mesh.points.rows(), options);
  ScanFeatures scan;
  scan.points = mesh.points;
  scan.diameter = diameter_of(mesh.points);
  if (mesh.points.rows() <= options.coarse_points * 5 / 4 || !(scan.diameter > 0.0))
    return describe(std::move(scan), surface_graph(mesh), {}, options, run);
  validate(mesh);
  const GridCells cells = thinning_cells(mesh.points, scan.diameter, options.coarse_points);
  PointCloud coarse;
  coarse.points = means_of(mesh.points, cells);
  coarse.normals = means_of(vertex_normals(mesh), cells);
  // Opposite sides of a thin sheet leave no normal: any side of it will do.
  for (Index c = 0; c < coarse.normals.rows(); ++c) {
    const double length = coarse.normals.row(c).norm();
    coarse.normals.row(c) =
        length > 1e-6 ? RowVector3d(coarse.normals.row(c) / length) : RowVector3d::UnitZ();
  }
  return describe(std::move(scan), surface_graph(coarse, {}, run.stage(0.0, 0.2)), cells, options,
                  run);
}

ScanFeatures describe_scan(const PointCloud& cloud, const ScanFeatureOptions& options,
                           RunControl run) {
  check(cloud.points.rows(), options);
  if (cloud.normals.rows() != 0 && cloud.normals.rows() != cloud.points.rows()) {
    throw InvalidArgument("there are " + std::to_string(cloud.points.rows()) + " points and " +
                          std::to_string(cloud.normals.rows()) + " normals");
  }
  for (const Points* rows : {&cloud.points, &cloud.normals}) {
    for (Index i = 0; i < rows->size(); ++i) {
      if (!std::isfinite(rows->data()[i])) throw InvalidArgument("a coordinate is not finite");
    }
  }
  ScanFeatures scan;
  scan.points = cloud.points;
  scan.diameter = diameter_of(cloud.points);
  scan.has_sides = cloud.normals.rows() > 0;
  if (cloud.points.rows() <= options.coarse_points * 5 / 4 || !(scan.diameter > 0.0))
    return describe(std::move(scan), surface_graph(cloud, {}, run.stage(0.0, 0.2)), {}, options,
                    run);
  const GridCells cells = thinning_cells(cloud.points, scan.diameter, options.coarse_points);
  PointCloud coarse;
  coarse.points = means_of(cloud.points, cells);
  if (scan.has_sides) coarse.normals = means_of(cloud.normals, cells);
  return describe(std::move(scan), surface_graph(coarse, {}, run.stage(0.0, 0.2)), cells, options,
                  run);
}

}  // namespace dupin
