#include "dupin/scalespace/stack_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/scalespace/replica_steps.h"

namespace dupin {
namespace {

using detail::kReplicaLanes;
using detail::ReplicaFields;
using detail::RowSets;
using Eigen::Index;
using Eigen::VectorXd;
using std::size_t;

// Relative error of a step; it enters the standard deviation by its square.
constexpr double kStepError = 0.06;
// Where the coarsest levels hold few modes, their spectrum is no continuum, in whose norms the
// error is small: such surfaces are small, and closer fits cheap.
constexpr double kSmallStepError = 0.01;
constexpr double kFewModes = 20.0;  // vertices for a unit of tau
// Blocks of replicas in memory at once. Fixed, so that sums do not depend on the threads.
constexpr Index kWave = 4;
constexpr Index kGrain = 8192;
// Local factors of F and of LoC, side by side in a row: one for every fourth or fifth level.
constexpr Index kBands = 8;
constexpr double kLeastPooling = 4.0;  // squared mean edges
constexpr int kPoolingLevels = 9;      // up to 1435 squared mean edges
constexpr double kPoolingError = 0.4;
constexpr float kCertain = 3.0F;        // standard errors of a logarithm of a variance
constexpr float kLeastFactor = 1e-12F;  // of the mean variance of a level

using Floats = ReplicaFields::Buffer;

/// An extremum of the noise, until the standard deviations are known.
struct Candidate {
  std::int32_t row;
  std::int32_t stop;  // row of the variances
  float value;
};

struct Worker {
  ReplicaFields fields;
  Floats level_squares;  // #V, of the current level
  Floats loc_squares;
  std::vector<detail::ReplicaPeak> peaks;
};

void check(const DiffusionOperator& op, const StackNoiseOptions& options) {
  validate(options.schedule);
  if (options.num_replicas < 8 || options.num_replicas > 4096) {
    throw InvalidArgument("replicas is " + std::to_string(options.num_replicas) +
                          ", legal range 8 to 4096");
  }
  if (!std::isfinite(options.pooling) || options.pooling < 0.0) {
    throw InvalidArgument("pooling is " + std::to_string(options.pooling) + ", must be >= 0");
  }
  const int last = options.schedule.num_levels - 2;
  if (options.first_searched < 0 || options.last_searched < 0 || options.last_searched > last ||
      (options.last_searched > 0 && options.first_searched > options.last_searched)) {
    throw InvalidArgument("levels searched are " + std::to_string(options.first_searched) + " to " +
                          std::to_string(options.last_searched) + ", legal range 0 to " +
                          std::to_string(last));
  }
  if (!options.is_excluded.empty() &&
      options.is_excluded.size() != static_cast<size_t>(op.num_vertices)) {
    throw InvalidArgument("is_excluded has " + std::to_string(options.is_excluded.size()) +
                          " entries, the operator has " + std::to_string(op.num_vertices) +
                          " vertices");
  }
}

class Estimator {
 public:
  Estimator(const DiffusionOperator& op, const SignalNoise& signal,
            const StackNoiseOptions& options, const RunControl& run)
      : op_(op),
        signal_(signal),
        options_(options),
        run_(run),
        num_levels_(options.schedule.num_levels),
        num_blocks_((options.num_replicas + kReplicaLanes - 1) / kReplicaLanes),
        sets_(detail::make_row_sets(op)),
        tau_(level_scales(options.schedule, ScaleMeasure::exact)),
        plan_(detail::replica_plan(
            options.schedule, options.filter, op.spectrum_bound,
            static_cast<double>(op.num_vertices) < kFewModes * tau_[num_levels_ - 1]
                ? kSmallStepError
                : kStepError)),
        candidates_(static_cast<size_t>(num_blocks_ * kReplicaLanes)) {
    if (options.want_levels) levels_.at.push_back(0);
    for (const detail::ReplicaStop& stop : plan_->stops) {
      if (stop.loc_level >= 0) loc_.at.push_back(stop.loc_level);
      if (options.want_levels && stop.level > 0) levels_.at.push_back(stop.level);
    }
    loc_.resize(op.num_vertices);
    levels_.resize(op.num_vertices);
    last_searched_ = options.last_searched > 0 ? options.last_searched : num_levels_ - 2;
    if (options.want_samples) prepare_samples();
  }

