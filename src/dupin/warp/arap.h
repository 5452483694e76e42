#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dupin/base/run_control.h"
#include "dupin/mesh/topology.h"
#include "dupin/warp/linear_constraints.h"
#include "dupin/warp/pair_factor.h"
#include "dupin/warp/planar_graph.h"

namespace dupin {

enum class EdgeWeights {
  uniform,    ///< 1 on every edge: the thesis's choice (Fig. 7.8)
  cotangent,  ///< half the sum of the cotangents, at least kLeastCotangent
};

inline constexpr double kLeastCotangent = 1e-3;

/// Weights w_nk aligned with graph.topology.ring.neighbor, symmetric, > 0. `num_clamped` counts the
/// edges whose cotangent weight was below kLeastCotangent. Cost: O(V + F).
struct EdgeWeighting {
  std::vector<double> weight;
  Eigen::Index num_clamped = 0;
};
EdgeWeighting edge_weights(const PlanarMesh& mesh, const PlanarGraph& graph, EdgeWeights kind);

/// As-rigid-as-possible energy of thesis 7.3.2,
///   E = sum_n w_n sum_k w_nk |(q_k - q_n) - R_n (p_k - p_n)|^2                  (Eq. 7.17),
/// and its minimisation by turns over the rotations R_n (closed form, 7.16) and the places q (one
/// linear system, 7.19 to 7.23, factorised once). Neither turn can raise E.
class ArapSystem {
 public:
  /// @param mesh        rest shape: p_n [px]
  /// @param weights     w_nk as edge_weights() gives them
  /// @param vertex_weights #V, w_n > 0
  /// @param constraints what is held; every component needs one
  /// @throws Error E_NOT_CONVERGED if a component has no constraint, E_INTERRUPTED if cancelled.
  /// Cost: one sparse Cholesky.
  ArapSystem(const PlanarMesh& mesh, const PlanarGraph& graph, const std::vector<double>& weights,
             const Eigen::VectorXd& vertex_weights, const LinearConstraints& constraints,
             const RunControl& run = {});

  /// One iteration on `q` (#V by 2), which must meet the constraints and goes on meeting them:
  /// best rotations, then best places. Returns E of `q` as it came, with the best rotations.
  /// Bits do not depend on threads. Cost: O(V + entries of the factor).
  double iterate(Points2& q) const;

  /// E of `q` with the best rotations [weights px^2].
  double energy(const Points2& q) const;

  /// #V by 2: cosine and sine of the best rotation of every cell (Eq. 7.16); (1, 0) where the cell
  /// says no direction (errata list 3).
  Points2 rotations(const Points2& q) const;

  /// #V: r_n of Eq. 7.25 over sum_k w_nk |p_k - p_n|^2; 0 for a vertex without neighbours.
  Eigen::VectorXd residuals(const Points2& q) const;

  /// Moves `q` to the best places for given maps of the triangles: row f of `maps` (#F by 4) is
  /// Z_f row by row, and what is made small is
  ///   sum_f sum_{edges e of f} W_e / faces(e) |q_e - Z_f p_e|^2,  W_e = w_nk (w_n + w_k),
  /// whose matrix is that of iterate(): the same factor serves.
  void fit_triangles(Points2& q, const Eigen::Matrix<double, Eigen::Dynamic, 4>& maps) const;

  Eigen::Index num_factor_entries() const { return factor_.num_entries(); }

 private:
  struct Node;

  void load(const Points2& q, std::vector<Node>& nodes) const;
  void rotate(std::vector<Node>& nodes) const;
  double residual(const std::vector<Node>& nodes, Points2* gradient) const;
  void descend(Points2& q, Points2& gradient) const;
  template <bool kUniform>
  void rotate_range(std::vector<Node>& nodes, Eigen::Index first, Eigen::Index last) const;
  template <bool kUniform, bool kGradient>
  double residual_range(const std::vector<Node>& nodes, Points2* gradient, Eigen::Index first,
                        Eigen::Index last) const;

  Points2 rest_;  // in the order of order_
  Triangles triangles_;
  Points2 plain_rest_;     // in the order of the mesh
  Eigen::VectorXi order_;  // #V: vertex of the mesh at place i, along a Morton curve
  std::vector<std::int32_t> offset_;
  std::vector<std::int32_t> neighbor_;  // in the new order
  std::vector<double> edge_weight_;     // aligned with neighbor_
  bool is_uniform_ = true;
  Eigen::VectorXd size_;           // sum w_nk |p_k - p_n|^2, in the new order
  Eigen::VectorXd vertex_weight_;  // in the new order
  LinearConstraints constraints_;
  PairFactor factor_;
  Eigen::VectorXi place_;            // #V: place in the factor of the vertex at place i, or -1
  Eigen::VectorXi place_of_vertex_;  // the same by vertex of the mesh
  Eigen::Matrix<double, Eigen::Dynamic, 3> face_edge_weight_;  // #F by 3: W_e / faces(e)
};

}  // namespace dupin
