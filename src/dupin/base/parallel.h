#pragma once

#include <Eigen/Core>
#include <functional>

namespace dupin {

/// Threads that parallel_for() may use. Results never depend on it.
int thread_count();

/// Sets thread_count() for the process. 0: as many as the machine offers.
/// @throws InvalidArgument if count < 0 or count > 1024
void set_thread_count(int count);

/// Calls body(first, last) on disjoint ranges that cover [begin, end), possibly at the same time.
/// Ranges hold at least `grain` indices (but for the last). The body must write only what belongs
/// to its own indices; then the result is the same for every number of threads.
void parallel_for(Eigen::Index begin, Eigen::Index end, Eigen::Index grain,
                  const std::function<void(Eigen::Index, Eigen::Index)>& body);

/// Sum of term(first, last) over blocks of exactly `block` indices, added in block order: the same
/// bits for every number of threads.
double parallel_sum(Eigen::Index begin, Eigen::Index end, Eigen::Index block,
                    const std::function<double(Eigen::Index, Eigen::Index)>& term);

}  // namespace dupin