  StackNoise estimate() {
    StackNoise result;
    for (Index wave = 0; wave < num_blocks_; wave += kWave) {
      if (!run_wave(wave, std::min(num_blocks_, wave + kWave))) {
        result.status = Status::cancelled;
        return result;
      }
    }
    const auto count = static_cast<float>(num_blocks_ * kReplicaLanes);
    loc_.variance /= count;
    levels_.variance /= count;
    pool();
    result.maxima = maxima();
    result.samples = finished_samples();
    result.loc_sd = to_vertices(loc_, num_levels_ - 1, 1);
    if (options_.want_levels) {
      result.level_sd = to_vertices(levels_, num_levels_, 0);
      add_bias(result.level_sd);
    }
    run_.report(1.0);
    return result;
  }

 private:
  // Variances at the stops of the walk, in the order of sets_.
  struct Rows {
    std::vector<Index> at;  // levels
    LevelMatrixF variance;  // sums, then means over the replicas, then pooled

    void resize(Index num_rows) { variance.setZero(static_cast<Index>(at.size()), num_rows); }
  };

  // Stops around the levels searched and their neighbours; the first is level 0, the last L - 2.
  void prepare_samples() {
    const std::vector<Index>& at = loc_.at;
    const Index before = std::max(0, options_.first_searched - 1);
    const Index after = std::min(num_levels_ - 2, last_searched_ + 1);
    const auto first = std::upper_bound(at.begin(), at.end(), before) - 1;
    const auto last = std::lower_bound(at.begin(), at.end(), after);
    first_sample_ = static_cast<Index>(first - at.begin());
    samples_.level.assign(first, last + 1);
    samples_.loc.resize(samples_.level.size());
  }

  void keep_sample(const Worker& worker, Index loc_row) {
    const Index k = loc_row - first_sample_;
    if (k < 0 || k >= static_cast<Index>(samples_.loc.size())) return;
    LevelMatrixF& replicas = samples_.loc[static_cast<size_t>(k)];
    replicas.resize(kReplicaLanes, sets_.num_rows);
    parallel_for(0, sets_.num_rows, kGrain, [&](Index first, Index last) {
      const float* from = worker.fields.next.data() + first * kReplicaLanes;
      for (Index r = first; r < last; ++r, from += kReplicaLanes) {
        float* to = replicas.data() + sets_.vertex[static_cast<size_t>(r)];
        for (Index lane = 0; lane < kReplicaLanes; ++lane) to[lane * sets_.num_rows] = from[lane];
      }
    });
  }

  NoiseSamples finished_samples() {
    const auto count = static_cast<Index>(samples_.level.size());
    samples_.unit = signal_.unit;
    samples_.deviation = VectorXd::Zero(count);
    samples_.correlation = VectorXd::Zero(std::max<Index>(0, count - 1));
    const auto product = [&](Index a, Index b) {
      const float* x = samples_.loc[static_cast<size_t>(a)].data();
      const float* y = samples_.loc[static_cast<size_t>(b)].data();
      double sum = 0.0;
      for (Index i = 0; i < op_.num_vertices * kReplicaLanes; ++i)
        sum += static_cast<double>(x[i]) * static_cast<double>(y[i]);
      return sum / static_cast<double>(std::max<Index>(1, op_.num_vertices * kReplicaLanes));
    };
    parallel_for(0, count, 1, [&](Index first, Index last) {
      for (Index k = first; k < last; ++k) samples_.deviation[k] = std::sqrt(product(k, k));
    });
    parallel_for(0, samples_.correlation.size(), 1, [&](Index first, Index last) {
      for (Index k = first; k < last; ++k) {
        const double both = samples_.deviation[k] * samples_.deviation[k + 1];
        samples_.correlation[k] = both > 0.0 ? std::clamp(product(k, k + 1) / both, 0.0, 1.0) : 1.0;
      }
    });
    return std::move(samples_);
  }

