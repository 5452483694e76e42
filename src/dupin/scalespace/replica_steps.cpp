#include "dupin/scalespace/replica_steps.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <list>
#include <utility>

#include "dupin/base/guarded.h"
#include "dupin/math/chebyshev.h"

#if defined(__x86_64__) && defined(__GNUC__)
#define DUPIN_X86 1
#endif

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

constexpr Index kNodes = 640;
constexpr Index kLongestFit = 150;
constexpr double kRounding = 6e-8;

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

// One of the norms: spectral density s^power of the signal.
struct Measure {
  int power;
  VectorXd density;   // times the width of the node
  VectorXd rounding;  // squared, of what has been computed so far
};

struct Fit {
  VectorXd coefficient;
  double error = 0.0;
};

// Relative errors of p g against f in all measures, for the level and for its Laplacian.
double worst_error(const std::vector<Measure>& measures, const VectorXd& p, const VectorXd& g,
                   const VectorXd& f, const VectorXd& before) {
  double worst = 0.0;
  for (const Measure& m : measures) {
    const VectorXd rounding = p.cwiseAbs2().cwiseProduct(m.rounding);
    const VectorXd level = p.cwiseProduct(g) - f;
    const VectorXd loc = level - (g - before);  // times lambda
    const double of_level =
        (level.cwiseAbs2().dot(m.density) + rounding.sum()) / f.cwiseAbs2().dot(m.density);
    const double of_loc =
        (loc.cwiseAbs2().dot(m.density) + rounding.sum()) / (f - before).cwiseAbs2().dot(m.density);
    worst = std::max({worst, of_level, of_loc});
  }
  return std::sqrt(worst);
}

Fit fit_step(const Nodes& nodes, const std::vector<Measure>& measures, const VectorXd& g,
             const VectorXd& f, const VectorXd& before, Index first_degree, double error) {
  // All norms at once: per node the weighted mean of the squares.
  VectorXd a = VectorXd::Zero(kNodes);
  VectorXd b = VectorXd::Zero(kNodes);
  for (const Measure& m : measures) {
    // p g is to be f for the level and g + (f - before) for the difference.
    const double of_level = 1.0 / f.cwiseAbs2().dot(m.density);
    const double of_loc = 1.0 / (f - before).cwiseAbs2().dot(m.density);
    a += (of_level + of_loc) * (m.density.cwiseProduct(g.cwiseAbs2()) + m.rounding);
    b += m.density.cwiseProduct(g).cwiseProduct(of_level * f + of_loc * (g + f - before));
  }
  const VectorXd row = a.cwiseSqrt();
  const VectorXd target = b.cwiseQuotient(row.cwiseMax(1e-150));
  // p(0) = 1 exactly, since diffusion keeps the mean: p = 1 + sum c_k (T_k - 1).
  Fit fit;
  for (Index degree = first_degree; degree <= kLongestFit;
       degree += std::max<Index>(1, degree / 16)) {
    const MatrixXd basis = (nodes.chebyshev.middleCols(1, degree).array() - 1.0).matrix();
    const MatrixXd A = row.asDiagonal() * basis;
    const VectorXd c = A.householderQr().solve(target - row);
    const VectorXd p = VectorXd::Ones(kNodes) + basis * c;
    fit.coefficient.resize(degree + 1);
    fit.coefficient << 1.0 - c.sum(), c;
    fit.error = worst_error(measures, p, g, f, before);
    if (fit.error <= error) break;
  }
  return fit;
}

// Steps too long for a fit: the series of f_{l+1} / f_l itself.
VectorXd series_of_step(double lambda, Filter filter, double s_max) {
  const auto ratio = [&](double s) {
    VectorXd value(1);
    if (filter == Filter::implicit) value[0] = 1.0 / (1.0 + lambda * s);
    if (filter == Filter::heat) value[0] = std::exp(-lambda * s);
    if (filter == Filter::forward) value[0] = 1.0 - lambda * s;
    return value;
  };
  const MatrixXd series = chebyshev_coefficients(ratio, s_max);
  const int length = truncation_lengths(series, VectorXd::Constant(1, 1e-6))[0];
  return series.col(0).head(length);
}

double value_of(const VectorXd& coefficient, double s, double s_max) {
  return evaluate_chebyshev(coefficient, 0, coefficient.size(), s, s_max);
}

