#include "dupin/scalespace/filter_bank.h"

#include <cmath>
#include <list>
#include <string>
#include <utility>

#include "dupin/base/error.h"
#include "dupin/base/guarded.h"
#include "dupin/math/chebyshev.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t kRemembered = 16;
constexpr Index kMaxNodes = 1 << 14;

bool same(const FilterBankKey& a, const FilterBankKey& b) {
  return a.schedule.num_levels == b.schedule.num_levels &&
         a.schedule.lambda0 == b.schedule.lambda0 && a.schedule.delta == b.schedule.delta &&
         a.filter == b.filter && a.spectrum_bound == b.spectrum_bound && a.tolerance == b.tolerance;
}

// (f_{l+1}(s) - f_l(s)) / lambda_l without subtracting nearly equal numbers.
double laplacian_response(const VectorXd& f, const VectorXd& steps, Filter filter, Index l,
                          double s) {
  switch (filter) {
    case Filter::implicit:
      return -s * f[l + 1];
    case Filter::forward:
      return -s * f[l];
    case Filter::heat:
      break;
  }
  return f[l] * std::expm1(-steps[l] * s) / steps[l];
}

void check(const FilterBankKey& key) {
  validate(key.schedule);
  if (!std::isfinite(key.spectrum_bound) || key.spectrum_bound <= 0.0) {
    throw InvalidArgument("spectrum_bound is " + std::to_string(key.spectrum_bound) +
                          ", must be > 0");
  }
  if (!std::isfinite(key.tolerance) || key.tolerance < 1e-14 || key.tolerance > 0.1) {
    throw InvalidArgument("tolerance is " + std::to_string(key.tolerance) +
                          ", legal range 1e-14 to 0.1");
  }
  if (key.filter == Filter::forward) {
    const VectorXd steps = time_steps(key.schedule);
    if (steps.maxCoeff() * key.spectrum_bound > 2.0) {
      throw InvalidArgument("the forward filter is unstable: largest time step " +
                                std::to_string(steps.maxCoeff()) + " times the spectrum's bound " +
                                std::to_string(key.spectrum_bound) + " exceeds 2",
                            "the implicit filter has no limit");
    }
  }
}

VectorXd tail_sums(const Eigen::MatrixXd& coefficients, const Eigen::VectorXi& length) {
  VectorXd sums(coefficients.cols());
  for (Index l = 0; l < coefficients.cols(); ++l) {
    sums[l] = coefficients.col(l).tail(coefficients.rows() - length[l]).cwiseAbs().sum();
  }
  return sums;
}

void zero_tails(Eigen::MatrixXd& coefficients, const Eigen::VectorXi& length) {
  for (Index l = 0; l < coefficients.cols(); ++l)
    coefficients.col(l).tail(coefficients.rows() - length[l]).setZero();
  coefficients.conservativeResize(length.maxCoeff(), Eigen::NoChange);
}

FilterBank compute(const FilterBankKey& key, const RunControl& run) {
  const Index num_levels = key.schedule.num_levels;
  const VectorXd steps = time_steps(key.schedule);
  const VectorXd tau = level_scales(key.schedule, ScaleMeasure::exact);
  const auto functions = [&](double s) {
    VectorXd values(2 * num_levels - 1);
    values.head(num_levels) = transfer_functions(key.schedule, key.filter, s);
    for (Index l = 0; l + 1 < num_levels; ++l) {
      values[num_levels + l] = laplacian_response(values, steps, key.filter, l, s);
    }
    return values;
  };
  const Eigen::MatrixXd all = chebyshev_coefficients(functions, key.spectrum_bound, kMaxNodes, run);

  FilterBank bank;
  if (all.size() == 0) return bank;
  bank.levels = all.leftCols(num_levels);
  bank.loc = all.rightCols(num_levels - 1);
  bank.level_length =
      truncation_lengths(bank.levels, VectorXd::Constant(num_levels, key.tolerance));
  const VectorXd normaliser = tau.tail(num_levels - 1);
  bank.loc_length = truncation_lengths(bank.loc, key.tolerance * normaliser.cwiseInverse());
  bank.level_error = tail_sums(bank.levels, bank.level_length);
  bank.loc_error = tail_sums(bank.loc, bank.loc_length).cwiseProduct(normaliser);
  zero_tails(bank.levels, bank.level_length);
  zero_tails(bank.loc, bank.loc_length);
  return bank;
}

}  // namespace

VectorXd transfer_functions(const LevelSchedule& schedule, Filter filter, double s) {
  const VectorXd steps = time_steps(schedule);
  VectorXd values(schedule.num_levels);
  values[0] = 1.0;
  for (Index l = 0; l < steps.size(); ++l) {
    double factor = 0.0;
    if (filter == Filter::implicit) factor = 1.0 / (1.0 + steps[l] * s);
    if (filter == Filter::heat) factor = std::exp(-steps[l] * s);
    if (filter == Filter::forward) factor = 1.0 - steps[l] * s;
    values[l + 1] = values[l] * factor;
  }
  return values;
}

std::shared_ptr<const FilterBank> filter_bank(const FilterBankKey& key, const RunControl& run) {
  using Entry = std::pair<FilterBankKey, std::shared_ptr<const FilterBank>>;
  static Guarded<std::list<Entry>> memory;
  check(key);
  const auto remembered =
      memory.with([&](std::list<Entry>& entries) -> std::shared_ptr<const FilterBank> {
        for (const Entry& entry : entries) {
          if (same(entry.first, key)) return entry.second;
        }
        return nullptr;
      });
  if (remembered) return remembered;
  auto bank = std::make_shared<const FilterBank>(compute(key, run));
  if (run.cancelled()) return nullptr;
  memory.with([&](std::list<Entry>& entries) {
    entries.emplace_front(key, bank);
    if (entries.size() > kRemembered) entries.pop_back();
  });
  return bank;
}

}  // namespace dupin
