// Surfaces whose crest lines are known in closed form, and how well found lines agree with them.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "dupin/crest/crest_lines.h"
#include "dupin/mesh/mesh.h"
#include "dupin/mesh/shapes.h"

namespace dupin::test {

struct TrueLine {
  CrestKind kind = CrestKind::ridge;
  Points points;
};

struct CrestSurface {
  std::string name;
  Mesh mesh;
  std::vector<TrueLine> lines;
  /// Where lines may go on though none is asked for.
  std::vector<TrueLine> allowed = {};
};

template <class Curve>
TrueLine true_line(CrestKind kind, double from, double to, const Curve& curve) {
  constexpr Eigen::Index kSamples = 1000;
  TrueLine line{kind, Points(kSamples, 3)};
  for (Eigen::Index i = 0; i < kSamples; ++i) {
    line.points.row(i) =
        curve(from + (to - from) * static_cast<double>(i) / static_cast<double>(kSamples - 1));
  }
  return line;
}

/// Half axes 3, 2, 1: its sharp rim z = 0 is a ridge all the way round. The other two planes of
/// symmetry cut lines on which the larger curvature is least, or which are not of the larger one.
inline CrestSurface crest_ellipsoid(Eigen::Index num_vertices) {
  return {"ellipsoid 3:2:1",
          make_ellipsoid(3.0, 2.0, 1.0, num_vertices).mesh,
          {true_line(CrestKind::ridge, 0.0, 2.0 * M_PI, [](double t) {
            return Eigen::RowVector3d(3.0 * std::cos(t), 2.0 * std::sin(t), 0.0);
          })}};
}

/// An ellipse with half axes 0.6 (radial) and 1.1 (axial) turned about the z axis at distance 4:
/// the circles z = +-1.1 are ridges. |k| across (at least 0.6 / 1.1^2 = 0.496) is above |k| along
/// (at most 1 / 3.4) everywhere, so there are no others. A circular section would have none: its
/// curvatures are constant along their own lines.
inline CrestSurface crest_torus(Eigen::Index num_vertices) {
  constexpr double kMajor = 4.0;
  constexpr double kRadial = 0.6;
  constexpr double kAxial = 1.1;
  // Section by arc length.
  constexpr int kSteps = 20000;
  std::vector<double> arc(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const double t = 2.0 * M_PI * (i + 0.5) / kSteps;
    arc[static_cast<std::size_t>(i) + 1] =
        arc[static_cast<std::size_t>(i)] +
        2.0 * M_PI / kSteps * std::hypot(kRadial * std::sin(t), kAxial * std::cos(t));
  }
  const double section = arc.back();
  const double around = 2.0 * M_PI * kMajor;
  const double edge =
      std::sqrt(section * around / static_cast<double>(num_vertices) * 2.0 / std::sqrt(3.0));
  const auto columns = static_cast<std::int32_t>(std::lround(around / edge));
  const auto rows =
      2 * static_cast<std::int32_t>(std::lround(section / (edge * std::sqrt(3.0) / 2.0) / 2.0));
  CrestSurface out{"elliptic torus", {}, {}};
  out.mesh.points.resize(Eigen::Index{rows} * columns, 3);
  out.mesh.triangles.resize(2 * Eigen::Index{rows} * columns, 3);
  for (std::int32_t r = 0; r < rows; ++r) {
    const double s = section * r / rows;
    const auto place = std::lower_bound(arc.begin(), arc.end(), s) - arc.begin();
    const double t = 2.0 * M_PI * static_cast<double>(place) / kSteps;
    for (std::int32_t c = 0; c < columns; ++c) {
      const double phi = 2.0 * M_PI * (c + 0.5 * (r % 2)) / columns;
      const double radius = kMajor + kRadial * std::cos(t);
      out.mesh.points.row(Eigen::Index{r} * columns + c) << radius * std::cos(phi),
          radius * std::sin(phi), kAxial * std::sin(t);
      const std::int32_t below = r * columns;
      const std::int32_t above = ((r + 1) % rows) * columns;
      const std::int32_t next = (c + 1) % columns;
      const Eigen::Index face = 2 * (Eigen::Index{r} * columns + c);
      if (r % 2 == 0) {
        out.mesh.triangles.row(face) << below + c, below + next, above + c;
        out.mesh.triangles.row(face + 1) << below + next, above + next, above + c;
      } else {
        out.mesh.triangles.row(face) << below + c, above + next, above + c;
        out.mesh.triangles.row(face + 1) << below + c, below + next, above + next;
      }
    }
  }
  for (const double z : {kAxial, -kAxial}) {
    out.lines.push_back(true_line(CrestKind::ridge, 0.0, 2.0 * M_PI, [z](double t) {
      return Eigen::RowVector3d(kMajor * std::cos(t), kMajor * std::sin(t), z);
    }));
  }
  return out;
}

/// z = 0.1 exp(-x^2 / (2 s^2)): a ridge at x = 0 between two valleys where the curvature of the
/// profile is least.
inline CrestSurface crest_gaussian_ridge(Eigen::Index num_vertices, double s = 0.15,
                                         double height = 0.1, double jitter = 0.25) {
  PlaneOptions options;
  options.num_vertices = num_vertices;
  options.jitter = jitter;
  CrestSurface out{"Gaussian ridge", make_plane(options).mesh, {}};
  for (Eigen::Index v = 0; v < out.mesh.points.rows(); ++v) {
    const double x = out.mesh.points(v, 0) / s;
    out.mesh.points(v, 2) = height * std::exp(-0.5 * x * x);
  }
  const auto bend = [&](double x) {  // z'' / (1 + z'^2)^(3/2)
    const double z = height * std::exp(-0.5 * x * x / (s * s));
    const double slope = -x / (s * s) * z;
    return (x * x / (s * s) - 1.0) / (s * s) * z / std::pow(1.0 + slope * slope, 1.5);
  };
  double low = s;
  double high = 3.0 * s;
  for (int i = 0; i < 200; ++i) {
    const double a = low + (high - low) / 3.0;
    const double b = high - (high - low) / 3.0;
    (bend(a) < bend(b) ? low : high) = bend(a) < bend(b) ? a : b;
  }
  const double valley = 0.5 * (low + high);
  for (const double x : {0.0, valley, -valley}) {
    const double z = height * std::exp(-0.5 * x * x / (s * s));
    out.lines.push_back(true_line(x == 0.0 ? CrestKind::ridge : CrestKind::valley, -1.0, 1.0,
                                  [x, z](double y) { return Eigen::RowVector3d(x, y, z); }));
  }
  return out;
}

/// The cube |x|, |y|, |z| <= 1 whose edges are rounded with `radius`: twelve ridges along the
/// middles of the quarter cylinders.
inline CrestSurface crest_rounded_cube(Eigen::Index num_vertices, double radius = 0.3) {
  const auto n = static_cast<std::int32_t>(
      std::max(4L, std::lround(std::sqrt(static_cast<double>(num_vertices) / 6.0))));
  CrestSurface out{"rounded cube", {}, {}};
  std::vector<Eigen::RowVector3d> points;
  std::vector<std::int32_t> index(static_cast<std::size_t>((n + 1) * (n + 1) * (n + 1)), -1);
  const auto vertex = [&](std::int32_t i, std::int32_t j, std::int32_t k) {
    std::int32_t& known = index[static_cast<std::size_t>((i * (n + 1) + j) * (n + 1) + k)];
    if (known < 0) {
      known = static_cast<std::int32_t>(points.size());
      const Eigen::RowVector3d on_cube(2.0 * i / n - 1.0, 2.0 * j / n - 1.0, 2.0 * k / n - 1.0);
      const double inner = 1.0 - radius;
      const Eigen::RowVector3d core = on_cube.cwiseMax(-inner).cwiseMin(inner);
      points.push_back(core + radius * (on_cube - core).normalized());
    }
    return known;
  };
  std::vector<Eigen::RowVector3i> faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const std::int32_t side : {0, n}) {
      for (std::int32_t a = 0; a < n; ++a) {
        for (std::int32_t b = 0; b < n; ++b) {
          const auto at = [&](std::int32_t u, std::int32_t w) {
            std::int32_t x[3];
            x[axis] = side;
            x[(axis + 1) % 3] = u;
            x[(axis + 2) % 3] = w;
            return vertex(x[0], x[1], x[2]);
          };
          std::int32_t q[4] = {at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)};
          if (side == 0) std::swap(q[1], q[3]);
          if ((a + b) % 2 == 0) {
            faces.emplace_back(q[0], q[1], q[2]);
            faces.emplace_back(q[0], q[2], q[3]);
          } else {
            faces.emplace_back(q[0], q[1], q[3]);
            faces.emplace_back(q[1], q[2], q[3]);
          }
        }
      }
    }
  }
  out.mesh.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    out.mesh.points.row(static_cast<Eigen::Index>(v)) = points[v];
  out.mesh.triangles.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    out.mesh.triangles.row(static_cast<Eigen::Index>(f)) = faces[f];
  const double middle = 1.0 - radius + radius / std::sqrt(2.0);
  const double end = 1.0 - radius;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double su : {-1.0, 1.0}) {
      for (const double sw : {-1.0, 1.0}) {
        out.lines.push_back(true_line(CrestKind::ridge, -end, end, [&](double t) {
          Eigen::RowVector3d p;
          p[axis] = t;
          p[(axis + 1) % 3] = su * middle;
          p[(axis + 2) % 3] = sw * middle;
          return p;
        }));
      }
    }
  }
  // By symmetry lines of a smoothed cube go on to its corners, over the eighths of spheres.
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      for (const double sz : {-1.0, 1.0}) {
        for (int axis = 0; axis < 3; ++axis) {
          out.allowed.push_back(true_line(CrestKind::ridge, 0.0, 1.0, [&](double t) {
            Eigen::RowVector3d outward = Eigen::RowVector3d::Constant(1.0);
            outward[axis] = t;
            const Eigen::RowVector3d side(sx, sy, sz);
            return Eigen::RowVector3d(side.cwiseProduct(
                (Eigen::RowVector3d::Constant(end) + radius * outward.normalized())));
          }));
        }
      }
    }
  }
  return out;
}

