#include "dupin/scalespace/replica_steps.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <list>
#include <utility>

#include "dupin/base/guarded.h"
#include "dupin/base/instruction_set.h"
#include "dupin/math/chebyshev.h"

namespace dupin::detail {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using std::int32_t;
using std::size_t;

// ---- rows ----------------------------------------------------------------------------------

constexpr Index kSmallestSet = 128;
// Sets in flight times the three fields that a step touches must fit into the second-level cache.
constexpr Index kCacheBytes = 1 << 20;

// Neighbours of a row of the operator, in its own row numbers.
template <class Action>
void for_each_entry(const DiffusionOperator& op, Index r, Action&& action) {
  constexpr Index kLanes = DiffusionOperator::kLanes;
  const auto s = static_cast<size_t>(r / kLanes);
  for (Index j = 0; j < op.slice_width[s]; ++j) {
    const auto entry = static_cast<size_t>(op.slice_start[s] + j * kLanes + r % kLanes);
    const int32_t other =
        op.slice_base[s] >= 0 ? op.slice_base[s] + op.compact_index[entry] : op.index[entry];
    if (other < op.num_vertices) action(other, entry);
  }
}

// Breadth-first levels of the operator's rows; a component starts from the row that a first search
// found last, so that there are many small levels.
void breadth_first(const DiffusionOperator& op, std::vector<int32_t>& order,
                   std::vector<int32_t>& level_start) {
  std::vector<std::uint8_t> seen(static_cast<size_t>(op.num_vertices), 0);
  std::vector<int32_t> level;
  const auto search = [&](int32_t seed, std::uint8_t mark, std::vector<int32_t>& found,
                          std::vector<int32_t>* starts) {
    size_t head = found.size();
    found.push_back(seed);
    seen[static_cast<size_t>(seed)] = mark;
    while (head < found.size()) {
      const size_t end = found.size();
      if (starts != nullptr) starts->push_back(static_cast<int32_t>(head));
      for (; head < end; ++head) {
        for_each_entry(op, found[head], [&](int32_t other, size_t) {
          std::uint8_t& flag = seen[static_cast<size_t>(other)];
          if (flag == mark) return;
          flag = mark;
          found.push_back(other);
        });
      }
    }
  };
  for (Index seed = 0; seed < op.num_vertices; ++seed) {
    if (seen[static_cast<size_t>(seed)] != 0) continue;
    level.clear();
    search(static_cast<int32_t>(seed), 1, level, nullptr);
    search(level.back(), 2, order, &level_start);
  }
  level_start.push_back(static_cast<int32_t>(order.size()));
}

// ---- polynomials ---------------------------------------------------------------------------

constexpr Index kNodes = 384;
constexpr Index kLongestFit = 150;
constexpr double kRounding = 6e-8;
// Scales grow by at most this from stop to stop, but for neighbouring levels. The first factor
// counts from a scale [squared mean edges] below which no power law holds yet.
constexpr double kLongestStride = 1.9;
constexpr double kFirstStride = 2.0;

// Nodes dense at s = 0, where coarse levels live: uniform in theta, s = s_max sin^2(theta / 2).
struct Nodes {
  VectorXd s;
  VectorXd width;  // ds
  MatrixXd chebyshev;
};

Nodes make_nodes(double s_max) {
  Nodes nodes{VectorXd(kNodes), VectorXd(kNodes), MatrixXd(kNodes, kLongestFit + 1)};
  const double step = M_PI / static_cast<double>(kNodes);
  for (Index i = 0; i < kNodes; ++i) {
    const double theta = (static_cast<double>(i) + 0.5) * step;
    nodes.s[i] = 0.5 * s_max * (1.0 - std::cos(theta));
    nodes.width[i] = 0.5 * std::sin(theta) * step;  // of a spectrum of total weight 1
    for (Index k = 0; k <= kLongestFit; ++k)
      nodes.chebyshev(i, k) = std::cos(static_cast<double>(k) * theta);
  }
  return nodes;
}

// One of the norms: spectral density s^power of the signal, times the width of the node.
struct Measure {
  VectorXd density;
  VectorXd rounding;  // squared, of what has been computed so far
};

struct Fit {
  VectorXd coefficient;
  double error = 0.0;
};

// p with p(0) = at_zero that brings p g closest to f; the lowest degree up to `longest` that keeps
// to `error`. All norms at once: per node the weighted mean of the squares. One decomposition
// serves all degrees: the first d columns of Q and R are those of the fit of degree d.
Fit fit_polynomial(const Nodes& nodes, const std::vector<Measure>& measures, const VectorXd& g,
                   const VectorXd& f, double at_zero, Index longest, double error) {
  VectorXd a = VectorXd::Zero(kNodes);
  VectorXd b = VectorXd::Zero(kNodes);
  double total = 0.0;  // of f
  for (const Measure& m : measures) {
    for (const int power : {0, 2}) {
      const VectorXd weight = nodes.s.array().pow(power);
      const VectorXd density = m.density.cwiseProduct(weight);
      const double norm = f.cwiseAbs2().dot(density);
      if (!(norm > 0.0)) continue;
      a += (density.cwiseProduct(g.cwiseAbs2()) + m.rounding.cwiseProduct(weight)) / norm;
      b += density.cwiseProduct(g).cwiseProduct(f) / norm;
      total += 1.0;
    }
  }
  const VectorXd row = a.cwiseSqrt();
  const VectorXd target = b.cwiseQuotient(row.cwiseMax(1e-150));
  const VectorXd rest = target - at_zero * row;
  // p(0) is exact, since diffusion keeps the mean: p = at_zero + sum c_k (T_k - 1).
  const MatrixXd basis = (nodes.chebyshev.middleCols(1, longest).array() - 1.0).matrix();
  const Eigen::HouseholderQR<MatrixXd> qr(row.asDiagonal() * basis);
  const VectorXd turned = qr.householderQ().adjoint() * rest;
  double square = total - target.squaredNorm() + rest.squaredNorm();
  Index degree = 0;
  while (degree < longest && !(square <= error * error)) square -= std::pow(turned[degree++], 2);
  degree = std::max<Index>(degree, 1);
  const VectorXd c = qr.matrixQR()
                         .topLeftCorner(degree, degree)
                         .triangularView<Eigen::Upper>()
                         .solve(turned.head(degree));
  Fit fit;
  fit.coefficient.resize(degree + 1);
  fit.coefficient << at_zero - c.sum(), c;
  fit.error = std::sqrt(std::max(0.0, square));
  return fit;
}

VectorXd values(const VectorXd& coefficient, const Nodes& nodes) {
  return nodes.chebyshev.leftCols(coefficient.size()) * coefficient;
}

class Planner {
 public:
  Planner(const LevelSchedule& schedule, Filter filter, double s_max, double error)
      : filter_(filter),
        s_max_(s_max),
        error_(error),
        nodes_(make_nodes(s_max)),
        steps_(time_steps(schedule)),
        tau_(level_scales(schedule, ScaleMeasure::exact)),
        exact_(kNodes, schedule.num_levels) {
    for (Index i = 0; i < kNodes; ++i)
      exact_.row(i) = transfer_functions(schedule, filter, nodes_.s[i]).transpose();
    for (const int power : {0, 2}) {
      measures_.push_back({nodes_.width.cwiseProduct(VectorXd(nodes_.s.array().pow(power))),
                           VectorXd::Zero(kNodes)});
    }
    reached_ = exact_.col(0);
  }

