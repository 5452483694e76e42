#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/mesh/topology.h"
#include "dupin/surface/laplacian.h"

namespace dupin {

/// The operator B of the stack, B = -L: positive semi-definite in the inner product of `mass`, rows
/// sum to zero, spectrum in [0, spectrum_bound]. Umbrella (Eq. 5.19): B = I - D^-1 A, mass D
/// (valences). Cotan: B = (e^2 / 4) M^-1 S, mass M; the factor makes one unit of tau the same
/// length for both: on a regular mesh I - D^-1 A is -(e^2/4) Laplacian.
///
/// Rows are kept in slices of eight (sliced ELL) in an order of its own, so that the inner loop has
/// no branch.
struct DiffusionOperator {
  static constexpr Eigen::Index kLanes = 8;  ///< rows in a slice

  Eigen::Index num_vertices = 0;
  double spectrum_bound = 2.0;  ///< rigorous: no eigenvalue is larger
  Eigen::VectorXd mass;         ///< #V weights of the inner product, > 0

  // Sliced rows. Row r stands for vertex order[r]. A slice of eight rows of equal length whose
  // neighbours lie within 65,536 rows of each other is compact: entry (j, lane) is neighbour row
  // slice_base + compact_index[slice_start + j * kLanes + lane], two bytes each, and all eight rows
  // share one off_diagonal. Any other slice has slice_base -1 and 4-byte entries in `index`; its
  // missing entries point to the row num_rows_padded(), which is kept at zero. The steps of the
  // recurrence are bound by memory: compact slices move 46 instead of 68 bytes a vertex.
  std::vector<std::int32_t> order;        ///< #V: vertex of each row
  std::vector<std::int32_t> row_of;       ///< #V: row of each vertex
  std::vector<std::int64_t> slice_start;  ///< #slices: first entry, in compact_index or index
  std::vector<std::int32_t> slice_width;  ///< #slices: entries of a row
  std::vector<std::int32_t> slice_base;   ///< #slices: smallest neighbour row, or -1
  std::vector<std::uint16_t> compact_index;
  std::vector<std::int32_t> index;  ///< neighbour rows
  std::vector<double>
      weight;  ///< b_ij aligned with index (then no slice is compact); empty: umbrella
  std::vector<double> off_diagonal;  ///< rows padded: 1 / valence
  std::vector<double> diagonal;      ///< rows padded: B_ii; empty: all are 1

  Eigen::Index num_slices() const { return static_cast<Eigen::Index>(slice_start.size()); }
  Eigen::Index num_rows_padded() const { return num_slices() * kLanes; }

  /// B x for x in vertex order. For tests and the reference solver.
  Eigen::VectorXd apply(const Eigen::VectorXd& x) const;
};

/// Umbrella operator of a graph. Isolated vertices keep their value. `topology` may be given for a
/// triangle mesh: then the bound of the spectrum is max_v (faces(v) + boundary edges(v)) / (2
/// valence(v)) + 1 <= 2, 3/2 when closed, instead of 2, which saves one step in seven. Proof: sum
/// over triangles of (x_i + x_j + x_k)^2 plus sum over boundary edges of (x_i + x_j)^2 is >= 0 and
/// equals x^T diag(faces + boundary edges) x + 4 (x^T A x) / 2 when every edge has one or two
/// faces.
/// @throws InvalidArgument if the sizes differ. Cost: O(E).
DiffusionOperator umbrella_operator(const Adjacency& ring, const MeshTopology* topology = nullptr);

/// Cotan operator in units of the squared mean edge length `edge` [mu]. The bound is max over edges
/// of the sum of the diagonal entries of its ends (Gershgorin in the space of edges).
/// @throws InvalidArgument if the sizes differ or edge is not > 0. Cost: O(E).
DiffusionOperator cotan_operator(const Adjacency& ring, const CotanWeights& weights, double edge);

}  // namespace dupin
