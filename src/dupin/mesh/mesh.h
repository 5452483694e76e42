#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace dupin {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Triangles = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A triangle mesh as two plain arrays, immutable by habit. Derived things (topology, normals,
/// curvature) are values that functions compute; nothing is cached here.
struct Mesh {
  Points points;        ///< #V by 3, row-major [mu]
  Triangles triangles;  ///< #F by 3, 0-based, counter-clockwise seen from outside
};

/// Points without faces.
struct PointCloud {
  Points points;   ///< #V by 3 [mu]
  Points normals;  ///< #V by 3 unit vectors, or 0 by 3 when unknown
};

/// Throws unless every coordinate is finite and every index is in range.
/// @throws InvalidArgument naming the first offending vertex or face. Cost: O(V + F).
void validate(const Mesh& mesh);

/// Area of triangle `face` [mu^2].
double triangle_area(const Mesh& mesh, Eigen::Index face);

/// Sum of the triangle areas [mu^2]. Cost: O(F).
double surface_area(const Mesh& mesh);

/// Signed volume enclosed by an oriented closed surface, > 0 for outward normals [mu^3]. Moments
/// are taken about the mean vertex. Meaningless for an open surface. Cost: O(F).
double enclosed_volume(const Mesh& mesh);

/// Unit normals at the vertices: area-weighted sums of the adjacent face normals; zero where a
/// vertex has no face of positive area. #V by 3. Cost: O(V + F).
Points vertex_normals(const Mesh& mesh);

}  // namespace dupin
