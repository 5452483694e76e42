#include "dupin/spatial/neighborhoods.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/assert.h"
#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/spatial/cells.h"

namespace dupin {
namespace {

using detail::Box;
using detail::Cells;
using detail::squared_gap;
using Eigen::Index;
using std::int32_t;
using std::size_t;
using Place = std::array<double, 3>;
using Neighbor = std::pair<double, int32_t>;  // squared distance, index: their order breaks ties

// Measured for 20 and 100 neighbours: leaves of 8 are slower, batches of 64 hardly faster.
constexpr int32_t kLeafSize = 16;
constexpr int32_t kBatchSize = 32;
constexpr size_t kNumBins = 128;

double squared_distance(const Place& a, const Place& b) {
  const double dx = a[0] - b[0];
  const double dy = a[1] - b[1];
  const double dz = a[2] - b[2];
  return dx * dx + dy * dy + dz * dz;
}

// An upper bound of the rounded squared distances of all points within a + b. Each of the few
// operations errs by 2^-53 of its result, or by 5e-324 where a square underflows.
double square_of_sum(double a, double b) {
  const double sum = (a + b) * (1.0 + 1e-14) + 1e-160;
  return sum * sum * (1.0 + 1e-14);
}

// Bins of equal width for squared distances up to `largest`, and one more for all beyond. If they
// are so small that bins would have no width, all go into the first.
double bin_scale(double largest) {
  return largest > 1e-300 ? static_cast<double>(kNumBins) / largest : 0.0;
}
size_t bin_of(double squared, double scale) {
  return static_cast<size_t>(
      static_cast<int32_t>(std::min(squared * scale, static_cast<double>(kNumBins))));
}

// Finds the neighbours of one batch of queries after another; owns what that needs.
class Searcher {
 public:
  Searcher(const Cells& cells, const Cells& queries, int k)
      : cells_(cells), queries_(queries), k_(static_cast<size_t>(k)) {}

  void visit_nearest(const Cells::Node& batch, const NeighborVisitor& visit);
  void visit_within(const Cells::Node& batch, double squared_radius, const NeighborVisitor& visit);

 private:
  Place query(int32_t q) const {
    const auto i = static_cast<size_t>(q);
    return {queries_.x[i], queries_.y[i], queries_.z[i]};
  }
  void pass_on(int32_t q, size_t count, const NeighborVisitor& visit) const {
    visit(queries_.index[static_cast<size_t>(q)], {index_.data(), count}, {squared_.data(), count});
  }
  bool gather(const Box& box, double squared_reach, size_t limit);
  void load();
  double reach_of(const Place& from, size_t limit);
  void find_one_by_one(const Cells::Node& batch, const NeighborVisitor& visit);
  void measure(const Place& from, size_t count);
  void sort_into_rings(const Place& center, double outermost);
  size_t keep_within(const Place& from, double bound, size_t count);
  double keep_nearest(size_t count, double bound);
  void find_nearest(const Place& from);

