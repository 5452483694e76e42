#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/io/formats.h"
#include "dupin/io/ply_header.h"
#include "dupin/io/reader_tools.h"
#include "dupin/io/text_scanner.h"

namespace dupin::detail {

inline constexpr std::int64_t kPlyRunStride = 1 << 16;  // elements between two looks at the run
inline constexpr std::size_t kPlySlots = 6;             // x y z nx ny nz

// What the reader takes from one property of a vertex or face.
struct PlyRole {
  PlyProperty property;
  bool is_list = false;
  bool is_index_list = false;
  int slot = -1;            // vertex: 0..5
  std::int64_t offset = 0;  // in a record without lists [bytes]
};

// What both bodies share: the sizes, the places to write to, and the faults.
class PlyBody {
 public:
  PlyBody(ByteSpan bytes, const std::string& name, const ReadOptions& options,
          const RunControl& run, PlyHeader header)
      : bytes_(bytes), name_(name), options_(options), run_(run), header_(std::move(header)) {
    prepare();
  }

  SurfaceFile read();

 private:
  void prepare();
  std::vector<PlyRole> roles_of(const PlyElement& element) const;
  void check_vertex_properties(const PlyElement& element) const;
  void allocate(const PlyElement& element, std::int64_t least_bytes, std::int64_t bytes_left,
                const Location& location);
  void store(std::int64_t vertex, const double (&values)[kPlySlots]) {
    double* const point = file_.mesh.points.data() + 3 * vertex;
    for (int axis = 0; axis < 3; ++axis) point[axis] = values[axis];
    if (has_normals_) store_normal(vertex, values + 3);
  }
  void store_normal(std::int64_t vertex, const double* normal);

  void read_ascii();
  void read_ascii_vertices(TextScanner& scanner, const PlyElement& element);
  void read_ascii_faces(TextScanner& scanner, const PlyElement& element);
  std::int64_t take_triangles(TextScanner& scanner, std::int64_t count);
  void skip_ascii(TextScanner& scanner, const PlyElement& element);
  void next_ascii(TextScanner& scanner, std::int64_t index);
  std::int64_t ascii_list_count(TextScanner& scanner, std::int64_t bytes_each);

  template <bool kSwap>
  void read_binary();
  template <bool kSwap, class T>
  void read_packed_vertices(const PlyElement& element, const std::vector<PlyRole>& roles);
  template <bool kSwap>
  void read_binary_vertices(const PlyElement& element);
  template <bool kSwap>
  void read_packed_triangles(const PlyElement& element);
  template <bool kSwap>
  void read_binary_faces(const PlyElement& element);
  template <bool kSwap>
  void skip_binary(const PlyElement& element);
  template <bool kSwap>
  std::int64_t binary_list_count(const PlyProperty& property, const PlyElement& element,
                                 std::int64_t index);

  std::int64_t left() const { return static_cast<std::int64_t>(bytes_.size() - at_); }
  Location here() const { return {name_, 0, static_cast<std::int64_t>(at_)}; }
  void need(std::int64_t count, const PlyElement& element, std::int64_t index) const {
    if (left() < count) fail_truncated(element, index);
  }
  [[noreturn]] void fail_truncated(const PlyElement& element, std::int64_t index) const;

  ByteSpan bytes_;
  const std::string& name_;
  const ReadOptions& options_;
  const RunControl& run_;
  PlyHeader header_;
  SurfaceFile file_;
  FaceList faces_;
  std::size_t at_ = 0;
  std::int64_t num_vertices_ = 0;
  bool has_normals_ = false;
};

}  // namespace dupin::detail
