#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

#include "dupin/base/random.h"
#include "dupin/warp/planar_mesh.h"

namespace dupin::test {

/// Squares of side `step` cut in two, alternately, where `is_inside(x, y)` of their centre holds;
/// columns by rows of them from (0, 0). Vertices without a square are left out.
inline PlanarMesh planar_cells(int columns, int rows, double step,
                               const std::function<bool(double, double)>& is_inside) {
  const auto id = [&](int i, int j) { return static_cast<std::size_t>(j * (columns + 1) + i); };
  std::vector<std::int32_t> number(static_cast<std::size_t>((columns + 1) * (rows + 1)), -1);
  std::vector<std::array<std::size_t, 3>> faces;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      if (!is_inside((i + 0.5) * step, (j + 0.5) * step)) continue;
      const std::size_t a = id(i, j);
      const std::size_t b = id(i + 1, j);
      const std::size_t c = id(i + 1, j + 1);
      const std::size_t d = id(i, j + 1);
      if ((i + j) % 2 == 0) {
        faces.push_back({a, b, c});
        faces.push_back({a, c, d});
      } else {
        faces.push_back({a, b, d});
        faces.push_back({b, c, d});
      }
      for (const std::size_t v : {a, b, c, d}) number[v] = 0;
    }
  }
  std::int32_t count = 0;
  for (std::int32_t& n : number) {
    if (n == 0) n = count++;
  }
  PlanarMesh mesh;
  mesh.points.resize(count, 2);
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      if (number[id(i, j)] >= 0) mesh.points.row(number[id(i, j)]) << i * step, j * step;
    }
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k)
      mesh.triangles(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(k)) =
          number[faces[f][k]];
  }
  return mesh;
}

inline PlanarMesh planar_grid(int columns, int rows, double step) {
  return planar_cells(columns, rows, step, [](double, double) { return true; });
}

/// The same with rows of equilateral triangles of side `step`: odd rows moved by half a side.
inline PlanarMesh equilateral_grid(int columns, int rows, double step) {
  PlanarMesh mesh = planar_grid(columns, rows, step);
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
    const auto j = v / (columns + 1);
    mesh.points(v, 0) += j % 2 == 0 ? 0.0 : 0.5 * step;
    mesh.points(v, 1) *= std::sqrt(0.75);
  }
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const std::int32_t a = j * (columns + 1) + i;
      const std::int32_t d = a + columns + 1;
      const Eigen::Index f = 2 * (j * columns + i);
      if (j % 2 == 0) {
        mesh.triangles.row(f) << a, a + 1, d;
        mesh.triangles.row(f + 1) << a + 1, d + 1, d;
      } else {
        mesh.triangles.row(f) << a, a + 1, d + 1;
        mesh.triangles.row(f + 1) << a, d + 1, d;
      }
    }
  }
  return mesh;
}

/// 300 by 200 px with a slot of 100 px width that comes 150 px down from the top, in the middle.
inline PlanarMesh u_shape(double step) {
  return planar_cells(static_cast<int>(300 / step), static_cast<int>(200 / step), step,
                      [](double x, double y) { return y > 150.0 || x < 100.0 || x > 200.0; });
}

/// A torso of 100 by 200 px with a sleeve of 40 by 150 px that hangs beside it, 5 px away, and
/// joins it at the shoulder: x 0 to 40 the sleeve, 45 to 145 the torso, the first 30 px down both.
inline PlanarMesh sleeve_shape(double step = 5.0) {
  return planar_cells(
      static_cast<int>(145 / step), static_cast<int>(200 / step), step,
      [](double x, double y) { return x > 45.0 || y < 30.0 || (x < 40.0 && y < 150.0); });
}

/// Vertices moved by up to `amount` in each coordinate.
inline PlanarMesh jittered(PlanarMesh mesh, double amount, std::uint64_t seed = 1) {
  Rng rng(seed);
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v) {
    mesh.points(v, 0) += amount * (2.0 * rng.uniform() - 1.0);
    mesh.points(v, 1) += amount * (2.0 * rng.uniform() - 1.0);
  }
  return mesh;
}

inline Points2 moved_rigidly(const Points2& points, double angle, double dx, double dy) {
  Eigen::Matrix2d rotation;
  rotation << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  Points2 result = points * rotation.transpose();
  result.rowwise() += Eigen::RowVector2d(dx, dy);
  return result;
}

inline Eigen::Index nearest_vertex(const Points2& points, double x, double y) {
  Eigen::Index nearest = 0;
  (points.rowwise() - Eigen::RowVector2d(x, y)).rowwise().squaredNorm().minCoeff(&nearest);
  return nearest;
}

/// The mesh with its vertices in another order; `number[v]` is the new number of vertex v.
inline PlanarMesh renumbered(const PlanarMesh& mesh, std::vector<std::int32_t>& number,
                             std::uint64_t seed) {
  number.resize(static_cast<std::size_t>(mesh.points.rows()));
  std::iota(number.begin(), number.end(), 0);
  Rng rng(seed);
  for (std::size_t i = number.size(); i > 1; --i) std::swap(number[i - 1], number[rng.below(i)]);
  PlanarMesh result = mesh;
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v)
    result.points.row(number[static_cast<std::size_t>(v)]) = mesh.points.row(v);
  for (Eigen::Index i = 0; i < mesh.triangles.size(); ++i)
    result.triangles.data()[i] = number[static_cast<std::size_t>(mesh.triangles.data()[i])];
  return result;
}

}  // namespace dupin::test
