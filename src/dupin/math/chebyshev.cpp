#include "dupin/math/chebyshev.h"

#include <cmath>
#include <numbers>
#include <string>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Samples at the Chebyshev points of the first kind, one row a node.
MatrixXd sample(const std::function<VectorXd(double)>& functions, double s_max, Index nodes) {
  MatrixXd values;
  for (Index j = 0; j < nodes; ++j) {
    const double half_angle =
        std::numbers::pi * (static_cast<double>(j) + 0.5) / static_cast<double>(2 * nodes);
    // 1 - cos(2a) = 2 sin(a)^2 keeps full relative accuracy near s = 0, where the filters are
    // steep.
    const double sine = std::sin(half_angle);
    const VectorXd f = functions(s_max * sine * sine);
    if (j == 0) values.resize(nodes, f.size());
    values.row(j) = f;
  }
  return values;
}

// c(k, l) = (2 - [k = 0]) / n sum_j f_l(j) cos(pi k (j + 1/2) / n), through one table of cosines.
MatrixXd cosine_transform(const MatrixXd& values) {
  const Index n = values.rows();
  VectorXd table(4 * n);
  for (Index i = 0; i < 4 * n; ++i) {
    table[i] = std::cos(std::numbers::pi * static_cast<double>(i) / static_cast<double>(2 * n));
  }
  MatrixXd result(n, values.cols());
  constexpr Index kBlock = 64;
  for (Index first = 0; first < n; first += kBlock) {
    const Index count = std::min(kBlock, n - first);
    MatrixXd cosines(count, n);
    for (Index k = 0; k < count; ++k) {
      for (Index j = 0; j < n; ++j) cosines(k, j) = table[((first + k) * (2 * j + 1)) % (4 * n)];
    }
    result.middleRows(first, count).noalias() = cosines * values;
  }
  result *= 2.0 / static_cast<double>(n);
  result.row(0) *= 0.5;
  return result;
}

bool has_converged(const MatrixXd& coefficients) {
  const Index n = coefficients.rows();
  const Index quarter = n / 4;
  for (Index l = 0; l < coefficients.cols(); ++l) {
    const double largest = coefficients.col(l).cwiseAbs().maxCoeff();
    if (coefficients.col(l).tail(quarter).cwiseAbs().maxCoeff() > 1e-14 * largest) return false;
  }
  return true;
}

}  // namespace

MatrixXd chebyshev_coefficients(const std::function<VectorXd(double)>& functions, double s_max,
                                Index max_nodes) {
  for (Index nodes = 64;; nodes *= 2) {
    MatrixXd coefficients = cosine_transform(sample(functions, s_max, nodes));
    if (has_converged(coefficients)) return coefficients;
    if (2 * nodes > max_nodes) {
      throw InvalidArgument("the functions need more than " + std::to_string(max_nodes) +
                                " Chebyshev nodes on [0, " + std::to_string(s_max) + "]",
                            "smaller time steps, fewer levels, or umbrella weights");
    }
  }
}

Eigen::VectorXi truncation_lengths(const MatrixXd& coefficients, const VectorXd& tolerance) {
  Eigen::VectorXi lengths(coefficients.cols());
  for (Index l = 0; l < coefficients.cols(); ++l) {
    double tail = 0.0;
    Index length = coefficients.rows();
    while (length > 1 && tail + std::abs(coefficients(length - 1, l)) <= tolerance[l]) {
      tail += std::abs(coefficients(length - 1, l));
      --length;
    }
    lengths[l] = static_cast<int>(length);
  }
  return lengths;
}

double evaluate_chebyshev(const MatrixXd& coefficients, Index l, Index length, double s,
                          double s_max) {
  const double y = 1.0 - 2.0 * s / s_max;
  double b1 = 0.0;
  double b2 = 0.0;
  for (Index k = length - 1; k >= 1; --k) {
    const double b0 = coefficients(k, l) + 2.0 * y * b1 - b2;
    b2 = b1;
    b1 = b0;
  }
  return coefficients(0, l) + y * b1 - b2;
}

}  // namespace dupin
