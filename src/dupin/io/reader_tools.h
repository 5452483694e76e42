#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "dupin/base/error.h"
#include "dupin/base/run_control.h"
#include "dupin/io/read_options.h"
#include "dupin/mesh/polygon_mesh.h"

namespace dupin::detail {

/// Indices are 32 bits wide, whatever the limits say.
inline constexpr std::int64_t kMaxIndex = 2'147'483'647;

/// Reports progress and throws Error(Errc::interrupted) once the run is cancelled. Call it every
/// few thousand elements.
void check_run(const RunControl& run, std::int64_t done, std::int64_t total);

/// Judges a number of elements that a file claims, before anything is allocated for it.
/// @param least_bytes the smallest size of one element in the file
/// @throws IoError E_COUNT_EXCEEDS_FILE if it is over `limit` and the file cannot hold it,
///   E_TOO_LARGE if it is over `limit` and the file might. A claim within the limit that the file
///   cannot hold is a truncated file, which the reader finds at its end.
void check_claim(const char* what, std::int64_t claimed, std::int64_t limit,
                 std::int64_t least_bytes, std::int64_t bytes_left, const Location& location);

/// The elements that memory is taken for: never more than the file can hold.
inline std::int64_t safe_capacity(std::int64_t claimed, std::int64_t least_bytes,
                                  std::int64_t bytes_left) {
  return std::min(claimed, bytes_left / std::max<std::int64_t>(least_bytes, 1) + 1);
}

[[noreturn]] void fail_index(std::int64_t face, std::int64_t vertex, std::int64_t num_vertices,
                             const Location& location);
[[noreturn]] void fail_polygon(std::int64_t face, std::int64_t size, const ReadLimits& limits,
                               const Location& location);
[[noreturn]] void fail_nonfinite(std::int64_t vertex, const Location& location);
[[noreturn]] void fail_limit(const char* what, std::int64_t limit, const Location& location);

inline bool is_finite(double x, double y, double z) {
  return std::isfinite(x) && std::isfinite(y) && std::isfinite(z);
}

/// Rows of three doubles of unknown number. Growing moves pages, not bytes, and memory that was
/// never written is never taken from the system.
class PointList {
 public:
  void reserve(std::int64_t rows) {
    if (rows > points_.rows()) points_.conservativeResize(rows, 3);
  }
  void add(double x, double y, double z) {
    if (size_ == points_.rows()) reserve(std::max<std::int64_t>(1024, size_ + size_ / 2));
    double* const row = points_.data() + 3 * size_++;
    row[0] = x;
    row[1] = y;
    row[2] = z;
  }
  Eigen::Index size() const { return size_; }
  const double* row(std::int64_t index) const { return points_.data() + 3 * index; }
  Points take() {
    points_.conservativeResize(size_, 3);
    return std::move(points_);
  }

 private:
  Points points_;
  Eigen::Index size_ = 0;
};

/// Faces of unknown number; the offsets exist only from the first face that is no triangle.
class FaceList {
 public:
  void reserve_indices(std::int64_t count) {
    if (count > index_.size()) index_.conservativeResize(count);
  }
  void add_triangle(std::int32_t a, std::int32_t b, std::int32_t c) {
    std::int32_t* const slot = grow(3);
    slot[0] = a;
    slot[1] = b;
    slot[2] = c;
    ++num_faces_;
    if (has_offsets_) push_offset();
  }
  /// Adds a vertex to the face that end_face() will close.
  void add_index(std::int32_t vertex) { *grow(1) = vertex; }
  void end_face() {
    if (!has_offsets_ && size_ != 3 * (num_faces_ + 1)) make_offsets();
    ++num_faces_;
    if (has_offsets_) push_offset();
  }
  /// Room for `count` triangles, of which keep_triangles() then keeps the first ones. Only while
  /// there has been no other face.
  std::int32_t* triangles(std::int64_t count) {
    std::int32_t* const slots = grow(3 * count);
    size_ -= 3 * count;
    return slots;
  }
  void keep_triangles(std::int64_t count) {
    size_ += 3 * count;
    num_faces_ += count;
  }
  std::int64_t num_faces() const { return num_faces_; }
  bool has_only_triangles() const { return !has_offsets_; }
  /// Vertices of the open face.
  std::int64_t open_size() const { return size_ - closed_size(); }
  std::int32_t* open_face() { return index_.data() + closed_size(); }

  void move_to(PolygonMesh& mesh);

 private:
  std::int64_t closed_size() const {
    return has_offsets_ ? offset_.data()[num_faces_] : 3 * num_faces_;
  }
  std::int32_t* grow(std::int64_t count) {
    if (size_ + count > index_.size()) grow_capacity(count);
    std::int32_t* const slot = index_.data() + size_;
    size_ += count;
    return slot;
  }
  void grow_capacity(std::int64_t count);
  void make_offsets();
  void push_offset() {
    if (num_faces_ >= offset_.size()) offset_.conservativeResize(num_faces_ + num_faces_ / 2 + 2);
    offset_.data()[num_faces_] = static_cast<std::int32_t>(size_);
  }

  PolygonMesh::Indices index_;
  PolygonMesh::Indices offset_;
  std::int64_t size_ = 0;
  std::int64_t num_faces_ = 0;
  bool has_offsets_ = false;
};

}  // namespace dupin::detail