  const Cells& cells_;
  const Cells& queries_;
  size_t k_;
  size_t num_candidates_ = 0;
  std::vector<double> x_, y_, z_;  // candidates of the batch
  std::vector<int32_t> candidate_;
  std::vector<double> all_squared_;  // of the candidates from one place
  std::vector<double> squared_;      // of the neighbours
  std::vector<int32_t> index_;
  std::vector<std::uint8_t> bin_;
  std::vector<Neighbor> found_;  // by find_nearest(), or in the last bin of keep_nearest()
  std::vector<std::pair<int32_t, int32_t>> runs_;
  // Rings about the centre of the batch: a query need not look at those beyond its reach.
  double ring_scale_ = 0.0;
  std::array<size_t, kNumBins + 1> ring_end_{};
  std::vector<double> sorted_x_, sorted_y_, sorted_z_;
  std::vector<int32_t> sorted_candidate_;
};

// Copies the points of all leaves within reach of the box to the candidates, unless there are more
// than `limit`. Points at one place are in order of index: the first k of them suffice.
bool Searcher::gather(const Box& box, double squared_reach, size_t limit) {
  runs_.clear();
  num_candidates_ = 0;
  std::array<int32_t, Cells::kMaxDepth> stack{};
  size_t depth = 0;
  if (cells_.size() > 0) stack[depth++] = 0;
  while (depth > 0) {
    const int32_t self = stack[--depth];
    const Cells::Node& node = cells_.nodes[static_cast<size_t>(self)];
    if (squared_gap(node.box, box) > squared_reach) continue;
    if (!node.is_leaf()) {
      stack[depth++] = node.right;
      stack[depth++] = self + 1;
      continue;
    }
    int32_t last = node.last;
    if (node.is_one_place() && static_cast<size_t>(node.size()) > k_) {
      last = node.first + static_cast<int32_t>(k_);
    }
    num_candidates_ += static_cast<size_t>(last - node.first);
    if (num_candidates_ > limit) return false;
    if (!runs_.empty() && runs_.back().second == node.first) {
      runs_.back().second = last;
    } else {
      runs_.emplace_back(node.first, last);
    }
  }
  load();
  return true;
}

void Searcher::load() {
  if (num_candidates_ > candidate_.size()) {
    const size_t size = num_candidates_ + num_candidates_ / 2;
    for (auto* values :
         {&x_, &y_, &z_, &sorted_x_, &sorted_y_, &sorted_z_, &all_squared_, &squared_}) {
      values->resize(size);
    }
    for (auto* values : {&candidate_, &sorted_candidate_, &index_}) values->resize(size);
    bin_.resize(size);
  }
  size_t to = 0;
  for (const auto& [first, last] : runs_) {
    const auto copy = [first = first, last = last, to](const auto& from, auto& target) {
      std::copy(from.begin() + first, from.begin() + last,
                target.begin() + static_cast<std::ptrdiff_t>(to));
    };
    copy(cells_.x, x_);
    copy(cells_.y, y_);
    copy(cells_.z, z_);
    copy(cells_.index, candidate_);
    to += static_cast<size_t>(last - first);
  }
}

void Searcher::measure(const Place& from, size_t count) {
  const double* __restrict x = x_.data();
  const double* __restrict y = y_.data();
  const double* __restrict z = z_.data();
  double* __restrict all = all_squared_.data();
  for (size_t i = 0; i < count; ++i) {
    const double dx = x[i] - from[0];
    const double dy = y[i] - from[1];
    const double dz = z[i] - from[2];
    all[i] = dx * dx + dy * dy + dz * dz;
  }
}

// Sorts the candidates into rings about the centre of the batch. Points farther than `outermost`
// (squared) share the last ring.
void Searcher::sort_into_rings(const Place& center, double outermost) {
  measure(center, num_candidates_);
  ring_scale_ = bin_scale(outermost);
  ring_end_.fill(0);
  for (size_t i = 0; i < num_candidates_; ++i) {
    const size_t ring = bin_of(all_squared_[i], ring_scale_);
    bin_[i] = static_cast<std::uint8_t>(ring);
    ++ring_end_[ring];
  }
  size_t begin = 0;
  for (size_t& end : ring_end_) begin += std::exchange(end, begin);
  for (size_t i = 0; i < num_candidates_; ++i) {
    const size_t to = ring_end_[bin_[i]]++;
    sorted_x_[to] = x_[i];
    sorted_y_[to] = y_[i];
    sorted_z_[to] = z_[i];
    sorted_candidate_[to] = candidate_[i];
  }
  x_.swap(sorted_x_);
  y_.swap(sorted_y_);
  z_.swap(sorted_z_);
  candidate_.swap(sorted_candidate_);
}

// Those of the first `count` candidates whose squared distance is at most `bound`, to the front of
// index_ and squared_.
size_t Searcher::keep_within(const Place& from, double bound, size_t count) {
  measure(from, count);
  const double* __restrict all = all_squared_.data();
  // Without branches: which candidates are near is as good as random.
  const int32_t* __restrict candidate = candidate_.data();
  int32_t* __restrict index = index_.data();
  double* __restrict squared = squared_.data();
  size_t kept = 0;
  for (size_t i = 0; i < count; ++i) {
    squared[kept] = all[i];
    index[kept] = candidate[i];
    kept += all[i] <= bound ? 1U : 0U;
  }
  return kept;
}

// The k nearest of the first `count` in index_ and squared_, to the front. On a surface the squared
// distances are nearly uniform, so a histogram leaves few to compare. Returns the largest.
double Searcher::keep_nearest(size_t count, double bound) {
  DUPIN_ASSERT(count >= k_);
  double* squared = squared_.data();
  int32_t* index = index_.data();
  const double scale = bin_scale(bound);
  std::array<int32_t, kNumBins + 1> in_bin{};
  for (size_t i = 0; i < count; ++i) {
    const size_t bin = bin_of(squared[i], scale);
    bin_[i] = static_cast<std::uint8_t>(bin);
    ++in_bin[bin];
  }
  size_t last_bin = kNumBins;
  size_t below = count;
  while (below >= k_ + static_cast<size_t>(in_bin[last_bin])) {
    below -= static_cast<size_t>(in_bin[last_bin]);
    --last_bin;
  }
  below -= static_cast<size_t>(in_bin[last_bin]);
  found_.clear();
  size_t kept = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t bin = bin_[i];
    if (bin == last_bin) found_.emplace_back(squared[i], index[i]);
    squared[kept] = squared[i];
    index[kept] = index[i];
    kept += bin < last_bin ? 1U : 0U;
  }
  DUPIN_ASSERT(kept == below && kept < k_);
  // Sorted, so that the order is no matter of the standard library.
  const auto end = found_.begin() + static_cast<std::ptrdiff_t>(k_ - kept);
  std::partial_sort(found_.begin(), end, found_.end());
  for (auto neighbor = found_.begin(); neighbor != end; ++neighbor) {
    squared[kept] = neighbor->first;
    index[kept] = neighbor->second;
    ++kept;
  }
  return squared[k_ - 1];
}

// The k nearest of one place, to found_, nearest first, by the tree alone.
void Searcher::find_nearest(const Place& from) {
  const Box here{from, from};
  const auto cut = static_cast<std::ptrdiff_t>(k_ - 1);
  double bound = std::numeric_limits<double>::infinity();
  found_.clear();
  std::array<std::pair<double, int32_t>, Cells::kMaxDepth> stack{};
  size_t depth = 0;
  stack[depth++] = {0.0, 0};
  while (depth > 0) {
    const auto [gap, self] = stack[--depth];
    if (gap > bound) continue;
    const Cells::Node& node = cells_.nodes[static_cast<size_t>(self)];
    if (!node.is_leaf()) {
      std::pair<double, int32_t> near{
          squared_gap(cells_.nodes[static_cast<size_t>(self) + 1].box, here), self + 1};
      std::pair<double, int32_t> far{
          squared_gap(cells_.nodes[static_cast<size_t>(node.right)].box, here), node.right};
      if (far.first < near.first) std::swap(near, far);
      stack[depth++] = far;
      stack[depth++] = near;
      continue;
    }
    auto last = static_cast<size_t>(node.last);
    if (node.is_one_place()) last = std::min(last, static_cast<size_t>(node.first) + k_);
    for (auto i = static_cast<size_t>(node.first); i < last; ++i) {
      const double squared = squared_distance({cells_.x[i], cells_.y[i], cells_.z[i]}, from);
      if (squared <= bound) found_.emplace_back(squared, cells_.index[i]);
    }
    // Cutting to k after every k more costs a constant for each.
    if (found_.size() >= 2 * k_) {
      std::nth_element(found_.begin(), found_.begin() + cut, found_.end());
      found_.resize(k_);
      bound = found_.back().first;
    }
  }
  std::partial_sort(found_.begin(), found_.begin() + cut + 1, found_.end());
  found_.resize(k_);
}

// The squared distance of the k-th nearest of one place; negative if more than `limit` points would
// have to be looked at. The smallest cell with k points bounds it, and a ball of that size has it.
double Searcher::reach_of(const Place& from, size_t limit) {
  const Box here{from, from};
  const auto wanted = static_cast<int32_t>(k_);
  size_t self = 0;
  while (!cells_.nodes[self].is_leaf()) {
    const auto right = static_cast<size_t>(cells_.nodes[self].right);
    const bool is_right =
        squared_gap(cells_.nodes[right].box, here) < squared_gap(cells_.nodes[self + 1].box, here);
    const size_t child = is_right ? right : self + 1;
    if (cells_.nodes[child].size() < wanted) break;
    self = child;
  }
  const Cells::Node& cell = cells_.nodes[self];
  num_candidates_ = static_cast<size_t>(cell.is_one_place() ? wanted : cell.size());
  runs_.assign(1, {cell.first, cell.first + static_cast<int32_t>(num_candidates_)});
  load();
  const size_t all = keep_within(from, std::numeric_limits<double>::infinity(), num_candidates_);
  const double largest =
      *std::max_element(squared_.begin(), squared_.begin() + static_cast<std::ptrdiff_t>(all));
  const double bound = keep_nearest(all, largest);
  if (!gather(here, bound, limit)) return -1.0;
  return keep_nearest(keep_within(from, bound, num_candidates_), bound);
}

// Expects the room for k neighbours that reach_of() makes.
void Searcher::find_one_by_one(const Cells::Node& batch, const NeighborVisitor& visit) {
  for (int32_t q = batch.first; q < batch.last; ++q) {
    find_nearest(query(q));
    for (size_t j = 0; j < k_; ++j) {
      squared_[j] = found_[j].first;
      index_[j] = found_[j].second;
    }
    pass_on(q, k_, visit);
  }
}

// The triangle inequality bounds the k-th distance of every query of the batch by that of its
// centre, and that of each query by its predecessor's. Queries that lie far apart compared with
// their distance from the points share too little.
void Searcher::visit_nearest(const Cells::Node& batch, const NeighborVisitor& visit) {
  Place center;
  for (size_t c = 0; c < 3; ++c) center[c] = 0.5 * (batch.box.low[c] + batch.box.high[c]);
  double farthest = 0.0;
  for (int32_t q = batch.first; q < batch.last; ++q) {
    farthest = std::max(farthest, squared_distance(query(q), center));
  }
  const size_t limit = 24 * k_ + 512;
  const double squared_reach = reach_of(center, limit);
  if (squared_reach < 0.0) return find_one_by_one(batch, visit);
  const double center_reach = std::sqrt(squared_reach);
  if (!gather(batch.box, square_of_sum(center_reach, std::sqrt(farthest)), limit)) {
    return find_one_by_one(batch, visit);
  }
  // No query reaches farther from the centre than that.
  sort_into_rings(center, square_of_sum(center_reach, 2.0 * std::sqrt(farthest)));
  Place previous = center;
  double reach = center_reach;
  for (int32_t q = batch.first; q < batch.last; ++q) {
    const Place from = query(q);
    const double off_center = std::sqrt(squared_distance(from, center));
    const double bound = std::min(square_of_sum(reach, std::sqrt(squared_distance(from, previous))),
                                  square_of_sum(center_reach, off_center));
    const size_t ring = bin_of(square_of_sum(std::sqrt(bound), off_center), ring_scale_);
    reach = std::sqrt(keep_nearest(keep_within(from, bound, ring_end_[ring]), bound));
    previous = from;
    pass_on(q, k_, visit);
  }
}

// The order of the neighbours is that of the cells, whether or not the queries share candidates.
// They do if that costs little compared with what the first of them found: a crowd just out of
// reach must not be looked at by every batch.
void Searcher::visit_within(const Cells::Node& batch, double squared_radius,
                            const NeighborVisitor& visit) {
  const bool is_compact = squared_distance(batch.box.low, batch.box.high) <= squared_radius;
  bool is_shared = false;
  for (int32_t q = batch.first; q < batch.last; ++q) {
    const Place from = query(q);
    if (!is_shared) gather({from, from}, squared_radius, std::numeric_limits<size_t>::max());
    const size_t count = keep_within(from, squared_radius, num_candidates_);
    pass_on(q, count, visit);
    if (q == batch.first && is_compact) {
      is_shared = gather(batch.box, squared_radius, 8 * count + 256);
    }
  }
}

}  // namespace

