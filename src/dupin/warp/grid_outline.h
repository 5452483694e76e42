#pragma once

#include <cstdint>
#include <vector>

#include "dupin/warp/hexagonal_lattice.h"
#include "dupin/warp/planar_mesh.h"
#include "dupin/warp/planar_triangulation.h"

namespace dupin {

/// An outline in mesh steps about the middle of its box, so that its meshes do not depend on where
/// in the picture it lies. Segment s runs from corner s to next_corner(s); corners are numbered
/// loop by loop.
class GridOutline {
 public:
  /// @throws InvalidArgument for a corner off the grid of 2^-8 px; Error E_TOO_LARGE for an extent
  ///   over 32,768 px
  explicit GridOutline(const Outline& outline);

  const std::vector<GridSegment>& segments() const { return segments_; }
  GridPoint corner(std::int32_t c) const { return segments_[at(c)].from; }
  std::int32_t next_corner(std::int32_t c) const { return next_[at(c)]; }
  std::int32_t loop(std::int32_t s) const { return loop_[at(s)]; }
  std::int32_t edge(std::int32_t s) const { return s - first_[at(loop_[at(s)])]; }

  /// A box around, with a quarter of the extent to spare.
  GridPoint box_low() const { return {-box_, -box_}; }
  GridPoint box_high() const { return {box_, box_}; }

  Eigen::RowVector2d to_pixels(GridPoint p) const;
  /// False if the pixel lies outside the box.
  bool to_grid(double x, double y, GridPoint& p) const;

  /// True inside and on the outline, by exact tests. Cost: O(corners).
  bool contains(GridPoint p) const;

  /// Twice the enclosed area in square mesh steps.
  std::int64_t area() const;

  /// Where on segment s the point p of it lies: 0 at its start, 1 at its end.
  double parameter(std::int32_t s, GridPoint p) const;

  /// Per triangle of `mesh`, with all segments inserted, the component it belongs to; -1 outside.
  /// @throws AnalysisError E_OUTLINE_NESTING
  std::vector<std::int32_t> label_triangles(const PlanarTriangulation& mesh) const;

  /// Each throws AnalysisError E_OUTLINE_CROSSED with loops, edges and place.
  [[noreturn]] void refuse_crossing(std::int32_t s, std::int32_t other) const;
  [[noreturn]] void refuse_touching(std::int32_t s, std::int32_t corner) const;
  [[noreturn]] void refuse_repeated(std::int32_t corner, std::int32_t other) const;

 private:
  static std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

  std::vector<GridSegment> segments_;
  std::vector<std::int32_t> next_, loop_, first_, component_;
  std::int64_t origin_x_ = 0, origin_y_ = 0;  // mesh steps of the middle of the box
  std::int32_t box_ = 0;
};

/// "loop 0, edge 12" for messages.
std::string edge_name(std::int64_t loop, std::int64_t edge);
/// " near (10.5, 20.25)".
std::string near_place(double x, double y);

}  // namespace dupin
