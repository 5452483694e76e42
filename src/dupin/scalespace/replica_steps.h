#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <new>
#include <vector>

#include "dupin/scalespace/diffusion_operator.h"
#include "dupin/scalespace/filter_bank.h"

namespace dupin::detail {

/// Fields side by side in one row: one load of an index serves them all.
constexpr Eigen::Index kReplicaLanes = 16;

/// The operator's rows in sets such that the neighbours of set d lie in sets d - 1, d and d + 1
/// (breadth-first levels, small ones joined). A sweep may then run step k on set d as soon as step
/// k - 1 is done on set d + 1: many steps while a few sets are in the cache.
struct RowSets {
  Eigen::Index num_rows = 0;
  std::vector<std::int32_t> vertex;     ///< #V: vertex of each row
  std::vector<std::int32_t> set_start;  ///< #sets + 1
  std::vector<std::int32_t> offset;     ///< #V + 1
  std::vector<std::int32_t> neighbor;   ///< rows
  std::vector<float> weight;            ///< aligned with neighbor; empty: umbrella
  std::vector<float> off_diagonal;      ///< #V: factor of the sum of the neighbours
  std::vector<float> diagonal;          ///< #V: B_ii
  Eigen::Index largest_set = 0;

  Eigen::Index num_sets() const { return static_cast<Eigen::Index>(set_start.size()) - 1; }
};

RowSets make_row_sets(const DiffusionOperator& op);

/// A stop of the walk up the levels. Polynomials are in Chebyshev form,
/// p(s) = sum_k coefficient[k] T_k(1 - 2 s / s_max).
struct ReplicaStop {
  Eigen::Index level = 0;       ///< F^level = step(B) F of the stop before (the first: of F^0)
  Eigen::VectorXd step;         ///< empty: F^0 itself
  Eigen::Index loc_level = -1;  ///< LoC of this level = loc(B) F^level; -1: none
  Eigen::VectorXd loc;
};

/// A walk up the levels that stops at all fine ones and then leaves some out, so that the scale
/// does not quite double from one stop to the next where levels are closer than that.
/// A step is the least-squares fit that makes the product of all steps so far closest to the
/// transfer function of its level, in the norms of a white signal, of the Laplacian of one (which
/// the height noise is), and of the Laplacians of both; steps too long for a fit are the series of
/// the quotient itself.
struct ReplicaPlan {
  std::vector<ReplicaStop> stops;
  double largest_error = 0.0;  ///< root of the sum of the four squared relative errors of a stop
  Eigen::Index num_products = 0;
};

/// Remembered as filter_bank(). `error` is the relative error allowed; it enters a standard
/// deviation by its square only, since what remains of a fit is orthogonal to it.
std::shared_ptr<const ReplicaPlan> replica_plan(const LevelSchedule& schedule, Filter filter,
                                                double spectrum_bound, double error);

/// Memory on cache lines, so that a row is one whole load.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kLine{64};
  CacheLineAllocator() = default;
  template <class U>
  explicit CacheLineAllocator(const CacheLineAllocator<U>&) {}
  T* allocate(std::size_t count) {
    return static_cast<T*>(::operator new(count * sizeof(T), kLine));
  }
  void deallocate(T* memory, std::size_t) { ::operator delete(memory, kLine); }
  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator&) { return true; }
};

/// Memory of sixteen fields that walk up the levels; rows of `kReplicaLanes` in the order of
/// RowSets.
struct ReplicaFields {
  using Buffer = std::vector<float, CacheLineAllocator<float>>;
  Buffer level;  ///< F^l
  Buffer next;   ///< result of apply_polynomial()
  Buffer even, odd;
};

/// next = p(B) level for sixteen fields.
void apply_polynomial(const RowSets& sets, double spectrum_bound,
                      const Eigen::VectorXd& coefficient, ReplicaFields& fields);

/// sum[r] = sum over the lanes of the squares of row r.
void sum_of_squares(const float* rows, Eigen::Index num_rows, float* sum);

/// An extremum over its ring.
struct ReplicaPeak {
  std::int32_t row;
  std::int32_t lane;
  float value;
};

/// Strict extrema of every lane over the ring with value^2 > floor[r]. Rows with
/// floor[r] = infinity are left out.
void find_peaks(const RowSets& sets, const float* rows, const float* floor,
                std::vector<ReplicaPeak>& peaks);

}  // namespace dupin::detail
