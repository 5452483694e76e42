#include "dupin/mesh/range_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

constexpr double kDepthJumpInMedianEdges = 5.0;

void validate(const RangeGrid& grid, const RangeGridOptions& options) {
  if (!std::isfinite(options.max_depth_jump) || !(options.max_depth_jump >= 0.0)) {
    throw InvalidArgument("max_depth_jump must be finite and >= 0");
  }
  if (grid.rows < 0 || grid.cols < 0 ||
      (grid.cols > 0 && grid.rows > std::numeric_limits<std::int32_t>::max() / grid.cols)) {
    throw InvalidArgument("grid: " + std::to_string(grid.rows) + " x " + std::to_string(grid.cols) +
                          " pixels do not fit 32-bit indices");
  }
  const Eigen::Index size = grid.rows * grid.cols;
  if (grid.points.rows() != size || static_cast<Eigen::Index>(grid.is_valid.size()) != size) {
    throw InvalidArgument("grid: points and is_valid must have rows * cols entries");
  }
  for (Eigen::Index i = 0; i < size; ++i) {
    if (grid.is_valid[static_cast<std::size_t>(i)] == 0) continue;
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(grid.points(i, k))) {
        throw InvalidArgument("grid: valid pixel " + std::to_string(i) + " is not finite");
      }
    }
  }
}

/// Overflow-safe length: coordinates of 1e300 are extreme, not an error.
double distance(const Points& points, Eigen::Index a, Eigen::Index b) {
  return std::hypot(points(a, 0) - points(b, 0), points(a, 1) - points(b, 1),
                    points(a, 2) - points(b, 2));
}

/// Median length of the edges between valid neighbours in a row or a column; 0 when there is none.
double median_edge(const RangeGrid& grid) {
  const auto valid = [&](Eigen::Index i) {
    return grid.is_valid[static_cast<std::size_t>(i)] != 0;
  };
  std::vector<double> lengths;
  for (Eigen::Index row = 0; row < grid.rows; ++row) {
    for (Eigen::Index col = 0; col < grid.cols; ++col) {
      const Eigen::Index i = row * grid.cols + col;
      if (!valid(i)) continue;
      if (col + 1 < grid.cols && valid(i + 1)) lengths.push_back(distance(grid.points, i, i + 1));
      if (row + 1 < grid.rows && valid(i + grid.cols)) {
        lengths.push_back(distance(grid.points, i, i + grid.cols));
      }
    }
  }
  if (lengths.empty()) return 0.0;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

class Triangulation {
 public:
  Triangulation(const RangeGrid& grid, double longest_edge)
      : grid_(grid), longest_edge_(longest_edge) {}

  void add_cell(Eigen::Index first) {
    const std::array<Eigen::Index, 4> c = {first, first + 1, first + grid_.cols + 1,
                                           first + grid_.cols};
    int num_valid = 0;
    int missing = 0;
    for (int k = 0; k < 4; ++k) {
      if (grid_.is_valid[static_cast<std::size_t>(c[static_cast<std::size_t>(k)])] != 0) {
        ++num_valid;
      } else {
        missing = k;
      }
    }
    if (num_valid == 4) {
      if (distance(grid_.points, c[0], c[2]) <= distance(grid_.points, c[1], c[3])) {
        add(c[0], c[1], c[2]);
        add(c[0], c[2], c[3]);
      } else {
        add(c[0], c[1], c[3]);
        add(c[1], c[2], c[3]);
      }
    } else if (num_valid == 3) {
      const auto corner = [&](int k) { return c[static_cast<std::size_t>((missing + k) % 4)]; };
      add(corner(1), corner(2), corner(3));
    }
  }

  const std::vector<std::int32_t>& indices() const { return indices_; }

 private:
  void add(Eigen::Index i, Eigen::Index j, Eigen::Index k) {
    const Points& p = grid_.points;
    if (distance(p, i, j) > longest_edge_ || distance(p, j, k) > longest_edge_ ||
        distance(p, k, i) > longest_edge_) {
      return;
    }
    for (const Eigen::Index v : {i, j, k}) indices_.push_back(static_cast<std::int32_t>(v));
  }

  const RangeGrid& grid_;
  double longest_edge_;
  std::vector<std::int32_t> indices_;  // pixels, three a triangle
};

/// Twice the sum of the signed areas of `indices` projected along z, in units of `scale` squared.
double projected_area(const Points& points, const std::vector<std::int32_t>& indices,
                      double scale) {
  double sum = 0.0;
  for (std::size_t f = 0; f + 2 < indices.size(); f += 3) {
    const auto a = points.row(indices[f]);
    const auto b = points.row(indices[f + 1]);
    const auto c = points.row(indices[f + 2]);
    sum += (b.x() - a.x()) / scale * ((c.y() - a.y()) / scale) -
           (c.x() - a.x()) / scale * ((b.y() - a.y()) / scale);
  }
  return sum;
}

}  // namespace

PolygonMesh triangulate_range_grid(const RangeGrid& grid, const RangeGridOptions& options) {
  validate(grid, options);
  const double longest_edge = options.max_depth_jump > 0.0
                                  ? options.max_depth_jump
                                  : std::min(kDepthJumpInMedianEdges * median_edge(grid),
                                             std::numeric_limits<double>::max());
  Triangulation triangulation(grid, longest_edge);
  for (Eigen::Index row = 0; row + 1 < grid.rows; ++row) {
    for (Eigen::Index col = 0; col + 1 < grid.cols; ++col) {
      triangulation.add_cell(row * grid.cols + col);
    }
  }
  const std::vector<std::int32_t>& pixels = triangulation.indices();
  // Kept edges are at most longest_edge, so the scaled area cannot overflow.
  const bool is_turned =
      longest_edge > 0.0 && projected_area(grid.points, pixels, longest_edge) < 0.0;

  std::vector<std::int32_t> vertex(grid.is_valid.size(), -1);
  std::int32_t num_vertices = 0;
  for (std::size_t i = 0; i < vertex.size(); ++i) {
    if (grid.is_valid[i] != 0) vertex[i] = num_vertices++;
  }
  PolygonMesh mesh;
  mesh.points.resize(num_vertices, 3);
  for (std::size_t i = 0; i < vertex.size(); ++i) {
    if (vertex[i] >= 0) {
      mesh.points.row(vertex[i]) = grid.points.row(static_cast<Eigen::Index>(i));
    }
  }
  mesh.normals.resize(0, 3);
  mesh.face_index.resize(static_cast<Eigen::Index>(pixels.size()));
  for (std::size_t f = 0; f < pixels.size(); f += 3) {
    const std::array<std::size_t, 3> order = {f, is_turned ? f + 2 : f + 1,
                                              is_turned ? f + 1 : f + 2};
    for (std::size_t k = 0; k < 3; ++k) {
      mesh.face_index[static_cast<Eigen::Index>(f + k)] =
          vertex[static_cast<std::size_t>(pixels[order[k]])];
    }
  }
  return mesh;
}

}  // namespace dupin