  void load(Worker& worker, Index block) const {
    const ReplicaBlock drawn = signal_.draw(block);
    if (drawn.rows() != op_.num_vertices) {
      throw InvalidArgument("the signal noise has " + std::to_string(drawn.rows()) +
                            " values, the operator has " + std::to_string(op_.num_vertices) +
                            " vertices");
    }
    const auto size = static_cast<size_t>(sets_.num_rows * kReplicaLanes);
    for (Floats* buffer :
         {&worker.fields.level, &worker.fields.next, &worker.fields.even, &worker.fields.odd}) {
      buffer->resize(size);
    }
    for (Index r = 0; r < sets_.num_rows; ++r) {
      const float* from = drawn.data() + sets_.vertex[static_cast<size_t>(r)] * kReplicaLanes;
      std::copy(from, from + kReplicaLanes, worker.fields.level.data() + r * kReplicaLanes);
    }
    worker.loc_squares.resize(static_cast<size_t>(sets_.num_rows));
    if (options_.want_levels) worker.level_squares.resize(static_cast<size_t>(sets_.num_rows));
  }

  // Adds the squares of all blocks, in their order, to one row of variances.
  static void add_squares(const std::vector<Worker>& workers, Floats Worker::*squares,
                          LevelMatrixF& variance, Index level) {
    float* row = variance.data() + level * variance.cols();
    parallel_for(0, variance.cols(), kGrain, [&](Index first, Index last) {
      for (const Worker& worker : workers) {
        const float* from = (worker.*squares).data();
        for (Index r = first; r < last; ++r) row[r] += from[r];
      }
    });
  }

  bool run_wave(Index first_block, Index last_block) {
    const Index count = last_block - first_block;
    std::vector<Worker> workers(static_cast<size_t>(count));
    const auto for_workers = [&](auto&& action) {
      parallel_for(0, count, 1, [&](Index first, Index last) {
        for (Index w = first; w < last; ++w) action(workers[static_cast<size_t>(w)], w);
      });
    };
    const auto square_levels = [&](Worker& worker) {
      if (!options_.want_levels) return;
      detail::sum_of_squares(worker.fields.level.data(), sets_.num_rows,
                             worker.level_squares.data());
    };
    for_workers([&](Worker& worker, Index w) {
      load(worker, first_block + w);
      square_levels(worker);
    });
    Index level_row = 0;
    Index loc_row = 0;
    if (options_.want_levels)
      add_squares(workers, &Worker::level_squares, levels_.variance, level_row++);
    Floats floor;
    Index products = 0;
    for (const detail::ReplicaStop& stop : plan_->stops) {
      if (run_.cancelled()) return false;
      const Index l = stop.loc_level;
      for_workers([&](Worker& worker, Index) {
        if (stop.level > 0) {
          detail::apply_polynomial(sets_, op_.spectrum_bound, stop.step, worker.fields);
          worker.fields.level.swap(worker.fields.next);
          square_levels(worker);
        }
        if (l < 0) return;
        detail::apply_polynomial(sets_, op_.spectrum_bound, stop.loc, worker.fields);
        detail::sum_of_squares(worker.fields.next.data(), sets_.num_rows,
                               worker.loc_squares.data());
      });
      if (options_.want_levels && stop.level > 0)
        add_squares(workers, &Worker::level_squares, levels_.variance, level_row++);
      if (l >= 0) {
        if (first_block == 0) keep_sample(workers.front(), loc_row);
        add_squares(workers, &Worker::loc_squares, loc_.variance, loc_row);
        if (l >= options_.first_searched && l <= last_searched_) {
          set_floor(loc_row, last_block, floor);
          for_workers(
              [&](Worker& worker, Index w) { collect(worker, first_block + w, loc_row, floor); });
        }
        ++loc_row;
      }
      products += stop.step.size() + stop.loc.size();
      run_.report(0.9 *
                  (static_cast<double>(first_block) +
                   static_cast<double>(count) *
                       std::min(1.0, static_cast<double>(products) /
                                         (2.0 * static_cast<double>(plan_->num_products)))) /
                  static_cast<double>(num_blocks_));
    }
    return true;
  }