  ReplicaPlan plan() {
    // LoC^l = -B F^{l+1} for backward Euler, -B F^l for forward Euler.
    if (filter_ != Filter::implicit) add_stop(0);
    const Index last = steps_.size();
    for (Index level = 0; level < last;) {
      Index next = level + 1;
      while (next < last && tau_[next + 1] <= kLongestStride * (tau_[level] - kFirstStride)) ++next;
      add_stop(next);
      level = next;
    }
    return std::move(plan_);
  }

 private:
  void add_stop(Index level) {
    ReplicaStop stop;
    stop.level = level;
    if (level > 0) stop.step = step_to(level);
    if (filter_ == Filter::implicit) {
      stop.loc_level = level - 1;
    } else if (level < steps_.size()) {
      stop.loc_level = level;
    }
    if (stop.loc_level >= 0) stop.loc = loc_at(stop.loc_level);
    plan_.num_products +=
        std::max<Index>(0, stop.step.size() - 1) + std::max<Index>(0, stop.loc.size() - 1);
    plan_.stops.push_back(std::move(stop));
    before_ = level;
  }

  VectorXd step_to(Index level) {
    const VectorXd f = exact_.col(level);
    const double duration = tau_[level] - tau_[before_];
    // Twice what the steps of the defaults need.
    const auto guess = static_cast<Index>(std::min(1e6, 8.0 + 3.0 * std::sqrt(s_max_ * duration)));
    Fit fit;
    for (Index longest = std::min(guess, kLongestFit);; longest = kLongestFit) {
      fit = fit_polynomial(nodes_, measures_, reached_, f, 1.0, longest, error_);
      if (fit.error <= error_ || longest == kLongestFit) break;
    }
    VectorXd p;
    if (fit.error <= error_) {
      p = values(fit.coefficient, nodes_);
      plan_.largest_error = std::max(plan_.largest_error, fit.error);
    } else {
      fit.coefficient = series_to(level);
      p.resize(kNodes);
      for (Index i = 0; i < kNodes; ++i) {
        p[i] = evaluate_chebyshev(fit.coefficient, 0, fit.coefficient.size(), nodes_.s[i], s_max_);
      }
      plan_.largest_error = std::max(plan_.largest_error, error_);
    }
    reached_ = reached_.cwiseProduct(p);
    for (Measure& m : measures_) {
      const double norm = f.cwiseAbs2().dot(m.density);
      const auto terms = static_cast<double>(fit.coefficient.size());
      m.rounding = m.rounding.cwiseProduct(p.cwiseAbs2()) +
                   kRounding * kRounding * terms * norm * nodes_.width;
    }
    return fit.coefficient;
  }

