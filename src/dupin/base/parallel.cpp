#include "dupin/base/parallel.h"

#include <algorithm>
#include <string>
#include <vector>

#include "dupin/base/error.h"

#ifdef DUPIN_USE_TBB
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <memory>
#include <mutex>
#endif

namespace dupin {
namespace {

#ifdef DUPIN_USE_TBB

// The one place that knows about threads. An arena of its own keeps the limit away from an
// application that uses oneTBB itself.
struct Pool {
  std::mutex mutex;
  int count = tbb::info::default_concurrency();
  std::unique_ptr<tbb::global_control> limit;
  std::shared_ptr<tbb::task_arena> arena = std::make_shared<tbb::task_arena>(count);
};

Pool& pool() {
  static Pool instance;
  return instance;
}

std::shared_ptr<tbb::task_arena> current_arena() {
  const std::lock_guard<std::mutex> lock(pool().mutex);
  return pool().arena;
}

#endif

}  // namespace

int thread_count() {
#ifdef DUPIN_USE_TBB
  const std::lock_guard<std::mutex> lock(pool().mutex);
  return pool().count;
#else
  return 1;
#endif
}

void set_thread_count(int count) {
  if (count < 0 || count > 1024) {
    throw InvalidArgument("threads is " + std::to_string(count) + ", legal range 0 to 1024");
  }
#ifdef DUPIN_USE_TBB
  Pool& p = pool();
  const std::lock_guard<std::mutex> lock(p.mutex);
  p.count = count == 0 ? tbb::info::default_concurrency() : count;
  if (p.count > tbb::info::default_concurrency()) {
    p.limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                    static_cast<std::size_t>(p.count));
  }
  p.arena = std::make_shared<tbb::task_arena>(p.count);
#endif
}

void parallel_for(Eigen::Index begin, Eigen::Index end, Eigen::Index grain,
                  const std::function<void(Eigen::Index, Eigen::Index)>& body) {
  if (begin >= end) return;
#ifdef DUPIN_USE_TBB
  const auto arena = current_arena();
  if (arena->max_concurrency() > 1 && end - begin > grain) {
    arena->execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<Eigen::Index>(
              begin, end, static_cast<std::size_t>(std::max<Eigen::Index>(1, grain))),
          [&](const tbb::blocked_range<Eigen::Index>& range) { body(range.begin(), range.end()); });
    });
    return;
  }
#else
  static_cast<void>(grain);
#endif
  body(begin, end);
}

double parallel_sum(Eigen::Index begin, Eigen::Index end, Eigen::Index block,
                    const std::function<double(Eigen::Index, Eigen::Index)>& term) {
  if (begin >= end) return 0.0;
  const Eigen::Index num_blocks = (end - begin + block - 1) / block;
  std::vector<double> part(static_cast<std::size_t>(num_blocks));
  parallel_for(0, num_blocks, 1, [&](Eigen::Index first, Eigen::Index last) {
    for (Eigen::Index b = first; b < last; ++b) {
      part[static_cast<std::size_t>(b)] =
          term(begin + b * block, std::min(end, begin + (b + 1) * block));
    }
  });
  double sum = 0.0;
  for (const double value : part) sum += value;
  return sum;
}

}  // namespace dupin
