#include "dupin/scalespace/pcg_reference.h"

#include <cmath>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct Solve {
  VectorXd x;
  double residual;
  Index products;
};

// (M + lambda M B) x = b from the start x0.
Solve conjugate_gradients(const DiffusionOperator& op, double lambda, const VectorXd& b,
                          const VectorXd& x0, double tolerance, Index max_iterations) {
  const auto apply = [&](const VectorXd& x) -> VectorXd {
    return op.mass.cwiseProduct(x + lambda * op.apply(x));
  };
  VectorXd diagonal(op.num_vertices);
  for (Index v = 0; v < op.num_vertices; ++v) {
    const auto row = static_cast<std::size_t>(op.row_of[static_cast<std::size_t>(v)]);
    diagonal[v] = op.mass[v] * (1.0 + lambda * (op.diagonal.empty() ? 1.0 : op.diagonal[row]));
  }
  Solve solve{x0, 0.0, 1};
  const double norm = b.norm();
  if (norm == 0.0) {
    solve.x.setZero();
    return solve;
  }
  VectorXd r = b - apply(x0);
  VectorXd z = r.cwiseQuotient(diagonal);
  VectorXd p = z;
  double rz = r.dot(z);
  for (Index i = 0; i < max_iterations && r.norm() > tolerance * norm && rz > 0.0; ++i) {
    const VectorXd q = apply(p);
    ++solve.products;
    const double alpha = rz / p.dot(q);
    solve.x += alpha * p;
    r -= alpha * q;
    z = r.cwiseQuotient(diagonal);
    const double next = r.dot(z);
    p = z + (next / rz) * p;
    rz = next;
  }
  // The recursive residual drifts from the true one: report the true one.
  solve.residual = (b - apply(solve.x)).norm() / norm;
  return solve;
}

}  // namespace

ReferenceScaleSpace reference_scale_space(const DiffusionOperator& op, const VectorXd& signal,
                                          const LevelSchedule& schedule, double tolerance,
                                          Index max_iterations, RunControl run) {
  if (signal.size() != op.num_vertices) {
    throw InvalidArgument("signal has " + std::to_string(signal.size()) +
                          " values, the operator has " + std::to_string(op.num_vertices) +
                          " vertices");
  }
  if (!std::isfinite(tolerance) || tolerance <= 0.0 || tolerance >= 1.0 || max_iterations < 1) {
    throw InvalidArgument("tolerance is " + std::to_string(tolerance) +
                          " (legal (0, 1)), max_iterations is " + std::to_string(max_iterations) +
                          " (legal >= 1)");
  }
  const VectorXd steps = time_steps(schedule);
  ReferenceScaleSpace result;
  result.levels.resize(schedule.num_levels, signal.size());
  result.residual.setZero(steps.size());
  result.levels.row(0) = signal;
  VectorXd current = signal;
  for (Index l = 0; l < steps.size(); ++l) {
    if (run.cancelled()) {
      result.status = Status::cancelled;
      result.levels.conservativeResize(l + 1, Eigen::NoChange);
      return result;
    }
    const Solve solve = conjugate_gradients(op, steps[l], op.mass.cwiseProduct(current), current,
                                            tolerance, max_iterations);
    current = solve.x;
    result.levels.row(l + 1) = current;
    result.residual[l] = solve.residual;
    result.num_products += solve.products;
    // Rounding alone leaves a residual of about 1e-15 sqrt(V): ten times the tolerance is a
    // failure.
    if (solve.residual > 10.0 * tolerance) result.status = Status::not_converged;
    run.report(static_cast<double>(l + 1) / static_cast<double>(steps.size()));
  }
  return result;
}

}  // namespace dupin
