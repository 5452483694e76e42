#include "dupin/math/chebyshev.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "dupin/base/error.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

// Samples at the Chebyshev points of the first kind, one row a node.
MatrixXd sample(const std::function<VectorXd(double)>& functions, double s_max, Index nodes,
                const RunControl& run) {
  MatrixXd values;
  for (Index j = 0; j < nodes; ++j) {
    if (j % 64 == 0 && run.cancelled()) return {};
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

// Discrete Fourier transform of a power of two of values, in place (Cooley and Tukey).
// unit(k) = exp(-2 pi i k / n), each computed by itself, so that no error builds up.
void fourier_transform(std::vector<Complex>& values, const std::vector<Complex>& unit) {
  const std::size_t n = values.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1U;
    for (; (j & bit) != 0; bit >>= 1U) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(values[i], values[j]);
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    const std::size_t half = length / 2;
    for (std::size_t first = 0; first < n; first += length) {
      for (std::size_t k = 0; k < half; ++k) {
        const Complex& w = unit[k * (n / length)];
        const Complex& b = values[first + half + k];
        // Written out: the product of std::complex looks for infinities.
        const Complex turned(w.real() * b.real() - w.imag() * b.imag(),
                             w.real() * b.imag() + w.imag() * b.real());
        values[first + half + k] = values[first + k] - turned;
        values[first + k] += turned;
      }
    }
  }
}

// c(k, l) = (2 - [k = 0]) / n sum_j f_l(j) cos(pi k (j + 1/2) / n) from one Fourier transform for
// two columns: with v the even rows followed by the odd ones backwards, the sum is the real part of
// exp(-i pi k / (2 n)) V(k) (Makhoul, "A fast cosine transform in one and two dimensions", 1980).
MatrixXd cosine_transform(const MatrixXd& values, const RunControl& run) {
  const Index n = values.rows();
  std::vector<Complex> unit(static_cast<std::size_t>(n));
  std::vector<Complex> quarter(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) {
    const double angle = std::numbers::pi * static_cast<double>(k) / static_cast<double>(2 * n);
    quarter[static_cast<std::size_t>(k)] = {std::cos(angle), -std::sin(angle)};
    unit[static_cast<std::size_t>(k)] = {std::cos(4.0 * angle), -std::sin(4.0 * angle)};
  }
  MatrixXd result(n, values.cols());
  std::vector<Complex> both(static_cast<std::size_t>(n));
  for (Index l = 0; l < values.cols(); l += 2) {
    if (run.cancelled()) return {};
    const Index other = std::min(l + 1, values.cols() - 1);
    for (Index j = 0; j < n; ++j) {
      const Index row = 2 * j < n ? 2 * j : 2 * (n - j) - 1;
      both[static_cast<std::size_t>(j)] = {values(row, l), values(row, other)};
    }
    fourier_transform(both, unit);
    for (Index k = 0; k < n; ++k) {
      const Complex at = both[static_cast<std::size_t>(k)];
      const Complex mirror = std::conj(both[static_cast<std::size_t>((n - k) % n)]);
      const Complex w = quarter[static_cast<std::size_t>(k)];
      const Complex first = 0.5 * (at + mirror);
      const Complex second(0.5 * (at - mirror).imag(), -0.5 * (at - mirror).real());
      result(k, other) = w.real() * second.real() - w.imag() * second.imag();
      result(k, l) = w.real() * first.real() - w.imag() * first.imag();
    }
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
                                Index max_nodes, const RunControl& run) {
  for (Index nodes = 64;; nodes *= 2) {
    const MatrixXd values = sample(functions, s_max, nodes, run);
    if (run.cancelled()) return {};
    MatrixXd coefficients = cosine_transform(values, run);
    if (run.cancelled()) return {};
    if (has_converged(coefficients)) return coefficients;
    if (2 * nodes > max_nodes) {
      throw Error(Errc::numerical, "E_NOT_CONVERGED",
                  "the filters need more than " + std::to_string(max_nodes) +
                      " Chebyshev nodes on [0, " + std::to_string(s_max) + "]",
                  {}, "smaller time steps, fewer levels, or umbrella weights");
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
