#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dupin/mesh/mesh.h"

namespace dupin::detail {

struct Box {
  std::array<double, 3> low;
  std::array<double, 3> high;
};

/// Square of the gap between two boxes; 0 where they touch. Subtraction and multiplication round
/// monotonically: it never exceeds the rounded squared distance of two points inside.
inline double squared_gap(const Box& a, const Box& b) {
  double sum = 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double below = b.low[c] - a.high[c];
    const double above = a.low[c] - b.high[c];
    const double side = below > above ? below : above;
    const double gap = side > 0.0 ? side : 0.0;
    sum += gap * gap;
  }
  return sum;
}

/// Points sorted into the leaves of a kd-tree with median splits. The sorting depends on the points
/// alone, not on the standard library: ties go by index, and a leaf is in order of index.
class Cells {
 public:
  struct Node {
    Box box;  ///< tight
    std::int32_t first;
    std::int32_t last;   ///< one past the end
    std::int32_t right;  ///< the left child follows its parent; 0: a leaf

    std::int32_t size() const { return last - first; }
    bool is_leaf() const { return right == 0; }
    /// All points at one place; such a leaf has no limit of size.
    bool is_one_place() const { return box.low == box.high; }
  };

  /// Leaves of at most `leaf_size` points. @throws InvalidArgument naming `what`, if a coordinate
  /// is not finite or beyond 1e150, or if there are more than 2^31 - 1 points
  Cells(const Points& points, std::int32_t leaf_size, const char* what);

  /// Ranges of at most `limit` points that lie together and cover all; each with its box.
  std::vector<Node> batches(std::int32_t limit) const;

  /// Whether `points` are those of the constructor, in the same order.
  bool holds(const Points& points) const;

  std::int32_t size() const { return static_cast<std::int32_t>(index.size()); }

  std::vector<double> x, y, z;      ///< sorted
  std::vector<std::int32_t> index;  ///< of the sorted points in the constructor's
  std::vector<Node> nodes;          ///< preorder; none without points

  /// A stack of nodes still to visit never grows beyond this: splits halve.
  static constexpr std::size_t kMaxDepth = 64;

 private:
  struct Item;
  void split(std::vector<Item>& items, std::int32_t first, std::int32_t last,
             std::int32_t leaf_size);
};

}  // namespace dupin::detail