  VectorXd series_to(Index level) const {
    const auto ratio = [&](double s) {
      VectorXd value = VectorXd::Ones(1);
      for (Index l = before_; l < level; ++l) {
        if (filter_ == Filter::implicit) value[0] /= 1.0 + steps_[l] * s;
        if (filter_ == Filter::heat) value[0] *= std::exp(-steps_[l] * s);
        if (filter_ == Filter::forward) value[0] *= 1.0 - steps_[l] * s;
      }
      return value;
    };
    const MatrixXd series = chebyshev_coefficients(ratio, s_max_);
    const int length = truncation_lengths(series, VectorXd::Constant(1, 1e-6))[0];
    return series.col(0).head(length);
  }

  VectorXd loc_at(Index level) const {
    if (filter_ != Filter::heat) {
      // -s
      return Eigen::Vector2d(-0.5 * s_max_, 0.5 * s_max_);
    }
    const VectorXd loc = (exact_.col(level + 1) - exact_.col(level)) / steps_[level];
    return fit_polynomial(nodes_, measures_, reached_, loc, 0.0, kLongestFit, error_).coefficient;
  }

  Filter filter_;
  double s_max_;
  double error_;
  Nodes nodes_;
  VectorXd steps_;
  VectorXd tau_;
  MatrixXd exact_;  // transfer functions of all levels
  std::vector<Measure> measures_;
  VectorXd reached_;  // product of the steps so far
  Index before_ = 0;
  ReplicaPlan plan_;
};

// ---- kernels -------------------------------------------------------------------------------

typedef float Vector __attribute__((vector_size(64), aligned(64), may_alias));
typedef std::int32_t Mask __attribute__((vector_size(64), aligned(64), may_alias));
static_assert(sizeof(Vector) == sizeof(float) * static_cast<size_t>(kReplicaLanes));

struct StepView {
  const int32_t* offset;
  const int32_t* neighbor;
  const float* weight;
  const float* off_diagonal;
  const float* diagonal;
};

// out = alpha off sum_j w_j x_j + (beta0 + beta1 B_ii) x - gamma previous; sum += c out (first
// step: sum = c0 x + c out).
struct TermFactors {
  float alpha, beta0, beta1, gamma, c0, c;
  bool is_first;
};

template <bool kWeighted>
DUPIN_INLINE void term_body(const StepView& op, const TermFactors& f, Index first, Index last,
                            const Vector* x, const Vector* previous, Vector* out, Vector* total) {
  for (Index r = first; r < last; ++r) {
    const int32_t start = op.offset[r];
    const int32_t count = op.offset[r + 1] - start;
    const int32_t* j = op.neighbor + start;
    Vector sum = {};
    if constexpr (kWeighted) {
      for (int32_t e = 0; e < count; ++e) sum += x[j[e]] * op.weight[start + e];
    } else if (count == 6) {
      sum = ((x[j[0]] + x[j[1]]) + (x[j[2]] + x[j[3]])) + (x[j[4]] + x[j[5]]);
    } else {
      for (int32_t e = 0; e < count; ++e) sum += x[j[e]];
    }
    const float own = f.beta0 + f.beta1 * op.diagonal[r];
    Vector value = sum * (f.alpha * op.off_diagonal[r]) + x[r] * own;
    if (f.is_first) {
      out[r] = value;
      total[r] = x[r] * f.c0 + value * f.c;
    } else {
      value -= previous[r] * f.gamma;
      out[r] = value;
      total[r] += value * f.c;
    }
  }
}

DUPIN_INLINE void term_any(const StepView& op, const TermFactors& f, Index first, Index last,
                           const Vector* x, const Vector* previous, Vector* out, Vector* total) {
  if (op.weight != nullptr) {
    term_body<true>(op, f, first, last, x, previous, out, total);
  } else {
    term_body<false>(op, f, first, last, x, previous, out, total);
  }
}

DUPIN_INLINE void squares_body(const Vector* rows, Index num_rows, float* sum) {
  for (Index r = 0; r < num_rows; ++r) {
    const Vector square = rows[r] * rows[r];
    float total = 0.0F;
    for (Index lane = 0; lane < kReplicaLanes; ++lane) total += square[lane];
    sum[r] = total;
  }
}

DUPIN_INLINE bool any(const Mask& mask) {
  std::uint64_t words[sizeof(Mask) / sizeof(std::uint64_t)];
  std::memcpy(words, &mask, sizeof(mask));
  std::uint64_t found = 0;
  for (const std::uint64_t word : words) found |= word;
  return found != 0;
}

DUPIN_INLINE void peaks_body(const StepView& op, const Vector* rows, const float* floor,
                             Index num_rows, std::vector<ReplicaPeak>& peaks) {
  for (Index r = 0; r < num_rows; ++r) {
    const Vector value = rows[r];
    const Vector limit = Vector{} + floor[r];
    const Mask is_large = value * value > limit;
    if (!any(is_large)) continue;
    Vector most = rows[op.neighbor[op.offset[r]]];
    Vector least = most;
    for (int32_t e = op.offset[r] + 1; e < op.offset[r + 1]; ++e) {
      const Vector other = rows[op.neighbor[e]];
      most = other > most ? other : most;
      least = other < least ? other : least;
    }
    const Mask is_peak = is_large & ((value > most) | (value < least));
    if (!any(is_peak)) continue;
    for (int32_t lane = 0; lane < kReplicaLanes; ++lane) {
      if (is_peak[lane] != 0) peaks.push_back({static_cast<int32_t>(r), lane, value[lane]});
    }
  }
}

#define DUPIN_VARIANT(suffix, attribute)                                                          \
  attribute void term_##suffix(const StepView& op, const TermFactors& f, Index first, Index last, \
                               const Vector* x, const Vector* previous, Vector* out,              \
                               Vector* total) {                                                   \
    term_any(op, f, first, last, x, previous, out, total);                                        \
  }                                                                                               \
  attribute void squares_##suffix(const Vector* rows, Index num_rows, float* sum) {               \
    squares_body(rows, num_rows, sum);                                                            \
  }                                                                                               \
  attribute void peaks_##suffix(const StepView& op, const Vector* rows, const float* floor,       \
                                Index num_rows, std::vector<ReplicaPeak>& peaks) {                \
    peaks_body(op, rows, floor, num_rows, peaks);                                                 \
  }