  // Squares that an extremum must exceed to be remembered. Over thousands of independent places
  // (tau rows each) the largest of a replica is beyond three standard deviations; where there are
  // fewer all extrema count.
  void set_floor(Index row, Index num_blocks, Floats& floor) const {
    const auto replicas = static_cast<float>(num_blocks * kReplicaLanes);
    const double tau = tau_[loc_.at[static_cast<size_t>(row)] + 1];
    const float least = static_cast<double>(sets_.num_rows) < 4000.0 * tau ? 0.0F : 3.0F * 3.0F;
    floor.resize(static_cast<size_t>(sets_.num_rows));
    const float* sum = loc_.variance.data() + row * loc_.variance.cols();
    parallel_for(0, sets_.num_rows, kGrain, [&](Index first, Index last) {
      for (Index r = first; r < last; ++r) {
        const auto i = static_cast<size_t>(r);
        const auto v = static_cast<size_t>(sets_.vertex[i]);
        const bool is_out = sets_.offset[i + 1] - sets_.offset[i] < 3 ||
                            (!options_.is_excluded.empty() && options_.is_excluded[v] != 0);
        floor[i] = is_out ? std::numeric_limits<float>::infinity() : least * sum[r] / replicas;
      }
    });
  }

  void collect(Worker& worker, Index block, Index row, const Floats& floor) {
    worker.peaks.clear();
    detail::find_peaks(sets_, worker.fields.next.data(), floor.data(), worker.peaks);
    for (const detail::ReplicaPeak& peak : worker.peaks) {
      candidates_[static_cast<size_t>(block * kReplicaLanes + peak.lane)].push_back(
          {peak.row, static_cast<std::int32_t>(row), peak.value});
    }
  }

  // Variances that are pooled together, eight bands of levels each.
  struct Pooled {
    Rows* rows;
    Index delay;    // steps that row 0 has been diffused for
    Index lane;     // of its first band
    VectorXd mean;  // of every row
  };

  static Index num_bands(const Pooled& p) { return std::min(kBands, p.rows->variance.rows()); }

  // Row of the variances, possibly between two, that band b stands for.
  static double centre(const Pooled& p, Index b) {
    return num_bands(p) == 1
               ? 0.0
               : static_cast<double>(b) * static_cast<double>(p.rows->variance.rows() - 1) /
                     static_cast<double>(num_bands(p) - 1);
  }

  // Hat functions over the rows that add up to one.
  static double share(const Pooled& p, Index b, Index row) {
    const double spacing = num_bands(p) > 1 ? centre(p, 1) : 1.0;
    return std::max(0.0, 1.0 - std::abs(static_cast<double>(row) - centre(p, b)) / spacing);
  }

  // Replaces a variance of R replicas by (mean of the level) x (local factor). The logarithm of the
  // factor is averaged over a few levels, over the surface by diffusion, and interpolated between
  // the levels: the large variances at a boundary would swamp an average of the factor itself.
  void pool() {
    if (options_.pooling == 0.0 || op_.num_vertices == 0) return;
    std::vector<Pooled> fields{{&loc_, 1, 0, level_means(loc_.variance)}};
    if (options_.want_levels)
      fields.push_back({&levels_, 0, kBands, level_means(levels_.variance)});
    Floats factor(static_cast<size_t>(sets_.num_rows * kReplicaLanes), 0.0F);
    VectorXd duration = VectorXd::Zero(kReplicaLanes);
    for (const Pooled& p : fields) gather_factors(p, factor, duration);
    smooth(factor, duration);
    for (const Pooled& p : fields) apply_factors(p, factor);
  }

