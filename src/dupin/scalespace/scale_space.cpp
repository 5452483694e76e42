#include "dupin/scalespace/scale_space.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/parallel.h"
#include "dupin/scalespace/kernels.h"

namespace dupin {
namespace {

using Eigen::Index;
using std::size_t;

// Terms of the recurrence that are kept before they are added to the levels. More of them means
// less traffic of the levels and more memory; 10 keep a stack of 35 levels under 450 bytes a
// vertex.
constexpr Index kBlock = 10;
constexpr Index kGroup = 4;         // levels added together, see accumulate_terms()
constexpr Index kStepGrain = 1024;  // slices
constexpr Index kTileGrain = 4096;  // rows
constexpr Index kTile = 256;        // rows of all terms of a block: 20 KiB in double, fits in L1
// Series cut below what rounding in single precision leaves cost products for nothing.
constexpr double kSingleTolerance = 1e-5;

template <class T>
using Buffer = std::vector<T, Eigen::aligned_allocator<T>>;

// The operator's arrays in precision T; those of double are used in place.
template <class T>
struct OperatorArrays {
  Buffer<T> weight;
  Buffer<T> off_diagonal;
  Buffer<T> diagonal;
  detail::SlicedView<T> view{};
};

template <class T>
void set_view(const DiffusionOperator& op, OperatorArrays<T>& arrays) {
  arrays.view.slice_start = op.slice_start.data();
  arrays.view.slice_width = op.slice_width.data();
  arrays.view.slice_base = op.slice_base.data();
  arrays.view.compact_index = op.compact_index.data();
  arrays.view.index = op.index.data();
  if constexpr (std::is_same_v<T, double>) {
    arrays.view.weight = op.weight.empty() ? nullptr : op.weight.data();
    arrays.view.off_diagonal = op.off_diagonal.data();
    arrays.view.diagonal = op.diagonal.empty() ? nullptr : op.diagonal.data();
  } else {
    const auto copy = [](const std::vector<double>& from, Buffer<T>& to) {
      to.assign(from.size(), T{0});
      std::transform(from.begin(), from.end(), to.begin(),
                     [](double x) { return static_cast<T>(x); });
      return to.empty() ? nullptr : to.data();
    };
    arrays.view.weight = copy(op.weight, arrays.weight);
    arrays.view.off_diagonal = copy(op.off_diagonal, arrays.off_diagonal);
    arrays.view.diagonal = copy(op.diagonal, arrays.diagonal);
  }
}

// One output row: where it goes and which series it is.
template <class T>
struct Output {
  T* row;
  Index length;
  const double* coefficients;  // column of the bank
};

// Outputs in groups of kGroup of similar length, with their coefficients interleaved for the
// kernel.
template <class T>
struct Group {
  T* rows[kGroup] = {};
  Index num_rows = 0;
  Index length = 0;
  Buffer<T> coefficients;  // term-major, kGroup entries a term
};

template <class T>
std::vector<Group<T>> make_groups(std::vector<Output<T>> outputs) {
  std::stable_sort(outputs.begin(), outputs.end(),
                   [](const Output<T>& a, const Output<T>& b) { return a.length < b.length; });
  std::vector<Group<T>> groups;
  for (size_t first = 0; first < outputs.size(); first += kGroup) {
    Group<T> group;
    group.num_rows = static_cast<Index>(std::min<size_t>(kGroup, outputs.size() - first));
    group.length = outputs[first + static_cast<size_t>(group.num_rows) - 1].length;
    group.coefficients.assign(static_cast<size_t>(group.length * kGroup), T{0});
    for (Index m = 0; m < group.num_rows; ++m) {
      const Output<T>& output = outputs[first + static_cast<size_t>(m)];
      group.rows[m] = output.row;
      for (Index k = 0; k < output.length; ++k) {
        group.coefficients[static_cast<size_t>(k * kGroup + m)] =
            static_cast<T>(output.coefficients[k]);
      }
    }
    groups.push_back(std::move(group));
  }
  return groups;
}

// Adds terms [k0, k0 + count) of the recurrence to all outputs, tile by tile so that the terms stay
// in the cache.
template <class T>
void add_block(const std::vector<Group<T>>& groups, const T* const* term, Index k0, Index count,
               Index num_rows) {
  parallel_for(0, num_rows, kTileGrain, [&](Index first, Index last) {
    for (Index tile = first; tile < last; tile += kTile) {
      for (const Group<T>& group : groups) {
        const Index terms = std::min(count, group.length - k0);
        if (terms <= 0) continue;
        detail::accumulate_terms(term, terms, group.coefficients.data() + k0 * kGroup, kGroup,
                                 group.rows, group.num_rows, tile, std::min(last, tile + kTile));
      }
    }
  });
}

// Runs T_0 .. T_{degree-1} and adds them to the groups. Returns false when cancelled.
template <class T>
bool run_recurrence(const DiffusionOperator& op, const Eigen::VectorXd& signal, Index degree,
                    const std::vector<Group<T>>& groups, const RunControl& run) {
  OperatorArrays<T> arrays;
  set_view(op, arrays);
  const Index padded = op.num_rows_padded();
  const Index stride =
      padded +
      DiffusionOperator::kLanes;  // the row after the last is the zero that padding points to
  Buffer<T> storage(static_cast<size_t>(stride * (kBlock + 2)), T{0});
  T* slot[kBlock + 2];
  for (Index i = 0; i < kBlock + 2; ++i) slot[i] = storage.data() + i * stride;

  const double s = op.spectrum_bound;
  const detail::StepFactors<T> first_step{static_cast<T>(2.0 / s), T{1}, static_cast<T>(-2.0 / s),
                                          T{0}};
  const detail::StepFactors<T> step{static_cast<T>(4.0 / s), T{2}, static_cast<T>(-4.0 / s), T{1}};

  // slot[0], slot[1] carry the last two terms of the block before; slot[2 ..] receive the block.
  for (Index k0 = 0; k0 < degree; k0 += kBlock) {
    if (run.cancelled()) return false;
    const Index count = std::min(kBlock, degree - k0);
    for (Index i = 0; i < count; ++i) {
      T* out = slot[2 + i];
      const Index k = k0 + i;
      if (k == 0) {
        for (Index r = 0; r < op.num_vertices; ++r)
          out[r] = static_cast<T>(signal[op.order[static_cast<size_t>(r)]]);
        continue;
      }
      const T* x = slot[1 + i];
      const T* previous = k == 1 ? x : slot[i];
      parallel_for(0, op.num_slices(), kStepGrain, [&](Index first, Index last) {
        detail::recurrence_step(arrays.view, k == 1 ? first_step : step, first, last, x, previous,
                                out);
      });
    }
    add_block(groups, static_cast<const T* const*>(slot + 2), k0, count, op.num_vertices);
    // The last two terms move to the front; their old slots are written next.
    std::swap(slot[0], slot[count]);
    std::swap(slot[1], slot[count + 1]);
    run.report(static_cast<double>(k0 + count) / static_cast<double>(degree));
  }
  return true;
}

// From row order back to vertex order, one level at a time.
template <class Matrix>
void restore_order(const DiffusionOperator& op, Matrix& levels) {
  using T = typename Matrix::Scalar;
  parallel_for(0, levels.rows(), 1, [&](Index first, Index last) {
    std::vector<T> row(static_cast<size_t>(levels.cols()));
    for (Index l = first; l < last; ++l) {
      T* data = levels.data() + l * levels.cols();
      std::copy(data, data + levels.cols(), row.begin());
      for (Index v = 0; v < levels.cols(); ++v)
        data[v] = row[static_cast<size_t>(op.row_of[static_cast<size_t>(v)])];
    }
  });
}

template <class Matrix>
BasicScaleSpace<Matrix> compute(const DiffusionOperator& op, const Eigen::VectorXd& signal,
                                const ScaleSpaceOptions& options, const RunControl& run) {
  using T = typename Matrix::Scalar;
  if (signal.size() != op.num_vertices) {
    throw InvalidArgument("signal has " + std::to_string(signal.size()) +
                          " values, the operator has " + std::to_string(op.num_vertices) +
                          " vertices");
  }
  for (Index v = 0; v < signal.size(); ++v) {
    if (!std::isfinite(signal[v]))
      throw InvalidArgument("signal: value " + std::to_string(v) + " is not finite");
  }
  const double tolerance =
      std::is_same_v<T, float> ? std::max(options.tolerance, kSingleTolerance) : options.tolerance;
  const auto bank =
      filter_bank({options.schedule, options.filter, op.spectrum_bound, tolerance}, run);
  BasicScaleSpace<Matrix> result;
  if (bank == nullptr) {
    result.status = Status::cancelled;
    return result;
  }
  result.lambda = time_steps(options.schedule);
  result.tau = level_scales(options.schedule, ScaleMeasure::exact);

  std::vector<Output<T>> outputs;
  const auto want = [&](Matrix& matrix, const Eigen::MatrixXd& series,
                        const Eigen::VectorXi& length, const Eigen::VectorXd& error) {
    matrix.setZero(series.cols(), op.num_vertices);
    for (Index l = 0; l < series.cols(); ++l) {
      outputs.push_back({matrix.data() + l * matrix.cols(), length[l], series.col(l).data()});
      result.degree = std::max<Index>(result.degree, length[l]);
    }
    result.error_bound = std::max(result.error_bound, error.maxCoeff());
  };
  if (options.want_levels) want(result.levels, bank->levels, bank->level_length, bank->level_error);
  if (options.want_loc) want(result.loc, bank->loc, bank->loc_length, bank->loc_error);

  if (op.num_vertices > 0 &&
      !run_recurrence(op, signal, result.degree, make_groups(std::move(outputs)), run)) {
    result.status = Status::cancelled;
    result.levels.resize(0, 0);
    result.loc.resize(0, 0);
    return result;
  }
  restore_order(op, result.levels);
  restore_order(op, result.loc);
  run.report(1.0);
  return result;
}

}  // namespace

ScaleSpace compute_scale_space(const DiffusionOperator& op, const Eigen::VectorXd& signal,
                               const ScaleSpaceOptions& options, RunControl run) {
  return compute<LevelMatrix>(op, signal, options, run);
}

ScaleSpaceF compute_scale_space_single(const DiffusionOperator& op, const Eigen::VectorXd& signal,
                                       const ScaleSpaceOptions& options, RunControl run) {
  return compute<LevelMatrixF>(op, signal, options, run);
}

LevelMatrix scale_invariant_loc(const LevelMatrix& loc, double signal_scale) {
  LevelMatrix result = LevelMatrix::Zero(loc.rows(), loc.cols());
  if (loc.cols() == 0) return result;
  const auto count = static_cast<double>(loc.cols());
  parallel_for(0, loc.rows(), 1, [&](Index first, Index last) {
    for (Index l = first; l < last; ++l) {
      const double mean = loc.row(l).sum() / count;
      const double deviation = std::sqrt((loc.row(l).array() - mean).square().sum() / count);
      if (deviation <= 1e-12 * signal_scale) continue;
      result.row(l) = (loc.row(l).array() - mean) / deviation;
    }
  });
  return result;
}

}  // namespace dupin