DUPIN_VARIANT(base, )
#ifdef DUPIN_X86
DUPIN_VARIANT(avx2, DUPIN_AVX2)
DUPIN_VARIANT(avx512, DUPIN_AVX512)

#define DUPIN_CALL(name, ...)                                               \
  (instruction_set() == InstructionSet::avx512 ? name##_avx512(__VA_ARGS__) \
   : instruction_set() == InstructionSet::avx2 ? name##_avx2(__VA_ARGS__)   \
                                               : name##_base(__VA_ARGS__))
#else
#define DUPIN_CALL(name, ...) name##_base(__VA_ARGS__)
#endif

const Vector* vectors(const float* rows) { return reinterpret_cast<const Vector*>(rows); }
Vector* vectors(float* rows) { return reinterpret_cast<Vector*>(rows); }

StepView view_of(const RowSets& sets) {
  return {sets.offset.data(), sets.neighbor.data(),
          sets.weight.empty() ? nullptr : sets.weight.data(), sets.off_diagonal.data(),
          sets.diagonal.data()};
}

}  // namespace

RowSets make_row_sets(const DiffusionOperator& op) {
  RowSets sets;
  sets.num_rows = op.num_vertices;
  std::vector<int32_t> order;  // the operator's row of each row here
  std::vector<int32_t> level_start;
  order.reserve(static_cast<size_t>(op.num_vertices));
  breadth_first(op, order, level_start);
  sets.set_start.push_back(0);
  for (const int32_t start : level_start) {
    if (start - sets.set_start.back() >= kSmallestSet) sets.set_start.push_back(start);
  }
  if (sets.set_start.back() != op.num_vertices)
    sets.set_start.push_back(static_cast<int32_t>(op.num_vertices));
  for (size_t d = 1; d < sets.set_start.size(); ++d) {
    sets.largest_set = std::max<Index>(sets.largest_set, sets.set_start[d] - sets.set_start[d - 1]);
  }
  std::vector<int32_t> row_of(order.size());
  for (size_t r = 0; r < order.size(); ++r) {
    row_of[static_cast<size_t>(order[r])] = static_cast<int32_t>(r);
    sets.vertex.push_back(op.order[static_cast<size_t>(order[r])]);
  }
  sets.offset.push_back(0);
  const bool is_weighted = !op.weight.empty();
  for (size_t r = 0; r < order.size(); ++r) {
    for_each_entry(op, order[r], [&](int32_t other, size_t entry) {
      sets.neighbor.push_back(row_of[static_cast<size_t>(other)]);
      if (is_weighted) sets.weight.push_back(static_cast<float>(op.weight[entry]));
    });
    sets.offset.push_back(static_cast<int32_t>(sets.neighbor.size()));
    const auto from = static_cast<size_t>(order[r]);
    sets.off_diagonal.push_back(is_weighted ? 1.0F : static_cast<float>(op.off_diagonal[from]));
    sets.diagonal.push_back(op.diagonal.empty() ? 1.0F : static_cast<float>(op.diagonal[from]));
  }
  return sets;
}