struct NeighborSearch::Impl {
  Cells cells;

  // Calls body(searcher, batch, visitor) for every batch of queries.
  template <class Body>
  void for_batches(const Points& queries, int k,
                   const std::function<NeighborVisitor()>& make_visitor, const RunControl& run,
                   const Body& body) const {
    std::optional<Cells> sorted;
    if (!cells.holds(queries)) sorted.emplace(queries, kBatchSize, "queries");
    const Cells& from = sorted ? *sorted : cells;
    const std::vector<Cells::Node> batches = from.batches(kBatchSize);
    const auto num_batches = static_cast<Index>(batches.size());
    parallel_for(0, num_batches, 1024 / kBatchSize, [&](Index first, Index last) {
      Searcher searcher(cells, from, k);
      const NeighborVisitor visit = make_visitor();
      for (Index b = first; b < last; ++b) {
        if (run.cancelled()) return;
        body(searcher, batches[static_cast<size_t>(b)], visit);
      }
    });
  }
};

NeighborSearch::NeighborSearch(const Points& points)
    : impl_(std::make_unique<Impl>(Impl{Cells(points, kLeafSize, "points")})) {}

NeighborSearch::~NeighborSearch() = default;
NeighborSearch::NeighborSearch(NeighborSearch&&) noexcept = default;
NeighborSearch& NeighborSearch::operator=(NeighborSearch&&) noexcept = default;

