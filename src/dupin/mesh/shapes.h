#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "dupin/mesh/mesh.h"

namespace dupin {

/// A sampled surface whose curvature is known. Normals point outward (towards +z for graphs); with
/// them H > 0 on a sphere, and k1 >= k2 are signed. Curvature arrays are empty where the surface
/// has none everywhere (the sharp step of make_raised_disk()).
struct AnalyticSurface {
  Mesh mesh;              ///< V vertices, oriented like `normals`
  Points normals;         ///< V by 3, unit, of the smooth surface
  Eigen::VectorXd mean;   ///< V  H = (k1 + k2) / 2 [1/mu]
  Eigen::VectorXd gauss;  ///< V  K = k1 k2 [1/mu^2]
  Eigen::VectorXd k1;     ///< V  larger principal curvature [1/mu]
  Eigen::VectorXd k2;     ///< V  smaller principal curvature [1/mu]
};

/// How a rectangle is sampled.
enum class Lattice {
  square,     ///< squares, all cut along the (+x, +y) diagonal
  hexagonal,  ///< rows of equilateral triangles: six equal neighbours inside
};

/// Domain and sampling of planes and graphs z = f(x, y): the square |x|, |y| <= half_width.
struct PlaneOptions {
  double half_width = 1.0;             ///< > 0 [mu]
  Eigen::Index num_vertices = 10'000;  ///< about; >= 9
  Lattice lattice = Lattice::hexagonal;
  double jitter = 0.0;  ///< largest displacement in the plane / spacing, in [0, 0.4]: no triangle
                        ///< of the hexagonal lattice folds below 0.43; [0, 0.3] for squares
  std::uint64_t seed = 0;  ///< of the jitter
};

// Every generator below throws InvalidArgument, naming field and range, for a length that is not
// positive and finite, for fewer vertices than the shape can have or more than 100 million. The
// number of vertices is met to within one row of the sampling. Cost: O(V).

/// Sphere about the origin from an icosahedron whose edges are halved `subdivisions` times (0 to
/// 12): 10 4^n + 2 vertices.
AnalyticSurface make_icosphere(double radius, int subdivisions);

/// Sphere of about `num_vertices` >= 12: 10 f^2 + 2 with the frequency f of the geodesic grid.
AnalyticSurface make_sphere(double radius, Eigen::Index num_vertices);

/// Ellipsoid with half axes a, b, c along x, y, z: the affine image of make_sphere(1).
AnalyticSurface make_ellipsoid(double a, double b, double c, Eigen::Index num_vertices);

/// Open cylinder about the z axis, |z| <= height / 2, of nearly equilateral triangles. H = 1 / 2r.
AnalyticSurface make_cylinder(double radius, double height, Eigen::Index num_vertices);

/// Torus about the z axis: tube of radius `minor` whose centre runs at distance `major` > minor.
AnalyticSurface make_torus(double major, double minor, Eigen::Index num_vertices);

/// The square in z = 0.
AnalyticSurface make_plane(const PlaneOptions& options = {});

/// z = k (x^2 - y^2): k1 = 2|k|, k2 = -2|k| at the origin.
AnalyticSurface make_saddle(double k, const PlaneOptions& options = {});

/// z = k (x^3 - 3 x y^2): flat umbilic at the origin.
AnalyticSurface make_monkey_saddle(double k, const PlaneOptions& options = {});

/// z = -k (x^2 + y^2) / 2, a cap for k > 0: H = k at the origin.
AnalyticSurface make_paraboloid(double k, const PlaneOptions& options = {});

/// z = height exp(-(x^2 + y^2) / (2 sigma^2)): H = height / sigma^2 at the top.
AnalyticSurface make_gaussian_bump(double height, double sigma, const PlaneOptions& options = {});

/// A disk of radius `radius` lifted by `height` over the plane. The step runs over
/// [radius - edge_width / 2, radius + edge_width / 2] along 6t^5 - 15t^4 + 10t^3 (C2);
/// edge_width = 0 makes it sharp, one edge wide, without curvature arrays.
/// Needs edge_width / 2 < radius < half_width.
AnalyticSurface make_raised_disk(double radius, double height, double edge_width,
                                 const PlaneOptions& options = {});

/// Bumps of a bumpy sphere.
struct BumpOptions {
  int num_bumps = 12;      ///< >= 0; their centres keep the distance 4 width where there is room
  double height = 0.1;     ///< radial, in radii; negative: dents
  double width = 0.2;      ///< standard deviation in radians, in (0, 1]
  std::uint64_t seed = 0;  ///< of the centres
};

/// A bumpy sphere and where its bumps are.
struct BumpySphere {
  AnalyticSurface surface;
  Points centers;                  ///< #bumps by 3, unit directions
  Eigen::VectorXi nearest_vertex;  ///< #bumps: vertex nearest to each direction
};

/// |x| = radius (1 + sum_i height exp((u . c_i - 1) / width^2)) with u = x / |x|: Gaussian bumps
/// about the directions c_i, smooth everywhere, with their exact curvature.
BumpySphere make_bumpy_sphere(double radius, Eigen::Index num_vertices,
                              const BumpOptions& options = {});

}  // namespace dupin