StepPolynomials compute(const LevelSchedule& schedule, Filter filter, double s_max, double error) {
  const Nodes nodes = make_nodes(s_max);
  const VectorXd steps = time_steps(schedule);
  MatrixXd exact(kNodes, schedule.num_levels);
  for (Index i = 0; i < kNodes; ++i)
    exact.row(i) = transfer_functions(schedule, filter, nodes.s[i]).transpose();
  std::vector<Measure> measures;
  for (const int power : {0, 2}) {
    measures.push_back({power,
                        nodes.width.cwiseProduct(VectorXd(nodes.s.array().pow(power).matrix())),
                        VectorXd::Zero(kNodes)});
  }
  StepPolynomials result;
  VectorXd g = exact.col(0);
  Index degree = 1;
  for (Index l = 0; l < steps.size(); ++l) {
    const VectorXd f = exact.col(l + 1);
    Fit fit = fit_step(nodes, measures, g, f, exact.col(l), degree, error);
    if (!(fit.error <= error)) {
      fit.coefficient = series_of_step(steps[l], filter, s_max);
      fit.error = error;
    } else {
      degree = std::max<Index>(1, fit.coefficient.size() - 3);
    }
    VectorXd p(kNodes);
    for (Index i = 0; i < kNodes; ++i) p[i] = value_of(fit.coefficient, nodes.s[i], s_max);
    g = g.cwiseProduct(p);
    for (Measure& m : measures) {
      const double norm = f.cwiseAbs2().dot(m.density);
      const double terms = static_cast<double>(fit.coefficient.size());
      m.rounding = m.rounding.cwiseProduct(p.cwiseAbs2()) +
                   kRounding * kRounding * terms * norm * nodes.width;
    }
    result.largest_error = std::max(result.largest_error, fit.error);
    result.coefficient.push_back(std::move(fit.coefficient));
  }
  return result;
}

// ---- kernels -------------------------------------------------------------------------------

#define DUPIN_INLINE inline __attribute__((always_inline))

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

DUPIN_INLINE void difference_body(const Vector* next, const Vector* level, float inverse,
                                  Index first, Index last, Vector* loc) {
  for (Index r = first; r < last; ++r) loc[r] = (next[r] - level[r]) * inverse;
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
  attribute void difference_##suffix(const Vector* next, const Vector* level, float inverse,      \
                                     Index first, Index last, Vector* loc) {                      \
    difference_body(next, level, inverse, first, last, loc);                                      \
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
DUPIN_VARIANT(avx2, __attribute__((target("avx2"))))
DUPIN_VARIANT(avx512, __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw"))))

int instruction_set() {
  static const int level = [] {
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw")) {
      return 2;
    }
    return __builtin_cpu_supports("avx2") ? 1 : 0;
  }();
  return level;
}
#define DUPIN_CALL(name, ...)                            \
  (instruction_set() == 2   ? name##_avx512(__VA_ARGS__) \
   : instruction_set() == 1 ? name##_avx2(__VA_ARGS__)   \
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

std::shared_ptr<const StepPolynomials> step_polynomials(const LevelSchedule& schedule,
                                                        Filter filter, double spectrum_bound,
                                                        double error) {
  struct Entry {
    LevelSchedule schedule;
    Filter filter;
    double bound;
    double error;
    std::shared_ptr<const StepPolynomials> value;
  };
  static Guarded<std::list<Entry>> memory;
  constexpr size_t kRemembered = 8;
  const auto remembered =
      memory.with([&](std::list<Entry>& entries) -> std::shared_ptr<const StepPolynomials> {
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
      std::make_shared<const StepPolynomials>(compute(schedule, filter, spectrum_bound, error));
  memory.with([&](std::list<Entry>& entries) {
    entries.push_front({schedule, filter, spectrum_bound, error, value});
    if (entries.size() > kRemembered) entries.pop_back();
  });
  return value;
}

void take_step(const RowSets& sets, double spectrum_bound, const VectorXd& coefficient,
               double lambda, ReplicaFields& fields) {
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
  DUPIN_CALL(difference, vectors(std::as_const(fields.next).data()),
             vectors(std::as_const(fields.level).data()), static_cast<float>(1.0 / lambda), 0,
             sets.num_rows, vectors(fields.even.data()));
  fields.loc = fields.even.data();
  fields.level.swap(fields.next);
}

void sum_of_squares(const float* rows, Index num_rows, float* sum) {
  DUPIN_CALL(squares, vectors(rows), num_rows, sum);
}

void find_peaks(const RowSets& sets, const float* rows, const float* floor,
                std::vector<ReplicaPeak>& peaks) {
  DUPIN_CALL(peaks, view_of(sets), vectors(rows), floor, sets.num_rows, peaks);
}

}  // namespace dupin::detail
