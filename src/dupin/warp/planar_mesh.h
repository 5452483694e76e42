#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin {

using Points2 = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// The outline of a cut-out: closed polylines in pixels, x right, y down, pixel centres at .5.
/// Every loop lists each corner once, the last is joined to the first. Outer loops have a positive
/// shoelace sum (clockwise as the picture is looked at), holes a negative one. Loops are simple and
/// do not touch each other.
struct Outline {
  std::vector<Points2> loops;           ///< per loop: #corners by 2 [px]
  std::vector<std::int32_t> component;  ///< per loop: the connected part of the shape it bounds
};

/// Triangles in the plane whose border is an Outline.
struct PlanarMesh {
  Points2 points;       ///< #V by 2 [px]
  Triangles triangles;  ///< #F by 3, every one with a positive shoelace sum
};

/// Half the shoelace sum of a closed polyline [px^2]; > 0 for outer loops. Sums are taken about the
/// first corner. Cost: O(corners).
double signed_area(const Points2& loop);

/// Signed area enclosed by the whole outline: outer loops less the holes [px^2].
double signed_area(const Outline& outline);

/// Signed area of triangle `face` [px^2]; > 0 unless it is degenerate or flipped.
double signed_area(const PlanarMesh& mesh, Eigen::Index face);

/// Throws unless every coordinate is finite and every index is in range.
/// @throws InvalidArgument naming the first offending vertex or face. Cost: O(V + F).
void validate(const PlanarMesh& mesh);

/// Throws unless every loop has at least three corners, all finite, and there is one component
/// number a loop. Simplicity is not looked at. @throws InvalidArgument. Cost: O(corners).
void validate(const Outline& outline);

}  // namespace dupin
