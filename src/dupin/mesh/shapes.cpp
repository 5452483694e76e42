#include "dupin/mesh/shapes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/mesh/subdivision.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::int32_t;

constexpr double kPi = std::numbers::pi;

void require_length(double value, const char* name) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw InvalidArgument(std::string(name) + ": " + std::to_string(value) +
                          " is not a positive length");
  }
}

void require_count(Index count, Index least) {
  if (count < least || count > 100'000'000) {
    throw InvalidArgument("num_vertices: " + std::to_string(count) + " is outside " +
                          std::to_string(least) + " to 100000000");
  }
}

// Second-order description of a surface F = 0 at one point, grad F pointing outward.
struct Implicit {
  Vector3d gradient;
  Matrix3d hessian;
};

// The shape operator of F = 0 is the Hessian restricted to the tangent plane over |grad F|.
template <typename Field>
AnalyticSurface with_curvature(Mesh mesh, const Field& field) {
  const Index num_vertices = mesh.points.rows();
  AnalyticSurface surface;
  surface.normals.resize(num_vertices, 3);
  surface.mean.resize(num_vertices);
  surface.gauss.resize(num_vertices);
  surface.k1.resize(num_vertices);
  surface.k2.resize(num_vertices);
  for (Index v = 0; v < num_vertices; ++v) {
    const Implicit at = field(Vector3d(mesh.points.row(v).transpose()));
    const double slope = at.gradient.norm();
    const Vector3d normal = at.gradient / slope;
    const Vector3d t1 = normal.unitOrthogonal();
    const Vector3d t2 = normal.cross(t1);
    const double a = t1.dot(at.hessian * t1) / slope;
    const double b = t1.dot(at.hessian * t2) / slope;
    const double d = t2.dot(at.hessian * t2) / slope;
    const double mean = 0.5 * (a + d);
    const double spread = std::hypot(0.5 * (a - d), b);
    surface.normals.row(v) = normal.transpose();
    surface.mean(v) = mean;
    surface.gauss(v) = a * d - b * b;
    surface.k1(v) = mean + spread;
    surface.k2(v) = mean - spread;
  }
  surface.mesh = std::move(mesh);
  return surface;
}

// Value and derivatives of z = f(x, y).
struct Jet {
  double z = 0.0;
  double x = 0.0, y = 0.0;
  double xx = 0.0, xy = 0.0, yy = 0.0;
};

template <typename Function>
AnalyticSurface make_graph(Mesh domain, const Function& function) {
  for (Index v = 0; v < domain.points.rows(); ++v) {
    domain.points(v, 2) = function(domain.points(v, 0), domain.points(v, 1)).z;
  }
  return with_curvature(std::move(domain), [&](const Vector3d& p) {
    const Jet jet = function(p.x(), p.y());
    Implicit at{{-jet.x, -jet.y, 1.0}, Matrix3d::Zero()};
    at.hessian.topLeftCorner<2, 2>() << -jet.xx, -jet.xy, -jet.xy, -jet.yy;
    return at;
  });
}

// Radial profile g(r) as a jet in x and y; slope_over_r is g'(r) / r, finite at 0.
Jet radial_jet(double x, double y, double value, double slope_over_r, double second) {
  const double r2 = x * x + y * y;
  // f_ij = g'/r delta_ij + (g'' - g'/r) x_i x_j / r^2
  const double mixed = r2 > 0.0 ? (second - slope_over_r) / r2 : 0.0;
  return {value,
          slope_over_r * x,
          slope_over_r * y,
          slope_over_r + mixed * x * x,
          mixed * x * y,
          slope_over_r + mixed * y * y};
}

Mesh icosahedron() {
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  Mesh mesh;
  mesh.points.resize(12, 3);
  mesh.points << -1, t, 0, 1, t, 0, -1, -t, 0, 1, -t, 0, 0, -1, t, 0, 1, t, 0, -1, -t, 0, 1, -t, t,
      0, -1, t, 0, 1, -t, 0, -1, -t, 0, 1;
  mesh.points.rowwise().normalize();
  mesh.triangles.resize(20, 3);
  mesh.triangles << 0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2,
      10, 7, 6, 7, 1, 8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10,
      8, 6, 7, 9, 8, 1;
  return mesh;
}

