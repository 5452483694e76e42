#include "dupin/warp/linear_constraints.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::RowVector2d;

constexpr double kDependent = 1e-9;  // of weights that sum to 1: what is left of a row is rounding

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

using SparseRow = std::map<std::int32_t, double>;

// row -= factor * other
void subtract(SparseRow& row, double factor, const SparseRow& other) {
  for (const auto& [vertex, weight] : other) row[vertex] -= factor * weight;
}

}  // namespace

LinearConstraints::LinearConstraints(Index num_vertices, const std::vector<PlaceConstraint>& rows)
    : rows_(rows), role_(at(num_vertices), Role::free), follower_of_(at(num_vertices), -1) {
  for (const PlaceConstraint& row : rows_) {
    if (row.vertex.size() == 1) role_[at(row.vertex[0])] = Role::fixed;
  }
  std::vector<std::pair<std::int32_t, SparseRow>> reduced;  // pivot and row, pivot weight 1
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const PlaceConstraint& row = rows_[r];
    if (row.vertex.size() == 1) continue;
    SparseRow rest;
    for (std::size_t i = 0; i < row.vertex.size(); ++i) {
      if (role_[at(row.vertex[i])] != Role::fixed) rest[row.vertex[i]] += row.weight[i];
    }
    for (const auto& [pivot, other] : reduced) {
      const auto found = rest.find(pivot);
      if (found == rest.end()) continue;
      const double factor = found->second;
      subtract(rest, factor, other);
      rest.erase(pivot);
    }
    std::int32_t pivot = -1;
    double largest = kDependent;
    for (const auto& [vertex, weight] : rest) {
      if (std::abs(weight) <= largest) continue;
      largest = std::abs(weight);
      pivot = vertex;
    }
    if (pivot < 0) {
      throw AnalysisError("E_PINS_CROWDED",
                          row.name + " lies in a triangle that other pins hold already",
                          "use a finer mesh, or make the pins vertices of it");
    }
    const double scale = 1.0 / rest[pivot];
    for (auto& entry : rest) entry.second *= scale;
    for (auto& [other_pivot, other] : reduced) {
      const auto found = other.find(pivot);
      if (found == other.end()) continue;
      const double factor = found->second;
      subtract(other, factor, rest);
      other.erase(pivot);
    }
    reduced.emplace_back(pivot, std::move(rest));
    sums_.push_back(static_cast<std::int32_t>(r));
  }
  for (const auto& [pivot, row] : reduced) {
    Follower follower{pivot, {}};
    for (const auto& [vertex, weight] : row) {
      if (vertex != pivot && weight != 0.0) follower.terms.push_back({vertex, -weight});
    }
    role_[at(pivot)] = Role::follower;
    follower_of_[at(pivot)] = static_cast<std::int32_t>(followers_.size());
    followers_.push_back(std::move(follower));
  }

  const auto num_sums = static_cast<Index>(sums_.size());
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(num_sums, num_sums);
  std::map<std::int32_t, std::vector<std::pair<Index, double>>> by_vertex;
  for (Index s = 0; s < num_sums; ++s) {
    const PlaceConstraint& row = rows_[at(sums_[at(s)])];
    for (std::size_t i = 0; i < row.vertex.size(); ++i) {
      if (role_[at(row.vertex[i])] != Role::fixed)
        by_vertex[row.vertex[i]].emplace_back(s, row.weight[i]);
    }
  }
  for (const auto& entry : by_vertex) {
    for (const auto& [s, weight] : entry.second) {
      for (const auto& [t, other] : entry.second) gram(s, t) += weight * other;
    }
  }
  if (num_sums > 0) inverse_gram_ = gram.llt().solve(Eigen::MatrixXd::Identity(num_sums, num_sums));
}

std::vector<LinearConstraints::Term> LinearConstraints::displacement(Index v) const {
  switch (role(v)) {
    case Role::free:
      return {{static_cast<std::int32_t>(v), 1.0}};
    case Role::fixed:
      return {};
    case Role::follower:
      break;
  }
  return followers_[at(follower_of_[at(v)])].terms;
}

void LinearConstraints::enforce(Points2& q, const Points2& values) const {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    if (rows_[r].vertex.size() == 1) q.row(rows_[r].vertex[0]) = values.row(static_cast<Index>(r));
  }
  const auto num_sums = static_cast<Index>(sums_.size());
  // The second round removes what rounding in the inverse left.
  for (int round = 0; round < 2 && num_sums > 0; ++round) {
    Points2 missing(num_sums, 2);
    for (Index s = 0; s < num_sums; ++s) {
      const PlaceConstraint& row = rows_[at(sums_[at(s)])];
      missing.row(s) = values.row(sums_[at(s)]);
      for (std::size_t i = 0; i < row.vertex.size(); ++i)
        missing.row(s) -= row.weight[i] * q.row(row.vertex[i]);
    }
    const Points2 step = inverse_gram_ * missing;
    for (Index s = 0; s < num_sums; ++s) {
      const PlaceConstraint& row = rows_[at(sums_[at(s)])];
      for (std::size_t i = 0; i < row.vertex.size(); ++i) {
        if (role(row.vertex[i]) != Role::fixed) q.row(row.vertex[i]) += row.weight[i] * step.row(s);
      }
    }
  }
}

double LinearConstraints::largest_violation(const Points2& q, const Points2& values) const {
  double largest = 0.0;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    RowVector2d place = RowVector2d::Zero();
    for (std::size_t i = 0; i < rows_[r].vertex.size(); ++i)
      place += rows_[r].weight[i] * q.row(rows_[r].vertex[i]);
    largest = std::max(largest, (place - values.row(static_cast<Index>(r))).norm());
  }
  return largest;
}

}  // namespace dupin