  void gather_factors(const Pooled& p, Floats& factor, VectorXd& duration) const {
    for (Index b = 0; b < num_bands(p); ++b) {
      const Index level = p.rows->at[static_cast<size_t>(std::lround(centre(p, b)))] + p.delay;
      duration[p.lane + b] = std::max(kLeastPooling, options_.pooling * tau_[level]);
      double total = 0.0;
      for (Index l = 0; l < p.mean.size(); ++l) total += p.mean[l] > 0.0 ? share(p, b, l) : 0.0;
      for (Index l = 0; l < p.mean.size(); ++l) {
        if (!(share(p, b, l) > 0.0) || !(p.mean[l] > 0.0)) continue;
        const auto weight = static_cast<float>(share(p, b, l) / total);
        const auto inverse = static_cast<float>(1.0 / p.mean[l]);
        const float* row = p.rows->variance.data() + l * p.rows->variance.cols();
        parallel_for(0, sets_.num_rows, kGrain, [&](Index first, Index last) {
          for (Index r = first; r < last; ++r)
            factor[static_cast<size_t>(r * kReplicaLanes + p.lane + b)] +=
                weight * std::log(std::max(kLeastFactor, inverse * row[r]));
        });
      }
    }
  }

  // What a vertex differs from its surroundings, as far as chance does not explain it: nothing up
  // to `noise`, nearly all of it far beyond. Keeps the steep layers at boundaries.
  static float beyond(float difference, float noise) {
    const float square = difference * difference;
    return square > noise * noise ? difference * (1.0F - noise * noise / square) : 0.0F;
  }

  void apply_factors(const Pooled& p, const Floats& factor) const {
    // The mean logarithm of chi^2 / R with R degrees of freedom is -1 / R.
    const auto count = static_cast<float>(num_blocks_ * kReplicaLanes);
    const float bias = std::exp(1.0F / count);
    const float noise = kCertain * std::sqrt(2.0F / count);
    parallel_for(0, p.rows->variance.rows(), 1, [&](Index first, Index last) {
      for (Index l = first; l < last; ++l) {
        float* row = p.rows->variance.data() + l * p.rows->variance.cols();
        const double spacing = num_bands(p) > 1 ? centre(p, 1) : 1.0;
        const Index low = std::min(
            num_bands(p) - 1, static_cast<Index>(std::floor(static_cast<double>(l) / spacing)));
        const Index high = std::min(num_bands(p) - 1, low + 1);
        const auto part = static_cast<float>(high == low ? 0.0 : share(p, high, l));
        const auto level = static_cast<float>(p.mean[l]);
        for (Index r = 0; r < sets_.num_rows; ++r) {
          const float* c = factor.data() + r * kReplicaLanes + p.lane;
          if (!(row[r] > 0.0F)) continue;
          const float pooled = (1.0F - part) * c[low] + part * c[high];
          const float raw = std::log(std::max(kLeastFactor, row[r] / level));
          row[r] = level * bias * std::exp(pooled + beyond(raw - pooled, noise));
        }
      }
    });
  }

  // Mean of every level in the inner product of the operator, which diffusion preserves.
  VectorXd level_means(const LevelMatrixF& variance) const {
    VectorXd mass(sets_.num_rows);
    for (Index r = 0; r < sets_.num_rows; ++r)
      mass[r] = op_.mass[sets_.vertex[static_cast<size_t>(r)]];
    mass /= mass.sum();
    VectorXd mean(variance.rows());
    parallel_for(0, variance.rows(), 1, [&](Index first, Index last) {
      for (Index l = first; l < last; ++l) mean[l] = variance.row(l).cast<double>().dot(mass);
    });
    return mean;
  }