std::shared_ptr<const ReplicaPlan> replica_plan(const LevelSchedule& schedule, Filter filter,
                                                double spectrum_bound, double error) {
  struct Entry {
    LevelSchedule schedule;
    Filter filter;
    double bound;
    double error;
    std::shared_ptr<const ReplicaPlan> value;
  };
  static Guarded<std::list<Entry>> memory;
  constexpr size_t kRemembered = 8;
  const auto remembered =
      memory.with([&](std::list<Entry>& entries) -> std::shared_ptr<const ReplicaPlan> {
        for (const Entry& e : entries) {
          if (e.schedule.num_levels == schedule.num_levels &&
              e.schedule.lambda0 == schedule.lambda0 && e.schedule.delta == schedule.delta &&
              e.filter == filter && e.bound == spectrum_bound && e.error == error) {
            return e.value;
          }
        }
        return nullptr;
      });
  if (remembered) return remembered;
  auto value =
      std::make_shared<const ReplicaPlan>(Planner(schedule, filter, spectrum_bound, error).plan());
  memory.with([&](std::list<Entry>& entries) {
    entries.push_front({schedule, filter, spectrum_bound, error, value});
    if (entries.size() > kRemembered) entries.pop_back();
  });
  return value;
}

void apply_polynomial(const RowSets& sets, double spectrum_bound, const VectorXd& coefficient,
                      ReplicaFields& fields) {
  const StepView view = view_of(sets);
  const auto scale = static_cast<float>(2.0 / spectrum_bound);
  const Index degree = coefficient.size() - 1;
  const Index num_sets = sets.num_sets();
  const Index row_bytes = 3 * kReplicaLanes * static_cast<Index>(sizeof(float));
  const Index depth = std::max<Index>(
      1,
      std::min<Index>(degree, kCacheBytes / std::max<Index>(1, sets.largest_set * row_bytes) - 2));
  // Terms k0 .. k1 in one sweep: at time t, term k0 + i runs on set t - i.
  for (Index k0 = 1; k0 <= degree; k0 += depth) {
    const Index count = std::min(depth, degree - k0 + 1);
    for (Index t = 0; t < num_sets + count - 1; ++t) {
      for (Index i = std::max<Index>(0, t - num_sets + 1); i < std::min(count, t + 1); ++i) {
        const Index k = k0 + i;
        const auto d = static_cast<size_t>(t - i);
        const bool is_first = k == 1;
        const auto c = [&](Index j) { return static_cast<float>(coefficient[j]); };
        const TermFactors factors =
            is_first ? TermFactors{scale, 1.0F, -scale, 0.0F, c(0), c(1), true}
                     : TermFactors{2.0F * scale, 2.0F, -2.0F * scale, 1.0F, 0.0F, c(k), false};
        // Term k overwrites term k - 2, which nothing else needs any more.
        float* even = fields.even.data();
        float* odd = fields.odd.data();
        const float* x = is_first ? fields.level.data() : (k % 2 == 0 ? odd : even);
        const float* previous = k == 2 ? fields.level.data() : (k % 2 == 0 ? even : odd);
        DUPIN_CALL(term, view, factors, sets.set_start[d], sets.set_start[d + 1], vectors(x),
                   vectors(previous), vectors(k % 2 == 0 ? even : odd),
                   vectors(fields.next.data()));
      }
    }
  }
  if (degree == 0) {
    for (size_t i = 0; i < fields.level.size(); ++i)
      fields.next[i] = static_cast<float>(coefficient[0]) * fields.level[i];
  }
}

void sum_of_squares(const float* rows, Index num_rows, float* sum) {
  DUPIN_CALL(squares, vectors(rows), num_rows, sum);
}

void find_peaks(const RowSets& sets, const float* rows, const float* floor,
                std::vector<ReplicaPeak>& peaks) {
  DUPIN_CALL(peaks, view_of(sets), vectors(rows), floor, sets.num_rows, peaks);
}

}  // namespace dupin::detail