// Each icosahedron face cut into frequency^2 triangles, pushed to the unit sphere. Points on an
// edge are made once, from its lower to its higher end, so neighbours share them.
Mesh geodesic_sphere(Index frequency) {
  const Mesh base = icosahedron();
  Mesh mesh;
  mesh.points.resize(10 * frequency * frequency + 2, 3);
  mesh.triangles.resize(20 * frequency * frequency, 3);
  mesh.points.topRows(12) = base.points;
  Index next_point = 12;
  const auto interpolate = [&](int32_t a, int32_t b, int32_t c, Index i, Index j) {
    const double n = static_cast<double>(frequency);
    const double wb = static_cast<double>(i) / n;
    const double wc = static_cast<double>(j) / n;
    const double wa = static_cast<double>(frequency - i - j) / n;
    return (wa * base.points.row(a) + wb * base.points.row(b) + wc * base.points.row(c))
        .normalized()
        .eval();
  };
  std::map<std::pair<int32_t, int32_t>, Index> first_of_edge;
  const auto edge_point = [&](int32_t a, int32_t b, Index step) -> Index {
    if (step == 0) return a;
    if (step == frequency) return b;
    if (a > b) {
      std::swap(a, b);
      step = frequency - step;
    }
    const auto [it, is_new] = first_of_edge.try_emplace({a, b}, next_point);
    if (is_new) {
      for (Index k = 1; k < frequency; ++k) {
        mesh.points.row(next_point++) = interpolate(a, b, b, k, 0);
      }
    }
    return it->second + step - 1;
  };
  Index next_face = 0;
  std::vector<Index> grid(static_cast<std::size_t>((frequency + 1) * (frequency + 1)));
  const auto at = [&](Index i, Index j) -> Index& {
    return grid[static_cast<std::size_t>(i * (frequency + 1) + j)];
  };
  for (Index f = 0; f < 20; ++f) {
    const int32_t a = base.triangles(f, 0);
    const int32_t b = base.triangles(f, 1);
    const int32_t c = base.triangles(f, 2);
    for (Index i = 0; i <= frequency; ++i) {
      for (Index j = 0; i + j <= frequency; ++j) {
        if (j == 0) {
          at(i, j) = edge_point(a, b, i);
        } else if (i == 0) {
          at(i, j) = edge_point(a, c, j);
        } else if (i + j == frequency) {
          at(i, j) = edge_point(b, c, j);
        } else {
          mesh.points.row(next_point) = interpolate(a, b, c, i, j);
          at(i, j) = next_point++;
        }
      }
    }
    const auto add = [&](Index u, Index v, Index w) {
      mesh.triangles.row(next_face++) << static_cast<int32_t>(u), static_cast<int32_t>(v),
          static_cast<int32_t>(w);
    };
    for (Index i = 0; i < frequency; ++i) {
      for (Index j = 0; i + j < frequency; ++j) {
        add(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < frequency) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
    }
  }
  return mesh;
}

Mesh sphere_of(Index num_vertices) {
  require_count(num_vertices, 12);
  const double frequency = std::sqrt(static_cast<double>(num_vertices - 2) / 10.0);
  return geodesic_sphere(std::max<Index>(1, std::lround(frequency)));
}

// Rows of vertices joined by triangles; closed in a direction: the last is followed by the first.
// On staggered grids every odd row is shifted by half a column to the right.
Triangles join_rows(Index rows, Index columns, bool closed_rows, bool closed_columns,
                    bool staggered) {
  const Index row_gaps = closed_rows ? rows : rows - 1;
  const Index column_gaps = closed_columns ? columns : columns - 1;
  Triangles triangles(2 * row_gaps * column_gaps, 3);
  Index next = 0;
  for (Index i = 0; i < row_gaps; ++i) {
    for (Index j = 0; j < column_gaps; ++j) {
      const auto at = [&](Index row, Index column) {
        return static_cast<int32_t>((row % rows) * columns + column % columns);
      };
      const int32_t a = at(i, j);
      const int32_t b = at(i, j + 1);
      const int32_t c = at(i + 1, j + 1);
      const int32_t d = at(i + 1, j);
      if (staggered && i % 2 == 0) {
        triangles.row(next++) << a, b, d;
        triangles.row(next++) << b, c, d;
      } else {
        triangles.row(next++) << a, b, c;
        triangles.row(next++) << a, c, d;
      }
    }
  }
  return triangles;
}

Mesh plane_domain(const PlaneOptions& options) {
  require_length(options.half_width, "half_width");
  require_count(options.num_vertices, 9);
  const bool hexagonal = options.lattice == Lattice::hexagonal;
  const double largest_jitter = hexagonal ? 0.4 : 0.3;
  if (!(options.jitter >= 0.0 && options.jitter <= largest_jitter)) {
    throw InvalidArgument("jitter: " + std::to_string(options.jitter) + " is outside 0 to " +
                          (hexagonal ? "0.4" : "0.3"));
  }
  const double side = std::sqrt(static_cast<double>(options.num_vertices));
  const double stretch = hexagonal ? std::sqrt(std::sqrt(0.75)) : 1.0;
  const Index columns = std::max<Index>(3, std::lround(side * stretch));
  const Index rows = std::max<Index>(3, std::lround(side / stretch));
  const double w = options.half_width;
  const double row_width = static_cast<double>(columns - 1) + (hexagonal ? 0.5 : 0.0);
  const double dx = 2.0 * w / row_width;
  const double dy = 2.0 * w / static_cast<double>(rows - 1);
  Mesh mesh;
  mesh.points.resize(rows * columns, 3);
  mesh.triangles = join_rows(rows, columns, false, false, hexagonal);
  Rng rng(options.seed);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      const double shift = hexagonal && i % 2 == 1 ? 0.5 : 0.0;
      double x = -w + (static_cast<double>(j) + shift) * dx;
      double y = -w + static_cast<double>(i) * dy;
      const bool is_inside = i > 0 && i + 1 < rows && j > 0 && j + 1 < columns;
      if (is_inside && options.jitter > 0.0) {
        const double radius = options.jitter * std::min(dx, dy) * std::sqrt(rng.uniform());
        const double angle = rng.uniform(0.0, 2.0 * kPi);
        x += radius * std::cos(angle);
        y += radius * std::sin(angle);
      }
      mesh.points.row(i * columns + j) << x, y, 0.0;
    }
  }
  return mesh;
}