/// Shares of length within `reach` of the other set's lines of the same kind.
struct LineAgreement {
  double found_near_true = 0.0;  ///< precision
  double true_near_found = 0.0;  ///< recall
};

inline double near_share(const std::vector<TrueLine>& of, const std::vector<TrueLine>& to,
                         double reach) {
  double total = 0.0;
  double near = 0.0;
  for (const TrueLine& line : of) {
    for (Eigen::Index i = 1; i < line.points.rows(); ++i) {
      const Eigen::RowVector3d middle = 0.5 * (line.points.row(i) + line.points.row(i - 1));
      const double length = (line.points.row(i) - line.points.row(i - 1)).norm();
      total += length;
      bool is_near = false;
      for (const TrueLine& other : to) {
        if (other.kind != line.kind || is_near) continue;
        for (Eigen::Index k = 1; k < other.points.rows() && !is_near; ++k) {
          const Eigen::RowVector3d a = other.points.row(k - 1);
          const Eigen::RowVector3d d = other.points.row(k) - a;
          const double square = d.squaredNorm();
          const double t = square > 0.0 ? std::clamp((middle - a).dot(d) / square, 0.0, 1.0) : 0.0;
          is_near = (a + t * d - middle).squaredNorm() <= reach * reach;
        }
      }
      if (is_near) near += length;
    }
  }
  return total > 0.0 ? near / total : 0.0;
}

/// Lines as they lie on `points`, the surface without its noise.
inline std::vector<TrueLine> lines_on(const Points& points, const std::vector<CrestLine>& lines) {
  std::vector<TrueLine> out;
  for (const CrestLine& line : lines) {
    TrueLine on{line.kind, Points(static_cast<Eigen::Index>(line.points.size()), 3)};
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      const EdgeCrossing& c = line.points[i].edge;
      on.points.row(static_cast<Eigen::Index>(i)) =
          (1.0 - c.weight) * points.row(c.a) + c.weight * points.row(c.b);
    }
    out.push_back(std::move(on));
  }
  return out;
}

inline LineAgreement agreement(const CrestSurface& surface, const std::vector<CrestLine>& lines,
                               double reach) {
  const std::vector<TrueLine> found = lines_on(surface.mesh.points, lines);
  std::vector<TrueLine> legal = surface.lines;
  legal.insert(legal.end(), surface.allowed.begin(), surface.allowed.end());
  return {near_share(found, legal, reach), near_share(surface.lines, found, reach)};
}

}  // namespace dupin::test
