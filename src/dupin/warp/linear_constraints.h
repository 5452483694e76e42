#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dupin/warp/planar_graph.h"

namespace dupin {

/// A weighted sum of vertices that has a given place: sum weight q_vertex = value.
struct PlaceConstraint {
  std::vector<std::int32_t> vertex;
  std::vector<double> weight;  ///< sum 1
  std::string name;            ///< for messages
};

/// Vertices and weighted sums of vertices that are held. Sums are eliminated, not penalised: of
/// each, one vertex is expressed by the others, so that what is left is free and positive definite.
class LinearConstraints {
 public:
  struct Term {
    std::int32_t vertex;
    double weight;
  };

  LinearConstraints() = default;
  /// @param rows constraints of one vertex fix it; the others must be independent of each other
  /// @throws AnalysisError E_PINS_CROWDED naming a constraint that the ones before it imply or
  ///   contradict
  LinearConstraints(Eigen::Index num_vertices, const std::vector<PlaceConstraint>& rows);

  enum class Role : std::uint8_t { free, fixed, follower };
  Role role(Eigen::Index v) const { return role_[static_cast<std::size_t>(v)]; }

  /// How the displacement of vertex v follows from those of free vertices: itself, nothing, or the
  /// negative sum of others.
  std::vector<Term> displacement(Eigen::Index v) const;

  struct Follower {
    std::int32_t vertex;
    std::vector<Term> terms;  ///< displacement = sum weight * displacement of free vertices
  };
  const std::vector<Follower>& followers() const { return followers_; }

  /// Moves `q` (#V by 2) the least so that all hold: fixed vertices go to their places, sums are
  /// met by the smallest change of their free vertices. `values` (#rows by 2) [px].
  void enforce(Points2& q, const Points2& values) const;

  /// Largest distance of a constraint from its value [px].
  double largest_violation(const Points2& q, const Points2& values) const;

 private:
  std::vector<PlaceConstraint> rows_;
  std::vector<Role> role_;
  std::vector<Follower> followers_;
  std::vector<std::int32_t> follower_of_;  // #V, into followers_ or -1
  std::vector<std::int32_t> sums_;         // rows of more than one vertex
  Eigen::MatrixXd inverse_gram_;           // of the free parts of the sums
};

}  // namespace dupin