void require_curvature(double k) {
  if (!std::isfinite(k)) throw InvalidArgument("k: not finite");
}

Points spread_directions(int count, double width, std::uint64_t seed) {
  Rng rng(seed);
  Points centers(count, 3);
  for (int i = 0; i < count; ++i) {
    // After 200 refusals the sphere counts as full and overlap is accepted.
    for (int attempt = 0; attempt < 200; ++attempt) {
      const double z = rng.uniform(-1.0, 1.0);
      const double angle = rng.uniform(0.0, 2.0 * kPi);
      const double r = std::sqrt(1.0 - z * z);
      centers.row(i) << r * std::cos(angle), r * std::sin(angle), z;
      bool is_free = true;
      for (int j = 0; j < i && is_free; ++j) {
        const double cosine = std::clamp(centers.row(i).dot(centers.row(j)), -1.0, 1.0);
        is_free = std::acos(cosine) >= 4.0 * width;
      }
      if (is_free) break;
    }
  }
  return centers;
}

}  // namespace

AnalyticSurface make_icosphere(double radius, int subdivisions) {
  require_length(radius, "radius");
  if (subdivisions < 0 || subdivisions > 12) {
    throw InvalidArgument("subdivisions: " + std::to_string(subdivisions) + " is outside 0 to 12");
  }
  Mesh mesh = icosahedron();
  for (int s = 0; s < subdivisions; ++s) {
    mesh = midpoint_subdivide(mesh);
    mesh.points.rowwise().normalize();
  }
  mesh.points *= radius;
  return with_curvature(std::move(mesh), [radius](const Vector3d& p) {
    return Implicit{p / radius, Matrix3d::Identity() / radius};
  });
}

AnalyticSurface make_sphere(double radius, Index num_vertices) {
  require_length(radius, "radius");
  Mesh mesh = sphere_of(num_vertices);
  mesh.points *= radius;
  return with_curvature(std::move(mesh), [radius](const Vector3d& p) {
    return Implicit{p / radius, Matrix3d::Identity() / radius};
  });
}

AnalyticSurface make_ellipsoid(double a, double b, double c, Index num_vertices) {
  require_length(a, "a");
  require_length(b, "b");
  require_length(c, "c");
  Mesh mesh = sphere_of(num_vertices);
  const Vector3d axes(a, b, c);
  for (Index k = 0; k < 3; ++k) mesh.points.col(k) *= axes(k);
  // The field is scaled by the largest axis so that tiny and huge ellipsoids stay in range.
  const double size = axes.maxCoeff();
  const Vector3d weight = (size / axes.array()).square();
  return with_curvature(std::move(mesh), [weight, size](const Vector3d& p) {
    return Implicit{weight.cwiseProduct(p / size), weight.asDiagonal().toDenseMatrix() / size};
  });
}

