#include "dupin/warp/pair_factor.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "dupin/base/error.h"
#include "dupin/base/random.h"
#include "dupin/warp/planar_graph.h"
#include "dupin/warp/supernodes.h"
#include "tests/support/planar_shapes.h"

namespace dupin {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Matrix = Eigen::SparseMatrix<double>;

Matrix from_entries(Index size, const std::vector<Eigen::Triplet<double>>& entries) {
  Matrix matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// Lower triangle of a weighted Laplacian of the edges of a mesh, with a little on the diagonal.
Matrix laplacian(const PlanarMesh& mesh, std::uint64_t seed) {
  const PlanarGraph graph = make_planar_graph(mesh);
  const Adjacency& ring = graph.topology.ring;
  Rng rng(seed);
  std::vector<Eigen::Triplet<double>> entries;
  for (int v = 0; v < mesh.points.rows(); ++v) {
    entries.emplace_back(v, v, 0.01);
    for (const std::int32_t* k = ring.begin(v); k != ring.end(v); ++k) {
      if (*k > v) continue;
      const double weight = 0.1 + rng.uniform();
      entries.emplace_back(v, *k, -weight);
      entries.emplace_back(v, v, weight);
      entries.emplace_back(*k, *k, weight);
    }
  }
  return from_entries(mesh.points.rows(), entries);
}

MatrixXd solved(const PairFactor& factor, const MatrixXd& right) {
  std::vector<double> pairs(static_cast<std::size_t>(2 * right.rows()));
  for (Index i = 0; i < right.rows(); ++i) {
    for (Index axis = 0; axis < 2; ++axis)
      pairs[static_cast<std::size_t>(2 * factor.place()[i] + axis)] = right(i, axis);
  }
  factor.solve(pairs.data());
  MatrixXd result(right.rows(), 2);
  for (Index i = 0; i < right.rows(); ++i) {
    for (Index axis = 0; axis < 2; ++axis)
      result(i, axis) = pairs[static_cast<std::size_t>(2 * factor.place()[i] + axis)];
  }
  return result;
}

MatrixXd random_sides(Index size, std::uint64_t seed) {
  Rng rng(seed);
  MatrixXd right(size, 2);
  for (Index i = 0; i < right.size(); ++i) right.data()[i] = rng.uniform() - 0.5;
  return right;
}

// A x = b for both right-hand sides, from one column to blocks of more than 16 columns. The error
// of a solution by Cholesky is a few roundings of |A| |x|.
TEST(PairFactor, SolvesForBothSides) {
  for (const int side : {1, 2, 5, 13, 40}) {
    SCOPED_TRACE(side);
    const Matrix lower = laplacian(test::planar_grid(side, side, 1.0), 3);
    const MatrixXd right = random_sides(lower.rows(), 4);
    const MatrixXd x = solved(PairFactor(lower), right);
    const MatrixXd product = lower.selfadjointView<Eigen::Lower>() * x;
    const double size = lower.coeffs().cwiseAbs().maxCoeff() * x.cwiseAbs().maxCoeff();
    EXPECT_LE((product - right).cwiseAbs().maxCoeff(), 1e-13 * size);
  }
}

// Whatever the zeros: no entry beside the diagonal, all of them, an arrow, and a chain.
TEST(PairFactor, AgreesWithTheDenseFactor) {
  constexpr int kSize = 37;
  for (int kind = 0; kind < 4; ++kind) {
    SCOPED_TRACE(kind);
    std::vector<Eigen::Triplet<double>> entries;
    Rng rng(7);
    for (int i = 0; i < kSize; ++i) {
      entries.emplace_back(i, i, kSize + rng.uniform());
      for (int j = 0; j < i; ++j) {
        const bool is_there = kind == 1 || (kind == 2 && j == 0) || (kind == 3 && j == i - 1);
        if (is_there) entries.emplace_back(i, j, rng.uniform() - 0.5);
      }
    }
    const Matrix lower = from_entries(kSize, entries);
    const MatrixXd dense = MatrixXd(lower).selfadjointView<Eigen::Lower>();
    const MatrixXd right = random_sides(kSize, 8);
    const MatrixXd expected = dense.llt().solve(right);
    EXPECT_LE((solved(PairFactor(lower), right) - expected).cwiseAbs().maxCoeff(), 1e-15);
  }
}

// The rows of a supernode are those in which elimination leaves an entry in its columns, and those
// that joining adds hold zeros: all rows of the dense factor are there.
TEST(PairFactor, SupernodesHoldAllEntriesOfTheFactor) {
  const Matrix lower = laplacian(test::jittered(test::planar_grid(9, 7, 1.0), 0.2), 5);
  const detail::Supernodes nodes = detail::find_supernodes(lower);
  const Index size = lower.rows();
  MatrixXd dense = MatrixXd::Zero(size, size);
  for (Index j = 0; j < size; ++j) {
    for (Matrix::InnerIterator entry(lower, j); entry; ++entry) {
      const int a = nodes.place[entry.row()];
      const int b = nodes.place[j];
      dense(std::max(a, b), std::min(a, b)) = entry.value();
    }
  }
  const MatrixXd factor = MatrixXd(dense.selfadjointView<Eigen::Lower>()).llt().matrixL();
  Index num_stored = 0;
  Index num_entries = 0;
  for (std::int32_t s = 0; s < nodes.count(); ++s) {
    const std::int32_t begin = nodes.first[static_cast<std::size_t>(s)];
    const std::int32_t end = nodes.first[static_cast<std::size_t>(s) + 1];
    const auto first = nodes.row.begin() + nodes.row_begin[static_cast<std::size_t>(s)];
    const auto last = first + nodes.num_rows(s);
    EXPECT_TRUE(std::is_sorted(first, last));
    for (std::int32_t j = begin; j < end; ++j) {
      num_stored += end - j + nodes.num_rows(s);
      for (std::int32_t i = j; i < size; ++i) {
        if (factor(i, j) == 0.0) continue;
        ++num_entries;
        EXPECT_TRUE(i < end || std::binary_search(first, last, i)) << i << ", " << j;
      }
    }
  }
  // A supernode of more than four columns holds at most 15 % zeros, of up to four 30 %.
  EXPECT_LE(static_cast<double>(num_stored), static_cast<double>(num_entries) / 0.7);
}

TEST(PairFactor, RefusesWhatIsNotPositiveDefinite) {
  const auto code_of = [](const Matrix& lower) -> std::string {
    try {
      PairFactor factor(lower);
    } catch (const Error& error) {
      return error.code();
    }
    return "";
  };
  EXPECT_EQ(code_of(from_entries(2, {{0, 0, 1.0}, {1, 0, 2.0}, {1, 1, 1.0}})), "E_NOT_CONVERGED");
  EXPECT_EQ(code_of(from_entries(2, {{0, 0, 1.0}, {1, 1, 0.0}})), "E_NOT_CONVERGED");
  EXPECT_EQ(code_of(from_entries(2, {{0, 0, 1.0}, {1, 0, 0.5}, {1, 1, 1.0}})), "");
}

TEST(PairFactor, CancelledThrows) {
  const RunControl run = RunControl::create();
  run.cancel();
  try {
    PairFactor factor(laplacian(test::planar_grid(3, 3, 1.0), 1), run);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.errc(), Errc::interrupted);
  }
}

TEST(PairFactor, OfNothingSolvesNothing) {
  const PairFactor factor(Matrix(0, 0));
  EXPECT_EQ(factor.size(), 0);
  double nothing = 5.0;
  factor.solve(&nothing);
  EXPECT_EQ(nothing, 5.0);
}

}  // namespace
}  // namespace dupin