  // Diffuses every lane of `factor` for about its duration, in steps of a coarse schedule. How
  // wide an average is need not be exact: large errors of the steps are allowed.
  void smooth(Floats& factor, const VectorXd& duration) const {
    const LevelSchedule schedule{kPoolingLevels, kLeastPooling, 1.9};
    const auto plan =
        detail::replica_plan(schedule, Filter::implicit, op_.spectrum_bound, kPoolingError);
    const VectorXd tau = level_scales(schedule, ScaleMeasure::exact);
    ReplicaFields fields;
    fields.level = factor;
    for (Floats* buffer : {&fields.next, &fields.even, &fields.odd}) buffer->resize(factor.size());
    std::vector<std::uint8_t> is_done(static_cast<size_t>(kReplicaLanes), 0);
    for (size_t k = 0; k < plan->stops.size(); ++k) {
      const detail::ReplicaStop& stop = plan->stops[k];
      if (std::all_of(is_done.begin(), is_done.end(), [](std::uint8_t done) { return done != 0; }))
        break;
      detail::apply_polynomial(sets_, op_.spectrum_bound, stop.step, fields);
      fields.level.swap(fields.next);
      for (Index lane = 0; lane < kReplicaLanes; ++lane) {
        const bool is_last = k + 1 == plan->stops.size();
        if (is_done[static_cast<size_t>(lane)] != 0 ||
            (tau[stop.level] < 0.8 * duration[lane] && !is_last))
          continue;
        is_done[static_cast<size_t>(lane)] = 1;
        for (Index r = 0; r < sets_.num_rows; ++r) {
          const auto i = static_cast<size_t>(r * kReplicaLanes + lane);
          factor[i] = fields.level[i];
        }
      }
    }
  }

  VectorXd maxima() const {
    VectorXd largest = VectorXd::Zero(static_cast<Index>(candidates_.size()));
    for (size_t k = 0; k < candidates_.size(); ++k) {
      double& most = largest[static_cast<Index>(k)];
      for (const Candidate& c : candidates_[k]) {
        const auto sd = std::sqrt(static_cast<double>(loc_.variance(c.stop, c.row)));
        const double value = std::abs(static_cast<double>(c.value));
        if (sd > 0.0) most = std::max(most, value / sd);
      }
    }
    return largest;
  }

  void add_bias(LevelMatrixF& level_sd) const {
    if (signal_.bias.size() == 0) return;
    ScaleSpaceOptions options;
    options.schedule = options_.schedule;
    options.filter = options_.filter;
    options.want_loc = false;
    const LevelMatrixF bias = compute_scale_space_single(op_, signal_.bias, options).levels;
    level_sd = (level_sd.array().square() + bias.array().square()).sqrt();
  }

  // Standard deviations of all levels, in the order of the vertices. Between two stops the
  // logarithm of the variance is linear in that of the scale.
  LevelMatrixF to_vertices(const Rows& rows, Index num_levels, Index delay) const {
    LevelMatrixF result(num_levels, sets_.num_rows);
    const double unit = signal_.unit;
    parallel_for(0, num_levels, 1, [&](Index first, Index last) {
      for (Index l = first; l < last; ++l) {
        const auto above = std::lower_bound(rows.at.begin(), rows.at.end(), l);
        const Index high = std::min(static_cast<Index>(above - rows.at.begin()),
                                    static_cast<Index>(rows.at.size()) - 1);
        const float* to = rows.variance.data() + high * sets_.num_rows;
        float* out = result.data() + l * sets_.num_rows;
        const auto scaled = static_cast<float>(unit);
        if (*above == l) {
          for (Index r = 0; r < sets_.num_rows; ++r)
            out[sets_.vertex[static_cast<size_t>(r)]] = scaled * std::sqrt(to[r]);
          continue;
        }
        const float* from = to - sets_.num_rows;
        const auto place = [&](Index level) { return std::log(tau_[level + delay]); };
        const Index low = rows.at[static_cast<size_t>(high - 1)];
        const auto share =
            static_cast<float>(0.5 * (place(l) - place(low)) /
                               (place(rows.at[static_cast<size_t>(high)]) - place(low)));
        for (Index r = 0; r < sets_.num_rows; ++r) {
          out[sets_.vertex[static_cast<size_t>(r)]] =
              from[r] > 0.0F && to[r] > 0.0F
                  ? scaled * std::exp((0.5F - share) * std::log(from[r]) + share * std::log(to[r]))
                  : 0.0F;
        }
      }
    });
    return result;
  }