AnalyticSurface make_cylinder(double radius, double height, Index num_vertices) {
  require_length(radius, "radius");
  require_length(height, "height");
  require_count(num_vertices, 9);
  const double girth = 2.0 * kPi * radius;
  // Rows of equilateral triangles: spacing s, row distance s sqrt(3)/2.
  const double spacing =
      std::sqrt(girth / static_cast<double>(num_vertices) * height / std::sqrt(0.75));
  const Index columns = std::max<Index>(3, std::lround(girth / spacing));
  const Index rows = std::max<Index>(
      2, std::lround(static_cast<double>(num_vertices) / static_cast<double>(columns)));
  Mesh mesh;
  mesh.points.resize(rows * columns, 3);
  mesh.triangles = join_rows(rows, columns, false, true, true);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      const double shift = i % 2 == 1 ? 0.5 : 0.0;
      const double angle =
          2.0 * kPi * (static_cast<double>(j) + shift) / static_cast<double>(columns);
      const double z = height * (static_cast<double>(i) / static_cast<double>(rows - 1) - 0.5);
      mesh.points.row(i * columns + j) << radius * std::cos(angle), radius * std::sin(angle), z;
    }
  }
  return with_curvature(std::move(mesh), [radius](const Vector3d& p) {
    return Implicit{{p.x() / radius, p.y() / radius, 0.0},
                    Vector3d(1.0, 1.0, 0.0).asDiagonal().toDenseMatrix() / radius};
  });
}

AnalyticSurface make_torus(double major, double minor, Index num_vertices) {
  require_length(major, "major");
  require_length(minor, "minor");
  if (!(minor < major)) throw InvalidArgument("minor: must be smaller than major");
  require_count(num_vertices, 9);
  // Square cells on the centre circle of the tube.
  const Index rows = std::max<Index>(
      3, std::lround(std::sqrt(static_cast<double>(num_vertices) * (minor / major))));
  const Index columns = std::max<Index>(
      3, std::lround(static_cast<double>(num_vertices) / static_cast<double>(rows)));
  Mesh mesh;
  mesh.points.resize(rows * columns, 3);
  mesh.triangles = join_rows(rows, columns, true, true, false);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      const double tube = 2.0 * kPi * static_cast<double>(i) / static_cast<double>(rows);
      const double turn = 2.0 * kPi * static_cast<double>(j) / static_cast<double>(columns);
      const double r = major + minor * std::cos(tube);
      mesh.points.row(i * columns + j) << r * std::cos(turn), r * std::sin(turn),
          minor * std::sin(tube);
    }
  }
  // F = sqrt((rho - R)^2 + z^2) with rho the distance from the axis; grad F is already a unit.
  return with_curvature(std::move(mesh), [major, minor](const Vector3d& p) {
    const double rho = std::hypot(p.x(), p.y());
    const Vector3d radial(p.x() / rho, p.y() / rho, 0.0);
    const Vector3d around(-radial.y(), radial.x(), 0.0);
    const double cosine = (rho - major) / minor;
    const Vector3d normal = cosine * radial + Vector3d(0.0, 0.0, p.z() / minor);
    const Vector3d along = around.cross(normal);
    return Implicit{
        normal, along * along.transpose() / minor + (cosine / rho) * around * around.transpose()};
  });
}

AnalyticSurface make_plane(const PlaneOptions& options) {
  return make_graph(plane_domain(options), [](double, double) { return Jet{}; });
}

AnalyticSurface make_saddle(double k, const PlaneOptions& options) {
  require_curvature(k);
  return make_graph(plane_domain(options), [k](double x, double y) {
    return Jet{k * (x * x - y * y), 2 * k * x, -2 * k * y, 2 * k, 0.0, -2 * k};
  });
}

AnalyticSurface make_monkey_saddle(double k, const PlaneOptions& options) {
  require_curvature(k);
  return make_graph(plane_domain(options), [k](double x, double y) {
    return Jet{k * (x * x * x - 3 * x * y * y),
               3 * k * (x * x - y * y),
               -6 * k * x * y,
               6 * k * x,
               -6 * k * y,
               -6 * k * x};
  });
}

AnalyticSurface make_paraboloid(double k, const PlaneOptions& options) {
  require_curvature(k);
  return make_graph(plane_domain(options), [k](double x, double y) {
    return Jet{-0.5 * k * (x * x + y * y), -k * x, -k * y, -k, 0.0, -k};
  });
}