Index NeighborSearch::size() const { return impl_->cells.size(); }

void NeighborSearch::visit_nearest(const Points& queries, int k,
                                   const std::function<NeighborVisitor()>& make_visitor,
                                   const RunControl& run) const {
  if (k < 1 || k > size()) {
    throw InvalidArgument("k is " + std::to_string(k) + ", legal range 1 to " +
                          std::to_string(size()));
  }
  impl_->for_batches(queries, k, make_visitor, run,
                     [](Searcher& searcher, const Cells::Node& batch,
                        const NeighborVisitor& visit) { searcher.visit_nearest(batch, visit); });
}

NeighborTable NeighborSearch::nearest(const Points& queries, int k, const RunControl& run) const {
  NeighborTable table;
  table.index.setConstant(queries.rows(), std::clamp<Index>(k, 0, size()), -1);
  table.squared.setConstant(queries.rows(), table.index.cols(),
                            std::numeric_limits<double>::infinity());
  visit_nearest(
      queries, k,
      [&]() -> NeighborVisitor {
        return [&, order = std::vector<Neighbor>()](Index query, std::span<const int32_t> index,
                                                    std::span<const double> squared) mutable {
          order.resize(index.size());
          for (size_t j = 0; j < index.size(); ++j) order[j] = {squared[j], index[j]};
          std::sort(order.begin(), order.end());
          for (size_t j = 0; j < order.size(); ++j) {
            table.index(query, static_cast<Index>(j)) = order[j].second;
            table.squared(query, static_cast<Index>(j)) = order[j].first;
          }
        };
      },
      run);
  return table;
}

void NeighborSearch::visit_within(const Points& queries, double radius,
                                  const std::function<NeighborVisitor()>& make_visitor,
                                  const RunControl& run) const {
  if (!std::isfinite(radius) || radius <= 0.0) {
    throw InvalidArgument("radius is " + std::to_string(radius) + ", must be finite and > 0");
  }
  // No cut to k: all points at one place count.
  impl_->for_batches(queries, std::numeric_limits<int>::max(), make_visitor, run,
                     [squared = radius * radius](Searcher& searcher, const Cells::Node& batch,
                                                 const NeighborVisitor& visit) {
                       searcher.visit_within(batch, squared, visit);
                     });
}

}  // namespace dupin