  const DiffusionOperator& op_;
  const SignalNoise& signal_;
  const StackNoiseOptions& options_;
  const RunControl& run_;
  Index num_levels_;
  Index num_blocks_;
  RowSets sets_;
  VectorXd tau_;
  std::shared_ptr<const detail::ReplicaPlan> plan_;
  Index last_searched_ = 0;
  Index first_sample_ = 0;  // row of loc_
  NoiseSamples samples_;
  Rows levels_;
  Rows loc_;
  std::vector<std::vector<Candidate>> candidates_;  // of every replica
};

}  // namespace

StackNoise estimate_stack_noise(const DiffusionOperator& op, const SignalNoise& signal,
                                const StackNoiseOptions& options, RunControl run) {
  check(op, options);
  return Estimator(op, signal, options, run).estimate();
}

void add_noise_sample(const NoiseSamples& samples, const LevelSchedule& schedule, Index index,
                      double share, const LevelMatrix& loc, LevelMatrix& replica) {
  if (samples.level.empty()) throw InvalidArgument("the noise of the stack has no samples");
  if (index < 0 || index >= kReplicaLanes) {
    throw InvalidArgument("replica is " + std::to_string(index) + ", legal range 0 to " +
                          std::to_string(kReplicaLanes - 1));
  }
  if (loc.rows() != schedule.num_levels - 1 || loc.cols() != samples.loc.front().cols() ||
      samples.level.back() >= loc.rows() || replica.rows() != loc.rows() ||
      replica.cols() != loc.cols()) {
    throw InvalidArgument("loc is " + std::to_string(loc.rows()) + " by " +
                          std::to_string(loc.cols()) + ", its replica " +
                          std::to_string(replica.rows()) + " by " + std::to_string(replica.cols()) +
                          ", the samples have " + std::to_string(samples.loc.front().cols()) +
                          " vertices");
  }
  const VectorXd tau = level_scales(schedule, ScaleMeasure::exact);
  const auto noise = [&](Index stop) {
    return samples.loc[static_cast<size_t>(stop)].row(index).cast<double>();
  };
  const double factor = share * samples.unit;
  parallel_for(samples.level.front(), samples.level.back() + 1, 1, [&](Index first, Index last) {
    for (Index l = first; l < last; ++l) {
      const auto above = std::lower_bound(samples.level.begin(), samples.level.end(), l);
      const auto high = static_cast<Index>(above - samples.level.begin());
      if (*above == l) {
        replica.row(l) = loc.row(l) + factor * noise(high);
        continue;
      }
      const Index low = high - 1;
      const double sd[2] = {samples.deviation[low], samples.deviation[high]};
      if (!(sd[0] > 0.0 && sd[1] > 0.0)) {
        replica.row(l) = loc.row(l);
        continue;
      }
      const auto place = [&](Index level) { return std::log(tau[level + 1]); };
      const double from = place(samples.level[static_cast<size_t>(low)]);
      const double part = (place(l) - from) / (place(*above) - from);
      const double rest = 1.0 - part;
      // A mean of two that are not quite the same varies less than either.
      const double mean =
          std::sqrt(rest * rest + part * part + 2.0 * rest * part * samples.correlation[low]);
      const double sd_here = factor * std::exp(rest * std::log(sd[0]) + part * std::log(sd[1]));
      replica.row(l) = loc.row(l) + (rest * sd_here / (mean * sd[0])) * noise(low) +
                       (part * sd_here / (mean * sd[1])) * noise(high);
    }
  });
}

}  // namespace dupin