AnalyticSurface make_gaussian_bump(double height, double sigma, const PlaneOptions& options) {
  if (!std::isfinite(height)) throw InvalidArgument("height: not finite");
  require_length(sigma, "sigma");
  return make_graph(plane_domain(options), [height, sigma](double x, double y) {
    const double r2 = (x * x + y * y) / (sigma * sigma);
    const double z = height * std::exp(-0.5 * r2);
    const double slope_over_r = -z / (sigma * sigma);
    return radial_jet(x, y, z, slope_over_r, slope_over_r * (1.0 - r2));
  });
}

AnalyticSurface make_raised_disk(double radius, double height, double edge_width,
                                 const PlaneOptions& options) {
  require_length(radius, "radius");
  if (!std::isfinite(height)) throw InvalidArgument("height: not finite");
  if (!(edge_width >= 0.0 && 0.5 * edge_width < radius && radius < options.half_width)) {
    throw InvalidArgument("radius: need edge_width / 2 < radius < half_width, edge_width >= 0");
  }
  const auto profile = [=](double x, double y) {
    const double r = std::hypot(x, y);
    if (r <= radius - 0.5 * edge_width) return Jet{height};
    if (r >= radius + 0.5 * edge_width) return Jet{};
    const double t = (r - radius) / edge_width + 0.5;
    const double value = height * (1.0 - t * t * t * (10.0 + t * (6.0 * t - 15.0)));
    const double slope = -height * 30.0 * t * t * (1.0 - t) * (1.0 - t) / edge_width;
    const double second =
        -height * 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t) / (edge_width * edge_width);
    return radial_jet(x, y, value, slope / r, second);
  };
  AnalyticSurface surface = make_graph(plane_domain(options), profile);
  if (edge_width == 0.0) {
    for (Eigen::VectorXd* values : {&surface.mean, &surface.gauss, &surface.k1, &surface.k2}) {
      values->resize(0);
    }
  }
  return surface;
}

BumpySphere make_bumpy_sphere(double radius, Index num_vertices, const BumpOptions& options) {
  require_length(radius, "radius");
  if (options.num_bumps < 0 || options.num_bumps > 10'000) {
    throw InvalidArgument("num_bumps: outside 0 to 10000");
  }
  if (!(std::isfinite(options.height) && options.height > -0.5)) {
    throw InvalidArgument("height: must be finite and above -0.5 radii");
  }
  if (!(options.width > 0.0 && options.width <= 1.0)) {
    throw InvalidArgument("width: outside (0, 1] radians");
  }
  Mesh mesh = sphere_of(num_vertices);
  BumpySphere result;
  result.centers = spread_directions(options.num_bumps, options.width, options.seed);
  result.nearest_vertex.resize(options.num_bumps);
  for (Index i = 0; i < options.num_bumps; ++i) {
    Index nearest = 0;
    (mesh.points * result.centers.row(i).transpose()).maxCoeff(&nearest);
    result.nearest_vertex(i) = static_cast<int>(nearest);
  }
  const double w2 = options.width * options.width;
  const double height = options.height;
  const Points& centers = result.centers;
  for (Index v = 0; v < mesh.points.rows(); ++v) {
    double r = 1.0;
    for (Index i = 0; i < centers.rows(); ++i) {
      r += height * std::exp((mesh.points.row(v).dot(centers.row(i)) - 1.0) / w2);
    }
    mesh.points.row(v) *= r * radius;
  }
  // F = |x| - radius (1 + sum_i e_i(u)) with s = u . c: grad s = (c - s u)/r and
  // Hess s = (3 s u u' - c u' - u c' - s I)/r^2.
  result.surface = with_curvature(std::move(mesh), [&](const Vector3d& p) {
    const double r = p.norm();
    const Vector3d u = p / r;
    Implicit at{u, (Matrix3d::Identity() - u * u.transpose()) / r};
    for (Index i = 0; i < centers.rows(); ++i) {
      const Vector3d c = centers.row(i).transpose();
      const double s = u.dot(c);
      const double e = radius * height * std::exp((s - 1.0) / w2) / w2;
      const Vector3d slope = (c - s * u) / r;
      const Matrix3d bend = (3.0 * s * u * u.transpose() - c * u.transpose() - u * c.transpose() -
                             s * Matrix3d::Identity()) /
                            (r * r);
      at.gradient -= e * slope;
      at.hessian -= e * (slope * slope.transpose() / w2 + bend);
    }
    return at;
  });
  return result;
}

}  // namespace dupin
